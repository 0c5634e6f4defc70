//! How soon an obstacle that is seen is believed in.

use std::collections::BTreeMap;

use super::frame::Looked;
use super::pair::Pair;
use crate::bars::quantile;

/// Sweeps with enough returns after which an obstacle without a track counts as never found.
const ENOUGH_SWEEPS: u32 = 10;

/// Sweeps from the first with enough returns to the first with a confirmed track; 1 where that is the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Confirming {
    /// Of each obstacle that was found.
    sweeps: Vec<u32>,
    /// Obstacles with enough returns in at least ten sweeps that never had a confirmed track.
    pub never: u32,
}

impl Confirming {
    pub(crate) fn of(sweeps: &[Looked], pairs: &[Pair<'_>], least_returns: u32) -> Self {
        let mut seen: BTreeMap<u16, (usize, u32)> = BTreeMap::new();
        for (sweep, looked) in sweeps.iter().enumerate() {
            for actual in looked.actual.iter().filter(|actual| actual.returns >= least_returns) {
                seen.entry(actual.id).or_insert((sweep, 0)).1 += 1;
            }
        }
        let mut found: BTreeMap<u16, usize> = BTreeMap::new();
        for pair in pairs {
            found.entry(pair.actual.id).or_insert(pair.sweep);
        }
        let mut sum = Self::default();
        for (id, (first, count)) in seen {
            match found.get(&id) {
                Some(&confirmed) => sum.sweeps.push((confirmed + 1).saturating_sub(first) as u32),
                None => sum.never += u32::from(count >= ENOUGH_SWEEPS),
            }
        }
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.sweeps.extend(&other.sweeps);
        self.never += other.never;
    }

    /// Obstacles that were found.
    pub fn found(&self) -> u32 {
        self.sweeps.len() as u32
    }

    /// Median and 95th percentile \[sweeps\]; none of none.
    pub fn quantiles(&self) -> Option<[f64; 2]> {
        let of = |at| quantile(self.sweeps.iter().map(|&sweeps| sweeps.into()).collect(), at);
        Some([of(0.5)?, of(0.95)?])
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn the_time_runs_from_the_first_sweep_with_enough_returns() {
        let sweeps: Vec<Looked> = (0..12)
            .map(|sweep| Looked {
                actual: vec![
                    actual(1, [0.0; 3], if sweep < 2 { 4 } else { 30 }),
                    actual(2, [9.0; 3], 30),
                    actual(3, [5.0; 3], if sweep < 9 { 5 } else { 0 }),
                ],
                tracks: Vec::new(),
            })
            .collect();
        let track = track(7, [0.0; 3]);
        let pair = |sweep| Pair { sweep, age: 0, actual: &sweeps[0].actual[0], track: &track };
        let mut sut = Confirming::of(&sweeps, &[pair(4), pair(5)], 5);
        assert_eq!((sut.found(), sut.never, sut.quantiles()), (1, 1, Some([3.0, 3.0])));
        sut.add(&sut.clone());
        assert_eq!((sut.found(), sut.never), (2, 2));
        assert_eq!(Confirming::default().quantiles(), None);
    }
}
