//! Parts → sweep: collects the sectors of a sweep, orders its clusters by key, and says what is missing.
//!
//! Parts come in order of their ordinals. A sweep ends with its last sector, or unfinished when a part of another
//! sweep follows. Members are indices in the whole sweep; only their places, and those of solids, are rebased.

use messages::{Detection, Part, Refusal, Solid, Track};

use crate::part_rows::PartRows;

/// A sweep as it is written.
#[derive(Default)]
pub(crate) struct SweepRows {
    pub(crate) part: Part,
    /// The turn was seen from wrap to wrap, every sector came, and every accepted return in a cluster.
    pub(crate) complete: bool,
    /// Sectors that never came.
    pub(crate) missing_sectors: u32,
    /// Sectors that came empty because a stage rejected them.
    pub(crate) rejected_sectors: u32,
    pub(crate) recorded: u64,
    pub(crate) accepted: u64,
    /// By [`Refusal`].
    pub(crate) refused: [u64; Refusal::ALL.len()],
    /// In order of key: a cluster's place is its dense id.
    pub(crate) detections: Vec<Detection>,
    pub(crate) members: Vec<u32>,
    /// In the order in which they came: a detection knows its place.
    pub(crate) solids: Vec<Solid>,
    /// Time of the tracks, which come with the last part [ns]; 0 where there are none.
    pub(crate) tracks_ns: u64,
    pub(crate) tracks: Vec<Track>,
    /// Keys of the clusters that tracks were seen as: track after track.
    pub(crate) keys: Vec<u32>,
}

impl SweepRows {
    /// Whether every accepted return has come in a cluster, so that one without is known to be refused.
    pub(crate) fn is_whole(&self) -> bool {
        let points = self.detections.iter().map(|detection| u64::from(detection.summary.points)).sum::<u64>();
        self.missing_sectors == 0 && self.rejected_sectors == 0 && points == self.accepted
    }

    fn begin(&mut self, part: Part) {
        let Self { detections, members, solids, tracks, keys, .. } = std::mem::take(self);
        *self = Self { part, detections, members, solids, tracks, keys, ..Self::default() };
        self.detections.clear();
        self.members.clear();
        self.solids.clear();
        self.tracks.clear();
        self.keys.clear();
    }

    fn add(&mut self, rows: &PartRows) {
        self.recorded += u64::from(rows.header.recorded);
        self.accepted += u64::from(rows.header.accepted());
        for (sum, &refused) in self.refused.iter_mut().zip(&rows.header.refused) {
            *sum += u64::from(refused);
        }
        self.rejected_sectors += u32::from(rows.rejected);
        let (members, solids) = (self.members.len() as u32, self.solids.len() as u32);
        self.detections.extend(rows.detections.iter().map(|detection| {
            let mut detection = *detection;
            detection.summary.first_member += members;
            if detection.solid_place().is_some() {
                detection.first_solid += solids;
            }
            detection
        }));
        self.members.extend_from_slice(&rows.members);
        self.solids.extend_from_slice(&rows.solids);
        if rows.tracks_ns > 0 {
            self.tracks_ns = rows.tracks_ns;
            self.tracks.clone_from(&rows.tracks);
            self.keys.clone_from(&rows.keys);
        }
    }

    /// A cluster's number: the rank of its key. None for a key of no cluster.
    pub(crate) fn cluster_of(&self, key: u32) -> Option<usize> {
        self.detections.binary_search_by_key(&key, |detection| detection.summary.key).ok()
    }
}

/// The sweep in the making.
#[derive(Default)]
pub(crate) struct Assembly {
    sweep: SweepRows,
    /// Sectors of `sweep` that came; 0 when no sweep is open.
    seen: u32,
}

impl Assembly {
    /// Ends the open sweep when `part` belongs to another one. Call before [`Assembly::add`].
    pub(crate) fn end_before(&mut self, part: &Part) -> Option<&SweepRows> {
        if self.seen > 0 && self.sweep.part.sweep != part.sweep { self.end() } else { None }
    }

    /// Adds a part; gives the sweep when it was the last one. A first sector begins anew, also of the sweep that is open.
    pub(crate) fn add(&mut self, rows: &PartRows) -> Option<&SweepRows> {
        if self.seen == 0 || rows.part.sector == 0 {
            self.seen = 0;
            self.sweep.begin(rows.part);
        }
        self.seen += 1;
        self.sweep.add(rows);
        self.sweep.complete = rows.part.is_last() && rows.header.is_complete();
        if rows.part.is_last() { self.end() } else { None }
    }

