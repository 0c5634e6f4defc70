//! Detections in sectors → those of the whole sweep, in order of key.

use messages::{Detection, Detections, Message, Part, Solid, SweepHeader};
use zerocopy::FromZeros;

/// Joins the detections of a sweep: their order, members and solids are the same for any number of sectors.
///
/// Of more solids than a message holds, those of the first clusters are kept.
pub struct DetectionsJoiner {
    whole: Box<Detections>,
    header: SweepHeader,
    detections: Vec<Detection>,
    members: Vec<u32>,
    solids: Vec<Solid>,
    /// Sweep and sector that come next; none while nothing is open.
    next: Option<(u64, u32)>,
}

impl DetectionsJoiner {
    /// With room for one sweep; none where there is no memory for it.
    pub fn new() -> Option<Self> {
        Some(Self {
            whole: Detections::new_box_zeroed().ok()?,
            header: SweepHeader::default(),
            detections: Vec::new(),
            members: Vec::new(),
            solids: Vec::new(),
            next: None,
        })
    }

    /// Adds a part. Gives the sweep with its last part, where every part came in order and none contradicts itself.
    /// The first sector begins anew, also of the same sweep.
    pub fn add(&mut self, part: &Part, piece: &Detections) -> Option<&Detections> {
        if part.sector == 0 {
            self.header = SweepHeader::default();
            self.detections.clear();
            self.members.clear();
            self.solids.clear();
            self.next = Some((part.sweep, 0));
        }
        if self.next.take() != Some((part.sweep, part.sector)) || !is_sound(piece) {
            return None;
        }
        self.append(piece);
        if !part.is_last() {
            self.next = Some((part.sweep, part.sector + 1));
            return None;
        }
        self.join().then_some(&self.whole)
    }

    fn append(&mut self, piece: &Detections) {
        let recorded = self.header.recorded;
        self.header = piece.header;
        self.header.recorded = recorded.saturating_add(piece.header.recorded);
        let (members, solids) = (self.members.len() as u32, self.solids.len() as u32);
        self.detections.extend(piece.detections.iter().map(|detection| {
            let mut detection = *detection;
            detection.summary.first_member += members;
            if detection.solid_place().is_some() {
                detection.first_solid += solids;
            }
            detection
        }));
        self.members.extend_from_slice(&piece.members);
        self.solids.extend_from_slice(&piece.solids);
    }

    /// Whether the sweep fits into a message.
    fn join(&mut self) -> bool {
        let whole = &mut *self.whole;
        whole.clear();
        whole.header = self.header;
        self.detections.sort_unstable_by_key(|detection| (detection.summary.key, detection.summary.first_member));
        for detection in &self.detections {
            let mut detection = *detection;
            // Places were checked part by part.
            let members = &self.members[detection.summary.member_places()];
            detection.summary.first_member = whole.members.len() as u32;
            let solid = detection.solid_place().map(|place| self.solids[place]);
            (detection.first_solid, detection.solids) = (whole.solids.len() as u32, 0);
            if solid.is_some_and(|solid| whole.solids.push(solid).is_ok()) {
                detection.solids = 1;
            }
            if whole.members.extend_from_slice(members).is_err() || whole.detections.push(detection).is_err() {
                return false;
            }
        }
        true
    }
}

