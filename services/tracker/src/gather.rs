use lidar::MAX_RETURNS;
use messages::{Detection, Detections, MAX_CLUSTERS, MAX_TRACK_KEYS, MAX_TRACKS, Part, Solid, SweepHeader};

/// Most clusters of a sweep that tracks are looked for in: the keys of all, and one more for each track that shares a
/// cluster with another, fit the message.
pub(crate) const MAX_SIGHTINGS: usize = MAX_TRACK_KEYS - MAX_TRACKS;
/// Coordinates beyond this are none [m]: no lidar, and squares of squares stay finite.
const FARTHEST_M: f32 = 1e6;
/// The same of a covariance's entries.
const WIDEST: f32 = 1e12;

/// The detections of one sweep, part by part.
#[derive(Debug)]
pub(crate) struct Gathered {
    detections: Vec<Detection>,
    solids: Vec<Solid>,
    /// Of the first part of which anything is known; `complete` of the last.
    header: SweepHeader,
    begun: Option<Begun>,
}

/// The sweep that is being gathered.
#[derive(Clone, Copy, Debug)]
struct Begun {
    sweep: u64,
    attempt: u32,
    next_sector: u32,
    /// Whether all parts so far came and were known.
    whole: bool,
}

impl Gathered {
    /// Takes all memory: as many clusters as there are returns, though it is touched only where they come.
    pub(crate) fn new() -> Self {
        Self {
            detections: Vec::with_capacity(MAX_CLUSTERS),
            solids: Vec::with_capacity(MAX_RETURNS / 5),
            header: SweepHeader::default(),
            begun: None,
        }
    }

    /// Whether a part goes on with the sweep that is being gathered.
    pub(crate) fn goes_on(&self, part: Part) -> bool {
        self.begun.is_some_and(|begun| {
            begun.sweep == part.sweep && begun.attempt == part.attempt && begun.next_sector <= part.sector
        })
    }

    /// Begins a sweep; what there was of another is forgotten.
    pub(crate) fn begin(&mut self, part: Part) {
        self.detections.clear();
        self.solids.clear();
        self.header = SweepHeader::default();
        self.begun = Some(Begun { sweep: part.sweep, attempt: part.attempt, next_sector: 0, whole: true });
    }

    /// Forgets the sweep.
    pub(crate) fn forget(&mut self) {
        self.begun = None;
    }

    /// Takes a well-formed part.
    pub(crate) fn add(&mut self, part: Part, input: &Detections) {
        let Some(begun) = &mut self.begun else { return };
        let known = input.header.period_ns > 0;
        begun.whole &= known && !part.is_shed() && begun.next_sector == part.sector;
        begun.next_sector = part.sector.saturating_add(1);
        if known {
            self.header = input.header;
        }
        for detection in &input.detections {
            if self.detections.len() == self.detections.capacity() {
                begun.whole = false;
                break;
            }
            let mut own = Detection { solids: 0, ..*detection };
            if let Some(solid) = detection.solid_place().and_then(|place| input.solids.get(place))
                && self.solids.len() < self.solids.capacity()
            {
                own.first_solid = self.solids.len() as u32;
                own.solids = 1;
                self.solids.push(*solid);
            }
            self.detections.push(own);
        }
    }

    /// Puts the sweep in order of keys, with no more clusters than can be looked at: those with the most returns.
    pub(crate) fn sort(&mut self) {
        if self.detections.len() > MAX_SIGHTINGS {
            let by_returns = |one: &Detection| (std::cmp::Reverse(one.summary.points), one.summary.key);
            self.detections.sort_unstable_by_key(by_returns);
            self.detections.truncate(MAX_SIGHTINGS);
        }
        self.detections.sort_unstable_by_key(|one| one.summary.key);
    }

    pub(crate) fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// The header; empty where nothing was known of any part.
    pub(crate) fn header(&self) -> &SweepHeader {
        &self.header
    }

    /// Whether every place that the sensor looks at was seen.
    pub(crate) fn is_whole(&self) -> bool {
        self.header.is_complete() && self.begun.is_some_and(|begun| begun.whole)
    }

    pub(crate) fn solid(&self, place: usize) -> Option<&Solid> {
        self.detections.get(place)?.solid_place().and_then(|place| self.solids.get(place))
    }
}

/// Whether detections part members and solids among them, in order, and hold numbers that can be reckoned with.
pub(crate) fn is_well_formed(input: &Detections) -> bool {
    let (mut next_member, mut next_solid) = (0_u64, 0_u64);
    for detection in &input.detections {
        let summary = &detection.summary;
        if u64::from(summary.first_member) != next_member || summary.points == 0 || detection.solids > 1 {
            return false;
        }
        if detection.solids == 1 && u64::from(detection.first_solid) != next_solid {
            return false;
        }
        next_member += u64::from(summary.points);
        next_solid += u64::from(detection.solids);
        if !is_place(&summary.centroid_m) || !detection.posterior.iter().all(|one| (0.0..=1.001).contains(one)) {
            return false;
        }
    }
    next_member == input.members.len() as u64
        && next_solid == input.solids.len() as u64
        && (0.0..=std::f32::consts::PI).contains(&input.header.column_step_rad)
        && input.solids.iter().all(is_solid)
}

