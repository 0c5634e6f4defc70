//! CLEAR MOT (K. Bernardin and R. Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR MOT metrics",
//! EURASIP Journal on Image and Video Processing, 2008).

use std::collections::BTreeMap;

use super::assignment::assign_within;
use super::frame::Frame;

/// What was matched, missed and claimed for nothing, over all sweeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClearMot {
    /// Obstacles, in each sweep anew: Σ g.
    pub objects: u32,
    /// Those that a track was matched to: Σ c.
    pub matched: u32,
    /// Those that none was: Σ m.
    pub missed: u32,
    /// Tracks that no obstacle was matched to: Σ fp.
    pub false_tracks: u32,
    /// Matches to another track than the last one: Σ mme.
    pub switches: u32,
    /// Sum of the distances of matches [m].
    pub distance_m: f64,
}

/// Row and column of the matches of one sweep.
pub(crate) type Matches = Vec<(usize, usize)>;

impl ClearMot {
    /// Matches sweep after sweep: a match goes on while it is within `match_m` (also after a gap); what is left is
    /// matched so that the sum of distances is least (Sec. 2.1.3 of the paper).
    pub(crate) fn of(frames: &[Frame], match_m: f64) -> (Self, Vec<Matches>) {
        let mut sum = Self::default();
        let mut held: BTreeMap<u16, u64> = BTreeMap::new();
        let matched = frames.iter().map(|frame| sum.follow(frame, match_m, &mut held)).collect();
        (sum, matched)
    }

    fn follow(&mut self, frame: &Frame, match_m: f64, held: &mut BTreeMap<u16, u64>) -> Matches {
        let mut matches = Matches::new();
        let (mut rows, mut columns): (Vec<_>, Vec<_>) =
            ((0..frame.actual.len()).collect(), (0..frame.claimed.len()).collect());
        rows.retain(|&row| {
            let last = held.get(&frame.actual[row]);
            let place = columns.iter().position(|&column| Some(&frame.claimed[column]) == last);
            match place.filter(|&place| frame.distance_m(row, columns[place]) <= match_m) {
                Some(place) => {
                    matches.push((row, columns.remove(place)));
                    false
                }
                None => true,
            }
        });
        let distance: Vec<f64> =
            rows.iter().flat_map(|&row| columns.iter().map(move |&column| frame.distance_m(row, column))).collect();
        for (row, column) in assign_within(&distance, rows.len(), columns.len(), match_m) {
            let (row, column) = (rows[row], columns[column]);
            let last = held.insert(frame.actual[row], frame.claimed[column]);
            self.switches += u32::from(last.is_some_and(|last| last != frame.claimed[column]));
            matches.push((row, column));
        }
        matches.sort_unstable();
        let count = matches.len();
        self.objects += frame.actual.len() as u32;
        self.matched += count as u32;
        self.missed += (frame.actual.len() - count) as u32;
        self.false_tracks += (frame.claimed.len() - count) as u32;
        self.distance_m += matches.iter().map(|&(row, column)| frame.distance_m(row, column)).sum::<f64>();
        matches
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.objects += other.objects;
        self.matched += other.matched;
        self.missed += other.missed;
        self.false_tracks += other.false_tracks;
        self.switches += other.switches;
        self.distance_m += other.distance_m;
    }

    /// Multiple object tracking accuracy: 1 − Σ(m + fp + mme)/Σ g, at most 1, and negative where more is wrong than
    /// there is to see; none without obstacles.
    pub fn mota(&self) -> Option<f64> {
        let wrong = f64::from(self.missed) + f64::from(self.false_tracks) + f64::from(self.switches);
        (self.objects > 0).then(|| 1.0 - wrong / f64::from(self.objects))
    }

    /// Multiple object tracking precision [m]: Σ d/Σ c; none without a match.
    pub fn motp_m(&self) -> Option<f64> {
        (self.matched > 0).then(|| self.distance_m / f64::from(self.matched))
    }
}
