//! How far sizes and spins of matched tracks are off.

use messages::TrackState;
use nalgebra::Vector3;

use super::pair::Pair;
use crate::Share;
use crate::bars::quantile;

/// Least returns of what is looked at.
pub(crate) const RETURNS: u32 = 50;

/// Sweeps since its birth after which a track's spin is looked at: 2 s at 10 Hz.
const SPIN_AGE: usize = 20;

/// Errors of confirmed tracks seen in the sweep with at least 50 returns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bodies {
    /// Those that have a size.
    pub sized: Share,
    /// Those of at least 20 sweeps that have a spin.
    pub spinning: Share,
    /// Mean relative error of the three extents, each list sorted.
    size: Vec<f64>,
    /// Length of the spin's error \[rad/s\]; of a body of revolution without the part along its axis, which nothing shows.
    spin_radps: Vec<f64>,
    /// True spins of the same, looked at in the same way \[rad/s\].
    true_spin_radps: Vec<f64>,
}

impl Bodies {
    pub(crate) fn of(pairs: &[Pair<'_>]) -> Self {
        let mut sum = Self::default();
        for Pair { age, actual, track, .. } in pairs {
            if track.state != TrackState::Confirmed || actual.returns < RETURNS {
                continue;
            }
            let has_size = track.size_m.iter().all(|&extent| extent > 0.0);
            sum.sized.add(has_size);
            if has_size {
                let [mut found, mut own] = [track.size_m.map(f64::from), actual.size_m];
                found.sort_unstable_by(f64::total_cmp);
                own.sort_unstable_by(f64::total_cmp);
                sum.size.push((0..3).map(|axis| (found[axis] / own[axis] - 1.0).abs()).sum::<f64>() / 3.0);
            }
            if *age >= SPIN_AGE {
                let has_spin = track.spin_sigma_radps > 0.0;
                sum.spinning.add(has_spin);
                if has_spin {
                    let axis = actual.attitude * Vector3::z();
                    let shown = |spin: Vector3<f64>| if actual.is_round { spin - axis * spin.dot(&axis) } else { spin };
                    let found = Vector3::from(track.spin_radps.map(f64::from));
                    sum.spin_radps.push(shown(found - actual.spin_radps).norm());
                    sum.true_spin_radps.push(shown(actual.spin_radps).norm());
                }
            }
        }
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (share, other) in [(&mut self.sized, other.sized), (&mut self.spinning, other.spinning)] {
            share.count += other.count;
            share.of += other.of;
        }
        self.size.extend(&other.size);
        self.spin_radps.extend(&other.spin_radps);
        self.true_spin_radps.extend(&other.true_spin_radps);
    }

    /// Median and ninth decile of the extents' error \[%\]; none of none.
    pub fn size_per_cent(&self) -> Option<[f64; 2]> {
        let of = |at| quantile(self.size.clone(), at).map(|error| 100.0 * error);
        Some([of(0.5)?, of(0.9)?])
    }

    /// Median and ninth decile of the spin's error, and the median of the true spins \[deg/s\]; none of none.
    pub fn spin_dps(&self) -> Option<[f64; 3]> {
        let of = |list: &Vec<f64>, at| quantile(list.clone(), at).map(f64::to_degrees);
        Some([of(&self.spin_radps, 0.5)?, of(&self.spin_radps, 0.9)?, of(&self.true_spin_radps, 0.5)?])
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn sizes_are_compared_sorted_and_spins_without_what_nothing_shows() {
        let mut own = actual(1, [0.0; 3], 50);
        own.size_m = [1.0, 3.0, 2.0];
        own.spin_radps = Vector3::new(0.0, 0.2, 0.0);
        let mut found = track(7, [0.0; 3]);
        found.size_m = [2.2, 1.0, 3.0];
        found.spin_sigma_radps = 0.1;
        found.spin_radps = [0.0, 0.2, 0.7];
        let sized = Bodies::of(&[Pair { sweep: 30, age: 20, actual: &own, track: &found }]);
        assert!((sized.size_per_cent().unwrap()[0] - 10.0 / 3.0).abs() < 1e-4);
        assert!((sized.spin_dps().unwrap()[0] - 0.7_f64.to_degrees()).abs() < 1e-4);
        own.is_round = true;
        let mut round = Bodies::of(&[Pair { sweep: 30, age: 20, actual: &own, track: &found }]);
        assert!(round.spin_dps().unwrap()[0] < 1e-4, "turned about its own axis");
        found.size_m = [0.0; 3];
        found.spin_sigma_radps = 0.0;
        round.add(&Bodies::of(&[Pair { sweep: 30, age: 20, actual: &own, track: &found }]));
        assert_eq!((round.sized, round.spinning), (Share { count: 1, of: 2 }, Share { count: 1, of: 2 }));
        own.returns = 49;
        assert_eq!(Bodies::of(&[Pair { sweep: 0, age: 0, actual: &own, track: &found }]), Bodies::default());
    }
}
