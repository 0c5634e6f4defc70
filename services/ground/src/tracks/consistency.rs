//! Whether covariances mean what they say: the normalised estimation error squared (Y. Bar-Shalom, X. R. Li and
//! T. Kirubarajan, "Estimation with applications to tracking and navigation", 2001, Sec. 5.4).

use nalgebra::{SMatrix, SVector};

use super::pair::Pair;
use crate::Share;

/// Two-sided 95 % bounds of χ² with 3 and with 6 degrees of freedom: its quantiles at 2.5 and 97.5 %.
const BOUNDS_3: [f64; 2] = [0.215_795_282_623_897_85, 9.348_403_604_496_145];
const BOUNDS_6: [f64; 2] = [1.237_344_245_791_202_7, 14.449_375_335_447_92];

/// Errors by their covariance, of one kind of state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nees {
    /// Under the lower bound: the covariance is too wide.
    pub below: u32,
    /// Inside both.
    pub inside: u32,
    /// Over the upper bound, or without a covariance that is one.
    pub above: u32,
    /// Sum of all that have a covariance; a mean of 1 a degree of freedom is right.
    sum: f64,
    with: u32,
}

impl Nees {
    fn push(&mut self, value: Option<f64>, bounds: [f64; 2]) {
        match value {
            Some(value) if value < bounds[0] => self.below += 1,
            Some(value) if value <= bounds[1] => self.inside += 1,
            _ => self.above += 1,
        }
        if let Some(value) = value {
            self.sum += value;
            self.with += 1;
        }
    }

    fn add(&mut self, other: &Self) {
        self.below += other.below;
        self.inside += other.inside;
        self.above += other.above;
        self.sum += other.sum;
        self.with += other.with;
    }

    /// Those inside, of all.
    pub fn inside(&self) -> Share {
        Share { count: self.inside, of: self.below + self.inside + self.above }
    }

    /// Mean of those with a covariance; none of none.
    pub fn mean(&self) -> Option<f64> {
        (self.with > 0).then(|| self.sum / f64::from(self.with))
    }
}

/// Errors of matched tracks by their covariances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Consistency {
    /// Position and velocity together: 6 degrees of freedom.
    pub state: Nees,
    /// Position alone: 3.
    pub position: Nees,
    /// Velocity alone: 3.
    pub velocity: Nees,
    /// Position and velocity together, by sweep of the scene.
    pub by_sweep: Vec<Nees>,
    /// The same by sweeps since the track's birth.
    pub by_age: Vec<Nees>,
}

impl Consistency {
    pub(crate) fn of(pairs: &[Pair<'_>]) -> Self {
        let mut sum = Self::default();
        for pair in pairs {
            let (error, covariance) = (error(pair), covariance(pair));
            let state = squared(&error, covariance);
            sum.state.push(state, BOUNDS_6);
            at(&mut sum.by_sweep, pair.sweep).push(state, BOUNDS_6);
            at(&mut sum.by_age, pair.age).push(state, BOUNDS_6);
            let part = |first: usize| {
                squared::<3>(&error.fixed_rows::<3>(first).into(), covariance.fixed_view::<3, 3>(first, first).into())
            };
            sum.position.push(part(0), BOUNDS_3);
            sum.velocity.push(part(3), BOUNDS_3);
        }
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.state.add(&other.state);
        self.position.add(&other.position);
        self.velocity.add(&other.velocity);
        for (all, other) in [(&mut self.by_sweep, &other.by_sweep), (&mut self.by_age, &other.by_age)] {
            for (place, one) in other.iter().enumerate() {
                at(all, place).add(one);
            }
        }
    }
}

fn error(pair: &Pair<'_>) -> SVector<f64, 6> {
    SVector::from_fn(|row, _| match row {
        0..3 => f64::from(pair.track.position_m[row]) - pair.actual.centre_m[row],
        _ => f64::from(pair.track.velocity_mps[row - 3]) - pair.actual.velocity_mps[row - 3],
    })
}

fn covariance(pair: &Pair<'_>) -> SMatrix<f64, 6, 6> {
    SMatrix::from_fn(|row, column| f64::from(pair.track.covariance_of(row, column)))
}

/// eᵀ P⁻¹ e; none where P is not positive definite.
fn squared<const N: usize>(error: &SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Option<f64> {
    let value = covariance.cholesky().map(|factors| error.dot(&factors.solve(error)))?;
    value.is_finite().then_some(value)
}

fn at(list: &mut Vec<Nees>, place: usize) -> &mut Nees {
    if list.len() <= place {
        list.resize(place + 1, Nees::default());
    }
    &mut list[place]
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::frame::tests::{actual, track};
    use super::*;

    /// Tracks whose errors are normal with standard deviation `sigma` where the covariance says 1.
    fn consistency(sigma: f64) -> Consistency {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let still = actual(1, [0.0; 3], 50);
        let mut normal = || {
            // The sum of twelve uniform numbers less 6: variance 1.
            (sigma * ((0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0)) as f32
        };
        let tracks: Vec<_> = (0..2_000)
            .map(|_| {
                let mut track = track(1, [0.0; 3]);
                track.position_m = std::array::from_fn(|_| normal());
                track.velocity_mps = std::array::from_fn(|_| normal());
                track
            })
            .collect();
        let pairs: Vec<_> = tracks.iter().map(|track| Pair { sweep: 2, age: 1, actual: &still, track }).collect();
        Consistency::of(&pairs)
    }

    #[test]
    fn nineteen_of_twenty_errors_lie_inside_where_the_covariance_is_right() {
        let right = consistency(1.0);
        for nees in [right.state, right.position, right.velocity] {
            let inside = nees.inside().per_cent().unwrap();
            assert!((inside - 95.0).abs() < 1.5, "{inside}");
        }
        assert!((right.state.mean().unwrap() / 6.0 - 1.0).abs() < 0.05);
        assert_eq!((right.by_sweep.len(), right.by_age.len(), right.by_age[1]), (3, 2, right.state));
        let (wide, narrow) = (consistency(0.3), consistency(3.0));
        assert!(wide.state.below > 20 * wide.state.above + 1_000 && narrow.state.above > 1_000);
    }

    #[test]
    fn a_covariance_that_is_none_is_no_good_one() {
        let still = actual(1, [0.0; 3], 50);
        let mut track = track(1, [0.0; 3]);
        track.covariance[0] = -1.0;
        let sut = Consistency::of(&[Pair { sweep: 0, age: 0, actual: &still, track: &track }]);
        assert_eq!((sut.state.above, sut.state.mean(), sut.velocity.below), (1, None, 1));
    }
}
