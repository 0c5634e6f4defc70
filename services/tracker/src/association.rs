use messages::Detection;
use nalgebra::{Matrix3, Vector3};

use crate::assignment::{Assignment, Edge, NONE};
use crate::gather::{Gathered, MAX_SIGHTINGS};
use crate::measurement::{depth, spread};
use crate::params::Params;
use crate::sighting::Sighting;
use crate::tracked::Tracked;

/// Most clusters that a track is weighed against: its nearest. Bounds the work where all stand on one heap.
const MAX_EDGES: usize = 8;
/// How exactly a mean of returns is known, whatever is seen [m].
const LEAST_M: f64 = 0.02;

/// Which cluster is which track: gates, global nearest neighbour, then pieces of obstacles, then obstacles in one cluster.
///
/// What is compared is where returns are, not where a solid was fitted: that cannot be grossly wrong.
#[derive(Debug)]
pub(crate) struct Association {
    edges: Vec<[Edge; MAX_EDGES]>,
    counts: Vec<usize>,
    assignment: Assignment,
    /// Sightings by the x of their centroids.
    by_x: Vec<u32>,
    /// Of each track the sighting that is assigned to it, or [`NONE`].
    own: Vec<u32>,
    /// Of each sighting the track that it is, or is a piece of, or [`NONE`].
    owner: Vec<u32>,
    /// Of each track the sighting of several obstacles that it must be in, or [`NONE`].
    shared: Vec<u32>,
    /// Of each sighting the tracks that share it.
    sharers: Vec<u32>,
    /// Of each track the clusters that it is seen as.
    pieces: Vec<u32>,
}

impl Association {
    /// For at most so many tracks.
    pub(crate) fn new(tracks: usize) -> Self {
        Self {
            edges: Vec::with_capacity(tracks),
            counts: Vec::with_capacity(tracks),
            assignment: Assignment::new(tracks, MAX_SIGHTINGS),
            by_x: Vec::with_capacity(MAX_SIGHTINGS),
            own: Vec::with_capacity(tracks),
            owner: Vec::with_capacity(MAX_SIGHTINGS),
            shared: Vec::with_capacity(tracks),
            sharers: Vec::with_capacity(MAX_SIGHTINGS),
            pieces: Vec::with_capacity(tracks),
        }
    }

    /// Associates the sightings of one sweep. `end_ns`: the sweep's end, for which the tracks' uncertainty is taken.
    pub(crate) fn associate(
        &mut self,
        tracks: &[Tracked],
        sightings: &[Sighting],
        gathered: &Gathered,
        end_ns: u64,
        params: &Params,
    ) {
        self.gate(tracks, sightings, end_ns, params);
        let (edges, counts) = (&self.edges, &self.counts);
        let of = |row: u32| &edges[row as usize][..counts[row as usize]];
        let own = self.assignment.solve(tracks.len(), sightings.len(), params.association.gate, of);
        self.own.clear();
        self.own.extend_from_slice(own);
        self.owner.clear();
        self.owner.resize(sightings.len(), NONE);
        self.pieces.clear();
        self.pieces.resize(tracks.len(), 0);
        for (track, &sighting) in self.own.iter().enumerate() {
            if sighting != NONE {
                self.owner[sighting as usize] = track as u32;
                self.pieces[track] = 1;
            }
        }
        self.split(tracks, sightings, params);
        self.merge(tracks, sightings, gathered, params);
    }

    /// Lists each track's possible clusters, the likeliest first.
    fn gate(&mut self, tracks: &[Tracked], sightings: &[Sighting], end_ns: u64, params: &Params) {
        self.by_x.clear();
        self.by_x.extend(0..sightings.len() as u32);
        let x = |place: &u32| sightings[*place as usize].centroid_m.x;
        self.by_x.sort_unstable_by(|a, b| x(a).total_cmp(&x(b)).then(a.cmp(b)));
        self.edges.clear();
        self.counts.clear();
        for track in tracks {
            let mut edges = [Edge::default(); MAX_EDGES];
            let mut count = 0;
            let gate = Gate::new(track, end_ns, params);
            let from = self.by_x.partition_point(|place| x(place) < gate.expected_m.x - gate.reach_m);
            for &place in &self.by_x[from..] {
                let sighting = &sightings[place as usize];
                if sighting.centroid_m.x > gate.expected_m.x + gate.reach_m {
                    break;
                }
                let Some(cost) = gate.cost(track, sighting, params) else { continue };
                let rank = edges[..count].partition_point(|edge| (edge.cost, edge.column) < (cost, place));
                if rank < MAX_EDGES {
                    count = (count + 1).min(MAX_EDGES);
                    edges[rank..count].rotate_right(1);
                    edges[rank] = Edge { column: place, cost };
                }
            }
            self.edges.push(edges);
            self.counts.push(count);
        }
    }

    /// Clusters that nobody owns, in the body of a confirmed track: pieces of it.
    fn split(&mut self, tracks: &[Tracked], sightings: &[Sighting], params: &Params) {
        for (place, sighting) in sightings.iter().enumerate() {
            if self.owner[place] != NONE {
                continue;
            }
            let holder = tracks.iter().position(|track| {
                track.life.is_confirmed()
                    && track.holds(&sighting.centroid_m, sighting.time_ns, params.association.margin_m)
            });
            if let Some(track) = holder {
                self.owner[place] = track as u32;
                self.pieces[track] += 1;
            }
        }
    }