/// Whether all places are places of the part.
fn is_sound(piece: &Detections) -> bool {
    piece.detections.iter().all(|detection| {
        let end = u64::from(detection.summary.first_member) + u64::from(detection.summary.points);
        end <= piece.members.len() as u64 && detection.solid_place().is_none_or(|place| place < piece.solids.len())
    })
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Raw};

    use super::*;

    /// Clusters with these keys, each of two members; every cluster with an even key has a solid.
    fn piece(keys: &[u32]) -> Box<Detections> {
        let mut piece = Detections::new_box_zeroed().unwrap();
        piece.header.recorded = 2 * keys.len() as u32;
        for &key in keys {
            let first_member = piece.members.len() as u32;
            let summary = ClusterSummary { key, first_member, points: 2, ..ClusterSummary::default() };
            piece.members.extend_from_slice(&[key, key + 1000]).unwrap();
            let (first_solid, solids) = (piece.solids.len() as u32, u32::from(key % 2 == 0));
            if solids > 0 {
                piece.solids.push(Solid { centre_m: [key as f32, 0.0, 0.0], ..Solid::default() }).unwrap();
            }
            piece.detections.push(Detection { summary, first_solid, solids, ..Detection::default() }).unwrap();
        }
        piece
    }

    fn part(sweep: u64, sector: u32, sectors: u32) -> Part {
        Part { sweep, sector, sectors, ..Part::default() }
    }

    fn bytes(of: &Detections) -> Vec<u8> {
        let mut out = Vec::new();
        of.write_raw(&mut out);
        out
    }

    #[test]
    fn a_sweep_is_the_same_for_any_number_of_sectors_and_in_order_of_key() {
        let mut sut = DetectionsJoiner::new().unwrap();
        let whole = bytes(sut.add(&part(0, 0, 1), &piece(&[0, 1, 2, 3, 4, 6])).unwrap());
        assert!(sut.add(&part(1, 0, 3), &piece(&[1])).is_none());
        assert!(sut.add(&part(1, 1, 3), &piece(&[2, 4])).is_none());
        let joined = sut.add(&part(1, 2, 3), &piece(&[0, 3, 6])).unwrap();
        assert_eq!(bytes(joined), whole);
        for detection in &joined.detections {
            let key = detection.summary.key;
            assert_eq!(joined.members[detection.summary.member_places()], [key, key + 1000]);
            let centre = detection.solid_place().map(|place| joined.solids[place].centre_m[0]);
            assert_eq!(centre, (key % 2 == 0).then_some(key as f32));
        }
    }

    #[test]
    fn a_sweep_that_lacks_a_sector_is_left_out_and_a_second_copy_counts() {
        let pieces = [piece(&[0]), piece(&[1]), piece(&[2])];
        for missing in 0..3 {
            let mut sut = DetectionsJoiner::new().unwrap();
            let mut rest = (0..3).filter(|&sector| sector != missing);
            assert!(!rest.any(|sector| sut.add(&part(5, sector, 3), &pieces[sector as usize]).is_some()));
            let again = [0, 1, 0, 1, 2].map(|sector| {
                sut.add(&part(5, sector, 3), &pieces[sector as usize]).map(|whole| whole.detections.len())
            });
            assert_eq!(again, [None, None, None, None, Some(3)]);
        }
    }

    #[test]
    fn a_part_with_places_out_of_range_spoils_its_sweep() {
        type Spoil = fn(&mut Detection);
        let spoils: [Spoil; 3] = [
            |detection| detection.summary.points = 3,
            |detection| detection.summary.first_member = u32::MAX,
            |detection| detection.first_solid = 1,
        ];
        for spoil in spoils {
            let mut sut = DetectionsJoiner::new().unwrap();
            let mut piece = piece(&[0]);
            spoil(&mut piece.detections[0]);
            assert!(sut.add(&part(0, 0, 1), &piece).is_none());
        }
    }

    #[test]
    fn more_solids_than_a_message_holds_are_left_to_the_first_clusters() {
        let keys = |from: u32| (from..from + 4000).step_by(2).collect::<Vec<u32>>();
        let mut sut = DetectionsJoiner::new().unwrap();
        assert!(sut.add(&part(0, 0, 2), &piece(&keys(4000))).is_none());
        let whole = sut.add(&part(0, 1, 2), &piece(&keys(0))).unwrap();
        assert_eq!((whole.detections.len(), whole.solids.len()), (4000, messages::MAX_FITS));
        let with_solid = whole.detections.iter().take_while(|detection| detection.solid_place().is_some()).count();
        assert_eq!(with_solid, messages::MAX_FITS);
    }
}