    /// Ends the open sweep with what there is; nothing when none is open.
    pub(crate) fn end(&mut self) -> Option<&SweepRows> {
        if self.seen == 0 {
            return None;
        }
        self.sweep.missing_sectors = self.sweep.part.sectors.max(1).saturating_sub(self.seen);
        self.sweep.complete &= self.sweep.is_whole();
        self.sweep.detections.sort_unstable_by_key(|detection| detection.summary.key);
        self.seen = 0;
        Some(&self.sweep)
    }
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, SweepHeader};

    use super::*;

    /// Every third cluster has none.
    fn has_solid(key: u32) -> bool {
        key % 3 != 1
    }

    fn rows(sweep: u64, sector: u32, keys: &[u32]) -> PartRows {
        let detection = |(place, &key): (usize, &u32)| Detection {
            summary: ClusterSummary { key, first_member: place as u32, points: 1, ..ClusterSummary::default() },
            first_solid: keys[..place].iter().filter(|&&key| has_solid(key)).count() as u32,
            solids: u32::from(has_solid(key)),
            ..Detection::default()
        };
        let solid = |&key: &u32| Solid { centre_m: [key as f32, 0.0, 0.0], ..Solid::default() };
        PartRows {
            part: Part { ordinal: sweep * 3 + u64::from(sector), sweep, sector, sectors: 3, ..Part::default() },
            header: SweepHeader {
                recorded: keys.len() as u32,
                complete: u32::from(sector == 2),
                ..SweepHeader::default()
            },
            rejected: false,
            settles: true,
            detections: keys.iter().enumerate().map(detection).collect(),
            members: keys.to_vec(),
            solids: keys.iter().filter(|&&key| has_solid(key)).map(solid).collect(),
            tracks_ns: 0,
            tracks: Vec::new(),
            keys: Vec::new(),
        }
    }

    #[test]
    fn clusters_of_several_sectors_are_ordered_by_key_and_keep_their_members_and_solids() {
        let mut sut = Assembly::default();
        assert!(sut.add(&rows(5, 0, &[1])).is_none());
        assert!(sut.add(&rows(5, 1, &[2, 4])).is_none());
        let sweep = sut.add(&rows(5, 2, &[0, 3])).unwrap();
        let keys: Vec<u32> = sweep.detections.iter().map(|d| d.summary.key).collect();
        assert_eq!(keys, [0, 1, 2, 3, 4]);
        for detection in &sweep.detections {
            let key = detection.summary.key;
            assert_eq!(sweep.members[detection.summary.first_member as usize], key);
            let centre_m = detection.solid_place().map(|place| sweep.solids[place].centre_m[0]);
            assert_eq!(centre_m, has_solid(key).then_some(key as f32));
        }
        assert!(sweep.complete);
        assert_eq!((sweep.recorded, sweep.missing_sectors), (5, 0));
    }

    #[test]
    fn a_sweep_without_one_of_its_sectors_is_not_complete() {
        for missing in 0..3 {
            let mut sut = Assembly::default();
            let mut ended = None;
            for sector in (0..3).filter(|&sector| sector != missing) {
                ended = sut.add(&rows(0, sector, &[sector])).map(|sweep| (sweep.complete, sweep.missing_sectors));
            }
            if missing == 2 {
                assert_eq!(ended, None, "only the next sweep or the end of the run can tell");
                ended = sut.end_before(&rows(1, 0, &[]).part).map(|sweep| (sweep.complete, sweep.missing_sectors));
            }
            assert_eq!(ended, Some((false, 1)), "sector {missing}");
            assert!(sut.end().is_none());
        }
    }

    #[test]
    fn a_rejected_sector_makes_the_sweep_incomplete_though_none_is_missing() {
        let mut sut = Assembly::default();
        assert!(sut.add(&rows(0, 0, &[0])).is_none());
        assert!(sut.add(&PartRows { rejected: true, ..rows(0, 1, &[]) }).is_none());
        let sweep = sut.add(&rows(0, 2, &[1])).unwrap();
        assert_eq!((sweep.complete, sweep.missing_sectors, sweep.rejected_sectors), (false, 0, 1));
    }

    #[test]
    fn a_sweep_that_is_sent_again_counts_once() {
        let mut sut = Assembly::default();
        assert!(sut.add(&rows(0, 0, &[0])).is_none());
        assert!(sut.add(&rows(0, 1, &[1])).is_none());
        for sector in 0..2 {
            assert!(sut.add(&rows(0, sector, &[sector])).is_none());
        }
        let sweep = sut.add(&rows(0, 2, &[2])).unwrap();
        assert_eq!((sweep.detections.len(), sweep.recorded, sweep.complete), (3, 3, true));
    }

    #[test]
    fn nothing_is_left_of_a_sweep_in_the_next_one() {
        let mut sut = Assembly::default();
        for sector in 0..3 {
            let _ = sut.add(&PartRows { rejected: true, ..rows(0, sector, &[sector]) });
        }
        for sector in 0..2 {
            assert!(sut.add(&rows(1, sector, &[])).is_none());
        }
        let sweep = sut.add(&rows(1, 2, &[])).unwrap();
        assert_eq!((sweep.part.sweep, sweep.recorded, sweep.rejected_sectors), (1, 0, 0));
        assert!(sweep.complete && sweep.detections.is_empty() && sweep.members.is_empty() && sweep.solids.is_empty());
    }
}