    /// Confirmed tracks without a cluster, at a cluster that no single solid explains and that is wide enough to hold
    /// them: it is several obstacles.
    fn merge(&mut self, tracks: &[Tracked], sightings: &[Sighting], gathered: &Gathered, params: &Params) {
        self.shared.clear();
        self.shared.resize(tracks.len(), NONE);
        self.sharers.clear();
        self.sharers.resize(sightings.len(), 0);
        for (place, track) in tracks.iter().enumerate() {
            if self.pieces[place] > 0 || !track.life.is_confirmed() {
                continue;
            }
            let near = sightings.iter().enumerate().filter_map(|(at, sighting)| {
                let many = is_one_of_many(&gathered.detections()[sighting.detection], params);
                let away = (track.expected_m(sighting.time_ns) - sighting.centroid_m).norm();
                let reach_m = sighting.half_width_m + track.half_m() + params.association.margin_m;
                (many && away < reach_m).then_some((at, away))
            });
            let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            if let Some((at, _)) = nearest {
                self.shared[place] = at as u32;
                self.sharers[at] += 1;
            }
        }
    }

    /// What a track is seen as: its own sighting; or all of its pieces as one.
    pub(crate) fn seen_as(&self, track: usize, sightings: &[Sighting]) -> Option<Sighting> {
        match self.pieces[track] {
            0 => None,
            1 if self.own[track] != NONE => Some(sightings[self.own[track] as usize]),
            _ => {
                let owned =
                    |(place, sighting): (usize, &'_ Sighting)| (self.owner[place] == track as u32).then_some(*sighting);
                sightings.iter().enumerate().filter_map(owned).reduce(|all, piece| all.joined(&piece))
            }
        }
    }

    /// The sighting that a track shares with others, where it has none of its own.
    pub(crate) fn shared(&self, track: usize) -> Option<usize> {
        (self.shared[track] != NONE).then_some(self.shared[track] as usize)
    }

    /// Whether a sighting is a track's, or one of several.
    pub(crate) fn is_taken(&self, sighting: usize) -> bool {
        self.owner[sighting] != NONE || self.sharers[sighting] > 0
    }

    /// The track that a sighting is, or is a piece of.
    pub(crate) fn owner(&self, sighting: usize) -> Option<usize> {
        (self.owner[sighting] != NONE).then_some(self.owner[sighting] as usize)
    }

    /// Whether what a track is seen as is more than that obstacle.
    pub(crate) fn is_shared(&self, track: usize) -> bool {
        self.own[track] != NONE && self.sharers[self.own[track] as usize] > 0
    }

    /// Number of clusters that a track is seen as.
    pub(crate) fn pieces(&self, track: usize) -> u32 {
        self.pieces[track]
    }
}

/// A cluster with enough returns for a class, and none: no single solid explains it.
pub(crate) fn is_one_of_many(detection: &Detection, params: &Params) -> bool {
    detection.solids == 0 && detection.summary.points >= params.birth.min_points
}

/// What a track expects, as far as it is the same for all sightings.
struct Gate {
    /// Its centre at the sweep's end [m].
    expected_m: Vector3<f64>,
    /// Along x no cluster of it is farther from there [m].
    reach_m: f64,
    place: Matrix3<f64>,
    half_m: f64,
}

impl Gate {
    fn new(track: &Tracked, end_ns: u64, params: &Params) -> Self {
        let half_m = track.half_m();
        let half_variance = track.filter.size_covariance().trace() / 12.0;
        let own = params.centroid.depth * params.centroid.depth * half_variance + LEAST_M * LEAST_M;
        let place = track.spread_m2(end_ns, params) + Matrix3::identity() * own;
        let widest = place.trace() + 3.0 * spread(1.0, half_m, false, &params.centroid);
        // Within a sweep it moves on by what it moves in its period, at most some tenths of a second.
        let moved_m = 0.5 * track.filter.velocity_mps().norm();
        let reach_m = (params.association.gate * widest).sqrt() + params.centroid.depth * half_m + moved_m;
        Self { expected_m: track.expected_m(end_ns), reach_m, place, half_m }
    }

    /// d² + ln |S|: twice the negative logarithm of a Gaussian, but for a constant; none outside the gate.
    fn cost(&self, track: &Tracked, sighting: &Sighting, params: &Params) -> Option<f64> {
        let behind = depth(sighting.points, &params.centroid) * self.half_m;
        let visible = track.expected_m(sighting.time_ns) - sighting.line_of_sight * behind;
        let away = sighting.centroid_m - visible;
        let late = track.filter.velocity_mps().norm() * sighting.time_sigma_s;
        let own = spread(sighting.points, self.half_m, false, &params.centroid) + late * late;
        let sum = self.place + Matrix3::identity() * own;
        if away.norm_squared() > params.association.gate * sum.trace() {
            return None;
        }
        let root = sum.cholesky()?;
        let distance = away.dot(&root.solve(&away));
        let cost = distance + 2.0 * root.l_dirty().diagonal().map(f64::ln).sum();
        (distance <= params.association.gate && cost.is_finite()).then_some(cost)
    }
}
