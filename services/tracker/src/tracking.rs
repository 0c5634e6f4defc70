use messages::{MAX_TRACKS, Part, TrackTable, Verdict};

use crate::association::{Association, is_one_of_many};
use crate::frame::{Frame, seconds};
use crate::gather::{Gathered, MAX_SIGHTINGS};
use crate::occlusion::is_hidden;
use crate::params::Params;
use crate::sighting::Sighting;
use crate::table::{Order, Seen};
use crate::tracked::Tracked;

/// All that is known between two sweeps.
#[derive(Clone, Debug)]
pub(crate) struct Tracks {
    all: Vec<Tracked>,
    /// Number of the next track.
    next_id: u64,
    last: Option<Last>,
}

/// What matters of the sweep before.
#[derive(Clone, Copy, Debug)]
struct Last {
    sweep: u64,
    start_ns: u64,
    period_ns: u64,
    frame: Frame,
}

impl Tracks {
    pub(crate) fn new() -> Self {
        Self { all: Vec::with_capacity(MAX_TRACKS), next_id: 0, last: None }
    }

    /// Makes these tracks the same as others, without new memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.all.clone_from(&other.all);
        self.next_id = other.next_id;
        self.last = other.last;
    }

    /// Forgets all but the numbers that were given.
    pub(crate) fn begin_anew(&mut self) {
        self.all.clear();
        self.last = None;
    }

    /// Number of the last sweep that was processed.
    pub(crate) fn last_sweep(&self) -> Option<u64> {
        self.last.map(|last| last.sweep)
    }

    /// A number for a new track. The first of a life of the room follows from the sweep: at most [`MAX_TRACKS`] are born
    /// in one, so that no life before it got as far.
    fn give_id(&mut self, sweep: u64) -> u64 {
        if self.next_id == 0 {
            self.next_id = sweep.saturating_mul(MAX_TRACKS as u64).saturating_add(1);
        }
        let id = self.next_id;
        self.next_id = self.next_id.saturating_add(1);
        id
    }

    #[cfg(test)]
    pub(crate) fn set_next_id(&mut self, id: u64) {
        self.next_id = id;
    }

    #[cfg(test)]
    pub(crate) fn next_id(&self) -> u64 {
        self.next_id
    }
}

/// The sweep that is being processed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep<'a> {
    /// Its number.
    pub(crate) number: u64,
    /// How the sensor moved.
    pub(crate) frame: Frame,
    /// Sensor time of its end [ns].
    pub(crate) end_ns: u64,
    pub(crate) gathered: &'a Gathered,
    pub(crate) params: &'a Params,
}

/// What is needed to process a sweep, and means nothing between two.
#[derive(Debug)]
pub(crate) struct Scratch {
    sightings: Vec<Sighting>,
    association: Association,
    seen: Seen,
    order: Order,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            sightings: Vec::with_capacity(MAX_SIGHTINGS),
            association: Association::new(MAX_TRACKS),
            seen: Vec::with_capacity(MAX_SIGHTINGS + MAX_TRACKS),
            order: Order::new(),
        }
    }
}

impl Tracks {
    /// Takes in a sweep and writes where all tracks are at its end.
    pub(crate) fn process(
        &mut self,
        part: Part,
        gathered: &Gathered,
        scratch: &mut Scratch,
        params: &Params,
        table: &mut TrackTable,
    ) -> Verdict {
        let (frame, period_ns) = self.step(part, gathered, params);
        let end_ns = frame.start_ns.saturating_add(period_ns);
        let sweep = Sweep { number: part.sweep, frame, end_ns, gathered, params };
        let Scratch { sightings, association, seen, order } = scratch;
        sightings.clear();
        for (place, detection) in gathered.detections().iter().enumerate() {
            sightings.push(Sighting::new(place, detection, gathered.header(), &frame));
        }
        association.associate(&self.all, sightings, gathered, end_ns, params);
        list(&self.all, sightings, association, seen);
        for (place, track) in self.all.iter_mut().enumerate() {
            update(track, place, &sweep, sightings, association);
        }
        self.bury(&sweep, seen);
        let verdict = self.bear(&sweep, sightings, association, seen);
        order.write(&self.all, seen, &sweep, table);
        verdict
    }