fn is_solid(solid: &Solid) -> bool {
    is_place(&solid.centre_m)
        && solid.size_m.iter().all(|extent| (0.0..=FARTHEST_M).contains(extent))
        && solid.attitude_wxyz.iter().all(|one| one.abs() <= 2.0)
        && solid.covariance.iter().all(|one| one.abs() <= WIDEST)
}

fn is_place(place_m: &[f32; 3]) -> bool {
    // False for NaN too.
    place_m.iter().all(|one| one.abs() <= FARTHEST_M)
}

#[cfg(test)]
mod tests {
    use messages::ClusterSummary;
    use zerocopy::FromZeros;

    use super::*;

    fn part(sector: u32, sectors: u32) -> Part {
        Part { sector, sectors, ..Part::default() }
    }

    /// A part with clusters of the given keys, of as many returns as told, each with a solid as wide as its key.
    fn message(keys: &[u32], points: u32) -> Box<Detections> {
        let mut message = Detections::new_box_zeroed().unwrap();
        message.header.period_ns = 1;
        message.header.complete = 1;
        for &key in keys {
            let first_member = message.members.len() as u32;
            let summary = ClusterSummary { key, first_member, points, ..ClusterSummary::default() };
            let first_solid = message.solids.len() as u32;
            message.detections.push(Detection { summary, solids: 1, first_solid, ..Detection::default() }).unwrap();
            message.solids.push(Solid { size_m: [key as f32; 3], ..Solid::default() }).unwrap();
            for _ in 0..points {
                message.members.push(0).unwrap();
            }
        }
        message
    }

    #[test]
    fn parts_are_joined_in_order_of_keys_each_with_its_own_solid() {
        let mut sut = Gathered::new();
        sut.begin(part(0, 2));
        sut.add(part(0, 2), &message(&[5, 9], 1));
        assert!(sut.goes_on(part(1, 2)) && !sut.goes_on(part(0, 2)));
        sut.add(part(1, 2), &message(&[1, 7], 1));
        sut.sort();
        let keys: Vec<u32> = sut.detections().iter().map(|one| one.summary.key).collect();
        assert_eq!(keys, [1, 5, 7, 9]);
        for (place, key) in keys.into_iter().enumerate() {
            assert_eq!(sut.solid(place).unwrap().size_m, [key as f32; 3]);
        }
        assert!(sut.is_whole());
    }

    // verifies TRA-008
    #[test]
    fn a_sweep_of_which_a_part_is_missing_or_not_known_is_not_whole() {
        let mut sut = Gathered::new();
        let unknown = Detections::new_box_zeroed().unwrap();
        let mut partial = message(&[1], 1);
        partial.header.complete = 0;
        let known = message(&[1], 1);
        for parts in
            [vec![(0, &known), (2, &known)], vec![(0, &known), (1, &unknown), (2, &known)], vec![(0, &partial)]]
        {
            sut.begin(part(0, 3));
            for (sector, message) in parts {
                sut.add(part(sector, 3), message);
            }
            assert!(!sut.is_whole());
        }
    }

    #[test]
    fn of_more_clusters_than_can_be_looked_at_the_largest_stay() {
        let mut sut = Gathered::new();
        sut.begin(part(0, 1));
        let few: Vec<u32> = (0..2_000).collect();
        let many: Vec<u32> = (2_000..4_000).collect();
        sut.add(part(0, 1), &message(&few, 1));
        sut.add(part(1, 1), &message(&many, 2));
        sut.sort();
        assert_eq!(sut.detections().len(), MAX_SIGHTINGS);
        assert!(sut.detections().iter().filter(|one| one.summary.points == 2).count() == 2_000);
        assert_eq!(sut.detections()[0].summary.key, 0);
    }

    // verifies TRA-017
    #[test]
    fn places_and_numbers_that_cannot_be_are_no_detections() {
        assert!(is_well_formed(&message(&[1, 2], 3)));
        let spoils: [fn(&mut Detections); 12] = [
            |m| m.detections[1].summary.first_member = 2,
            |m| m.detections[1].summary.points = 0,
            |m| m.detections[1].summary.points = u32::MAX,
            |m| m.detections[1].first_solid = 7,
            |m| m.detections[0].solids = 2,
            |m| m.detections[0].summary.centroid_m[1] = f32::NAN,
            |m| m.detections[0].summary.centroid_m[1] = 1e30,
            |m| m.detections[0].posterior[2] = f32::INFINITY,
            |m| m.solids[1].centre_m[0] = f32::INFINITY,
            |m| m.solids[1].covariance[44] = f32::NAN,
            |m| m.solids[1].size_m[0] = -1.0,
            |m| m.header.column_step_rad = f32::NAN,
        ];
        for (number, spoil) in spoils.into_iter().enumerate() {
            let mut message = message(&[1, 2], 3);
            spoil(&mut message);
            assert!(!is_well_formed(&message), "spoil {number}");
        }
    }
}
