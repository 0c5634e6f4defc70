//! Whether the class is right, and how soon.

use std::collections::BTreeMap;

use lidar::ObstacleClass;

use super::assignment::assign_within;
use super::frame::{Actual, Looked, distances};
use crate::{Reliability, Share};

/// Sweeps after which classes are looked at.
pub(crate) const AFTER: [usize; 4] = [1, 3, 5, 10];

/// Rows: obstacles with at least so many returns, by the median.
pub(crate) const LEAST_RETURNS: [u32; 4] = [5, 10, 20, 50];

/// The class that tracks have, so many sweeps after an obstacle first had 5 returns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Classes {
    /// A row for each of [`LEAST_RETURNS`], a column for each of [`AFTER`].
    pub right: [[Share; AFTER.len()]; LEAST_RETURNS.len()],
    /// Actual class by class of the track, the last column unclassified or without a track: after the last of
    /// [`AFTER`], obstacles of at least 5 returns.
    pub confusion: [[u32; 5]; 4],
    /// Posterior and actual class, the same obstacles where the track makes a claim.
    claims: Vec<([f64; 4], u8)>,
}

impl Classes {
    /// An obstacle's sweeps begin with the first in which it has 5 returns. It counts when its median of returns over the
    /// ten sweeps from there is enough, and only when the scene has so many left. Whatever track is nearest speaks for it,
    /// tentative or not; where there is none within `match_m`, its class is wrong.
    pub(crate) fn of(sweeps: &[Looked], match_m: f64) -> Self {
        let mut sum = Self::default();
        let last = AFTER[AFTER.len() - 1];
        let mut first: BTreeMap<u16, usize> = BTreeMap::new();
        for (sweep, looked) in sweeps.iter().enumerate() {
            for actual in looked.actual.iter().filter(|actual| actual.returns >= LEAST_RETURNS[0]) {
                first.entry(actual.id).or_insert(sweep);
            }
        }
        for (id, first) in first {
            let Some(window) = sweeps.get(first..first + last) else { continue };
            let Some(actual) = find(&window[0], id) else { continue };
            let Some(class) = actual.class.solid_index() else { continue };
            let mut returns: Vec<u32> = window.iter().map(|looked| find(looked, id).map_or(0, |a| a.returns)).collect();
            returns.sort_unstable();
            // The lower of two in the middle.
            let median = returns[(last - 1) / 2];
            if median < LEAST_RETURNS[0] {
                continue;
            }
            for (column, after) in AFTER.into_iter().enumerate() {
                let said = said(&window[after - 1], id, match_m);
                let is_right = said.is_some_and(|(verdict, _)| verdict == actual.class);
                for (row, least) in LEAST_RETURNS.into_iter().enumerate() {
                    if median >= least {
                        sum.right[row][column].add(is_right);
                    }
                }
                if after == last {
                    let verdict = said.and_then(|(verdict, _)| verdict.solid_index());
                    sum.confusion[class][verdict.unwrap_or(4)] += 1;
                    if let (Some(_), Some((_, posterior))) = (verdict, said) {
                        sum.claims.push((posterior, class as u8));
                    }
                }
            }
        }
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (row, other) in self.right.iter_mut().flatten().zip(other.right.iter().flatten()) {
            row.count += other.count;
            row.of += other.of;
        }
        for (count, other) in self.confusion.iter_mut().flatten().zip(other.confusion.iter().flatten()) {
            *count += other;
        }
        self.claims.extend(&other.claims);
    }

    /// Right after the last of [`AFTER`], of obstacles with at least so many returns.
    pub fn last(&self, least_returns: u32) -> Share {
        let row = LEAST_RETURNS.iter().position(|&least| least == least_returns);
        row.map_or(Share::default(), |row| self.right[row][AFTER.len() - 1])
    }

    /// Whether posteriors after ten sweeps mean what they say.
    pub fn reliability(&self) -> Reliability {
        Reliability::of(self.claims.iter().copied())
    }
}

fn find(looked: &Looked, id: u16) -> Option<&Actual> {
    looked.actual.iter().find(|actual| actual.id == id)
}

/// Class and posterior of the track that lies on an obstacle, when all that are seen are paired with all tracks.
fn said(looked: &Looked, id: u16, match_m: f64) -> Option<(ObstacleClass, [f64; 4])> {
    let actual: Vec<&Actual> = looked.actual.iter().filter(|actual| actual.returns > 0 || actual.id == id).collect();
    let tracks: Vec<_> = looked.tracks.iter().collect();
    let pairs = assign_within(&distances(&actual, &tracks), actual.len(), tracks.len(), match_m);
    let (_, column) = pairs.into_iter().find(|&(row, _)| actual[row].id == id)?;
    Some((tracks[column].class, tracks[column].posterior.map(f64::from)))
}

#[cfg(test)]
mod tests {
    use messages::TrackState;

    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn a_class_counts_from_the_first_sweep_with_enough_returns() {
        let sweeps: Vec<Looked> = (0..13)
            .map(|sweep| {
                let mut tracks = vec![track(7, [0.5, 0.0, 0.0])];
                tracks[0].state = TrackState::Tentative;
                // Right from the third sweep on after two that do not count.
                tracks[0].class = if sweep < 4 { ObstacleClass::Conical } else { ObstacleClass::Rectangular };
                tracks[0].posterior = [0.9, 0.0, 0.0, 0.1];
                let actual = vec![
                    actual(1, [0.0; 3], if sweep < 2 { 4 } else { 12 }),
                    actual(2, [9.0, 0.0, 0.0], 5),
                    actual(3, [0.0, 9.0, 0.0], if sweep < 4 { 60 } else { 0 }),
                    actual(4, [0.0, 0.0, 9.0], if sweep < 8 { 0 } else { 60 }),
                ];
                Looked { actual, tracks }
            })
            .collect();
        let mut sut = Classes::of(&sweeps, 2.0);
        let share = |count, of| Share { count, of };
        assert_eq!(sut.right[0], [share(0, 2), share(1, 2), share(1, 2), share(1, 2)], "the second has no track");
        assert_eq!(sut.right[1][3], share(1, 1));
        assert_eq!((sut.last(50), sut.last(7)), (share(0, 0), share(0, 0)), "mostly hidden, or too late");
        assert_eq!(sut.confusion[0], [1, 0, 0, 0, 1]);
        assert_eq!(sut.reliability().bins.iter().map(|bin| bin.count).sum::<usize>(), 1);
        sut.add(&sut.clone());
        assert_eq!(sut.last(5), share(2, 4));
    }
}