    /// Where and when the sweep was. Where the clock stepped, or the frame is another one, all tracks begin anew.
    fn step(&mut self, part: Part, gathered: &Gathered, params: &Params) -> (Frame, u64) {
        let known = gathered.header().period_ns > 0;
        let mut frame = Frame::new(part.sensor_time_ns, &gathered.header().ego);
        let mut period_ns = gathered.header().period_ns;
        if let Some(last) = self.last {
            let gone_s = seconds(last.start_ns, part.sensor_time_ns);
            if !(gone_s > 0.0 && gone_s <= params.lifecycle.gap_s) || known && frame.inertial != last.frame.inertial {
                self.begin_anew();
            } else if !known {
                // Nothing is known of the sweep: all goes on as it did.
                frame = last.frame.at_start(part.sensor_time_ns);
                period_ns = last.period_ns;
            }
        }
        self.last = Some(Last { sweep: part.sweep, start_ns: part.sensor_time_ns, period_ns, frame });
        (frame, period_ns)
    }

    /// Gives up tracks that were missed too often, whose place nobody knows any more, or that lie in an older one.
    fn bury(&mut self, sweep: &Sweep<'_>, seen: &mut Seen) {
        let Sweep { end_ns, params, .. } = *sweep;
        let lost_m2 = params.lifecycle.lost_sigma_m * params.lifecycle.lost_sigma_m;
        let mut kept = 0;
        for place in 0..self.all.len() {
            let track = &self.all[place];
            let unseen = track.life.ages(sweep.number).1 > 0;
            let unmeasured = track.filter_ns < track.seen_ns || unseen;
            let long_ago = unseen && seconds(track.seen_ns, end_ns) > params.lifecycle.unseen_s;
            let lost = long_ago || unmeasured && track.spread_m2(end_ns, params).trace() > lost_m2;
            let double = self.all[..kept].iter().any(|older| are_one(older, track, end_ns));
            if track.life.is_over(&params.lifecycle) || lost || double {
                seen.retain(|pair| pair.0 != kept as u32);
                // Places move up by one.
                seen.iter_mut().filter(|pair| pair.0 > kept as u32).for_each(|pair| pair.0 -= 1);
            } else {
                self.all.swap(kept, place);
                kept += 1;
            }
        }
        self.all.truncate(kept);
    }

    /// New tracks of clusters that are nobody's.
    fn bear(
        &mut self,
        sweep: &Sweep<'_>,
        sightings: &[Sighting],
        association: &Association,
        seen: &mut Seen,
    ) -> Verdict {
        for (place, sighting) in sightings.iter().enumerate() {
            let detection = &sweep.gathered.detections()[sighting.detection];
            if detection.summary.points < sweep.params.birth.min_points || association.is_taken(place) {
                continue;
            }
            if self.all.len() == MAX_TRACKS {
                return Verdict::PartialTracks;
            }
            let id = self.give_id(sweep.number);
            seen.push((self.all.len() as u32, sighting.key));
            self.all.push(Tracked::born(id, sweep, sighting));
        }
        Verdict::Complete
    }
}

/// The clusters that each track is seen as, in order of tracks, then keys.
fn list(tracks: &[Tracked], sightings: &[Sighting], association: &Association, seen: &mut Seen) {
    seen.clear();
    for (place, sighting) in sightings.iter().enumerate() {
        if let Some(track) = association.owner(place) {
            seen.push((track as u32, sighting.key));
        }
    }
    for place in 0..tracks.len() {
        if let Some(sighting) = association.shared(place) {
            seen.push((place as u32, sightings[sighting].key));
        }
    }
    seen.sort_unstable();
}

/// Brings one track up to the sweep.
fn update(track: &mut Tracked, place: usize, sweep: &Sweep<'_>, sightings: &[Sighting], association: &Association) {
    let Sweep { gathered, params, .. } = *sweep;
    if let Some(sighting) = association.seen_as(place, sightings) {
        let many = is_one_of_many(&gathered.detections()[sighting.detection], params);
        let shared = association.is_shared(place);
        track.see(sweep, &sighting, many || association.pieces(place) > 1 || shared, shared);
    } else if let Some(shared) = association.shared(place) {
        track.glimpse(sweep, sightings[shared].time_ns);
    } else if gathered.is_whole() {
        let solid_of = |sighting: &Sighting| gathered.solid(sighting.detection);
        if !is_hidden(sightings, solid_of, |time_ns| track.expected_m(time_ns), track.half_m()) {
            track.life.missed();
        }
    }
}

/// Whether two tracks are of one obstacle: two bodies cannot be in one place.
fn are_one(older: &Tracked, younger: &Tracked, end_ns: u64) -> bool {
    let away = (older.expected_m(end_ns) - younger.expected_m(end_ns)).norm();
    away < 0.25 * (older.half_m() + younger.half_m())
}
