//! IDF1 (E. Ristani et al., "Performance measures and a data set for multi-target, multi-camera tracking", ECCV workshops
//! 2016).

use std::collections::{BTreeMap, BTreeSet};

use super::assignment::assign;
use super::frame::Frame;

/// How long obstacles are followed under one number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Obstacles, in each sweep anew.
    pub objects: u32,
    /// Tracks, in each sweep anew.
    pub tracks: u32,
    /// Those that lie within reach of each other and belong together, when each obstacle has at most one track for all of
    /// the scene and the pairs are chosen for the most: IDTP.
    pub both: u32,
}

impl Identity {
    /// Pairs obstacles and tracks for the whole of a scene; those within `match_m` of each other agree.
    pub(crate) fn of(frames: &[Frame], match_m: f64) -> Self {
        let mut agree: BTreeMap<(u16, u64), u32> = BTreeMap::new();
        let (mut objects, mut tracks) = (BTreeSet::new(), BTreeSet::new());
        let mut sum = Self::default();
        for frame in frames {
            sum.objects += frame.actual.len() as u32;
            sum.tracks += frame.claimed.len() as u32;
            objects.extend(&frame.actual);
            tracks.extend(&frame.claimed);
            for (row, &id) in frame.actual.iter().enumerate() {
                for (column, &track) in frame.claimed.iter().enumerate() {
                    if frame.distance_m(row, column) <= match_m {
                        *agree.entry((id, track)).or_default() += 1;
                    }
                }
            }
        }
        let agreed = |id: u16, track: u64| agree.get(&(id, track)).copied().unwrap_or(0);
        let (objects, tracks): (Vec<u16>, Vec<u64>) = (objects.into_iter().collect(), tracks.into_iter().collect());
        let cost: Vec<f64> =
            objects.iter().flat_map(|&id| tracks.iter().map(move |&track| -f64::from(agreed(id, track)))).collect();
        let pairs = assign(&cost, objects.len(), tracks.len());
        sum.both = pairs.into_iter().map(|(row, column)| agreed(objects[row], tracks[column])).sum();
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.objects += other.objects;
        self.tracks += other.tracks;
        self.both += other.both;
    }

    /// 2 IDTP/(2 IDTP + IDFP + IDFN): 0 to 1; none where there is neither obstacle nor track.
    pub fn idf1(&self) -> Option<f64> {
        let all = self.objects + self.tracks;
        (all > 0).then(|| 2.0 * f64::from(self.both) / f64::from(all))
    }
}
