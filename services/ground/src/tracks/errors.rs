//! How far positions and velocities of matched tracks are off.

use messages::TrackState;
use nalgebra::Vector3;

use super::pair::Pair;
use crate::bars::quantile;

/// Returns of the rows by size: least and most.
pub(crate) const RETURNS: [[u32; 2]; 4] = [[5, 9], [10, 19], [20, 49], [50, u32::MAX]];

/// Least returns of the curves over age.
pub(crate) const AGED_RETURNS: u32 = 20;

/// Root of a mean square.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RootMeanSquare {
    /// How many.
    pub count: u32,
    /// Sum of the squares.
    pub squares: f64,
}

impl RootMeanSquare {
    pub(crate) fn push(&mut self, value: f64) {
        self.count += 1;
        self.squares += value * value;
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.squares += other.squares;
    }

    /// The value; none of none.
    pub fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / f64::from(self.count)).sqrt())
    }
}

/// Errors of tracks that are matched. Lengths of vectors, not components.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackErrors {
    /// Position [m] of tracks that are seen in the sweep, by returns: 5 to 9, 10 to 19, 20 to 49, more.
    pub position_m: [RootMeanSquare; RETURNS.len()],
    /// Velocity [m/s], the same way.
    pub velocity_mps: [RootMeanSquare; RETURNS.len()],
    /// Position [m] of tracks that are propagated only.
    pub coasting_m: RootMeanSquare,
    /// The same of obstacles of at least 50 returns: most are in one cluster with another.
    pub coasting_large_m: RootMeanSquare,
    /// Position [m] of tracks seen in the sweep with at least 20 returns, by sweeps since the track's birth.
    pub position_by_age_m: Vec<RootMeanSquare>,
    /// Velocity [m/s] of the same.
    pub velocity_by_age_mps: Vec<RootMeanSquare>,
    /// Each position error of at least 50 returns [m].
    large_m: Vec<f64>,
}

impl TrackErrors {
    pub(crate) fn of(pairs: &[Pair<'_>]) -> Self {
        let mut errors = Self::default();
        for Pair { age, actual, track, .. } in pairs {
            let off_m = (actual.centre_m - Vector3::from(track.position_m.map(f64::from))).norm();
            let off_mps = (actual.velocity_mps - Vector3::from(track.velocity_mps.map(f64::from))).norm();
            if track.state == TrackState::Coasting {
                errors.coasting_m.push(off_m);
                if actual.returns >= RETURNS[RETURNS.len() - 1][0] {
                    errors.coasting_large_m.push(off_m);
                }
                continue;
            }
            let row = RETURNS.iter().position(|&[least, most]| (least..=most).contains(&actual.returns));
            if let Some(row) = row {
                errors.position_m[row].push(off_m);
                errors.velocity_mps[row].push(off_mps);
                if row + 1 == RETURNS.len() {
                    errors.large_m.push(off_m);
                }
            }
            if actual.returns >= AGED_RETURNS {
                at(&mut errors.position_by_age_m, *age).push(off_m);
                at(&mut errors.velocity_by_age_mps, *age).push(off_mps);
            }
        }
        errors
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for row in 0..RETURNS.len() {
            self.position_m[row].add(&other.position_m[row]);
            self.velocity_mps[row].add(&other.velocity_mps[row]);
        }
        self.coasting_m.add(&other.coasting_m);
        self.coasting_large_m.add(&other.coasting_large_m);
        for (all, other) in [
            (&mut self.position_by_age_m, &other.position_by_age_m),
            (&mut self.velocity_by_age_mps, &other.velocity_by_age_mps),
        ] {
            for (age, one) in other.iter().enumerate() {
                at(all, age).add(one);
            }
        }
        self.large_m.extend(&other.large_m);
    }

    /// Median, ninth decile and 99th percentile of the position error of at least 50 returns [m]; none of none.
    pub fn large_quantiles_m(&self) -> Option<[f64; 3]> {
        let of = |at| quantile(self.large_m.clone(), at);
        Some([of(0.5)?, of(0.9)?, of(0.99)?])
    }
}

/// The place in a list that grows as it must.
fn at(list: &mut Vec<RootMeanSquare>, place: usize) -> &mut RootMeanSquare {
    if list.len() <= place {
        list.resize(place + 1, RootMeanSquare::default());
    }
    &mut list[place]
}

#[cfg(test)]
mod tests {
    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn errors_stand_by_returns_age_and_whether_the_track_is_seen() {
        let (large, small) = (actual(1, [1.0, 0.0, 0.0], 50), actual(2, [1.0, 0.0, 0.0], 7));
        let mut near = track(1, [1.0, 0.3, 0.4]);
        near.velocity_mps = [0.0, 0.0, 2.0];
        let mut coasting = near;
        coasting.state = TrackState::Coasting;
        let pair = |age, actual, track| Pair { sweep: 9, age, actual, track };
        let far = track(2, [1.0, 1.5, 0.0]);
        let mut sut = TrackErrors::of(&[pair(3, &large, &near), pair(0, &small, &near), pair(9, &large, &coasting)]);
        sut.add(&TrackErrors::of(&[pair(9, &small, &coasting)]));
        sut.add(&TrackErrors::of(&[pair(3, &large, &far)]));
        assert_eq!(sut.position_m.map(|row| row.count), [1, 0, 0, 2]);
        assert!((sut.position_m[3].value().unwrap() - (0.5 * (0.25 + 2.25_f64)).sqrt()).abs() < 1e-6);
        assert!((sut.velocity_mps[0].value().unwrap() - 2.0).abs() < 1e-6);
        assert_eq!((sut.coasting_m.count, sut.coasting_large_m.count, sut.position_m[1].value()), (2, 1, None));
        assert_eq!(sut.velocity_by_age_mps.iter().map(|one| one.count).collect::<Vec<_>>(), [0, 0, 0, 2]);
        assert!((sut.large_quantiles_m().unwrap()[0] - 0.5).abs() < 1e-6);
    }
}
