use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Length of the state.
pub(crate) const STATES: usize = 9;

const POSITION: usize = 0;
const VELOCITY: usize = 3;
const SIZE: usize = 6;

type State = SVector<f64, STATES>;
type Covariance = SMatrix<f64, STATES, STATES>;
type Gain = SMatrix<f64, STATES, 6>;

/// What is measured of an obstacle, and how wrong that may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    /// Centre [m]; then extents along the body's axes [m].
    pub(crate) value: Vector6<f64>,
    /// Whether the extents were measured; else they are taken to be as expected.
    pub(crate) sized: bool,
    /// Covariance of the whole; positive definite.
    pub(crate) covariance: Matrix6<f64>,
}

/// How obstacles move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motion {
    /// What a velocity may change in a second [m/s], as the root of that second.
    pub(crate) velocity_walk_mps: f64,
    /// The same of an extent [m].
    pub(crate) size_walk_m: f64,
}

/// Kalman filter of one obstacle: constant velocity and constant size (Bar-Shalom, Li and Kirubarajan 2001, Sec. 6.2).
///
/// State: position, velocity and size, 3 each.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    mean: State,
    covariance: Covariance,
}

impl Filter {
    /// A filter that knows no more than standard deviations about a mean.
    pub(crate) fn new(mean: [Vector3<f64>; 3], sigma_m: f64, velocity: Matrix3<f64>, size_sigma_m: f64) -> Self {
        let mut filter = Self { mean: State::zeros(), covariance: Covariance::zeros() };
        for (block, value) in mean.iter().enumerate() {
            filter.mean.fixed_rows_mut::<3>(3 * block).copy_from(value);
        }
        let covariance = &mut filter.covariance;
        covariance.fixed_view_mut::<3, 3>(POSITION, POSITION).fill_diagonal(sigma_m * sigma_m);
        covariance.fixed_view_mut::<3, 3>(VELOCITY, VELOCITY).copy_from(&velocity);
        covariance.fixed_view_mut::<3, 3>(SIZE, SIZE).fill_diagonal(size_sigma_m * size_sigma_m);
        filter
    }

    pub(crate) fn position_m(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(POSITION).into()
    }

    pub(crate) fn velocity_mps(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(VELOCITY).into()
    }

    /// Extents [m]; may be negative where they were never measured well.
    pub(crate) fn size_m(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(SIZE).into()
    }

    pub(crate) fn size_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(SIZE, SIZE).into()
    }

    /// Covariance of position and velocity.
    pub(crate) fn kinematic_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(POSITION, POSITION).into()
    }

    pub(crate) fn velocity_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY).into()
    }

    /// Propagates by `dt_s`, which may be negative by parts of a sweep.
    pub(crate) fn predict(&mut self, dt_s: f64, motion: &Motion) {
        let p = &mut self.covariance;
        // F P Fᵀ: rows, then columns.
        for axis in 0..3 {
            self.mean[POSITION + axis] += dt_s * self.mean[VELOCITY + axis];
        }
        for column in 0..STATES {
            for axis in 0..3 {
                p[(POSITION + axis, column)] += dt_s * p[(VELOCITY + axis, column)];
            }
        }
        for axis in 0..3 {
            for row in 0..STATES {
                p[(row, POSITION + axis)] += dt_s * p[(row, VELOCITY + axis)];
            }
        }
        let dt_s = dt_s.abs();
        let walk = motion.velocity_walk_mps * motion.velocity_walk_mps;
        let grown = motion.size_walk_m * motion.size_walk_m * dt_s;
        for axis in 0..3 {
            let (at, to) = (POSITION + axis, VELOCITY + axis);
            p[(at, at)] += walk * dt_s * dt_s * dt_s / 3.0;
            p[(at, to)] += walk * dt_s * dt_s / 2.0;
            p[(to, at)] += walk * dt_s * dt_s / 2.0;
            p[(to, to)] += walk * dt_s;
            p[(SIZE + axis, SIZE + axis)] += grown;
        }
    }

    /// Takes a measurement in, by Joseph's form. Gives its squared Mahalanobis distance from what was expected: χ² with 6
    /// degrees of freedom where the model holds. Nothing changes, and nothing comes back, where the covariances' sum has
    /// no root.
    pub(crate) fn update(&mut self, measured: &Measured) -> Option<f64> {
        let cross = observed(&self.covariance);
        let innovation = self.innovation(measured);
        let root = (seen(&cross) + measured.covariance).cholesky()?;
        let gain: Gain = root.solve(&cross.transpose()).transpose();
        let mean = self.mean + gain * innovation;
        // (I − K H) P (I − K H)ᵀ + K R Kᵀ, where P Hᵀ is `cross`.
        let left = self.covariance - gain * cross.transpose();
        let both = left - (observed(&left) - gain * measured.covariance) * gain.transpose();
        if !(mean.iter().all(|value| value.is_finite()) && both.iter().all(|value| value.is_finite())) {
            return None;
        }
        self.mean = mean;
        self.covariance = (both + both.transpose()) * 0.5;
        Some(innovation.dot(&root.solve(&innovation)))
    }

    /// Squared Mahalanobis distance of a measurement from what is expected; infinite where that has no meaning.
    pub(crate) fn distance(&self, measured: &Measured) -> f64 {
        let innovation = self.innovation(measured);
        let root = (seen(&observed(&self.covariance)) + measured.covariance).cholesky();
        root.map_or(f64::INFINITY, |root| innovation.dot(&root.solve(&innovation)))
    }

    fn innovation(&self, measured: &Measured) -> Vector6<f64> {
        let mut innovation = measured.value;
        for axis in 0..3 {
            innovation[axis] -= self.mean[POSITION + axis];
            innovation[3 + axis] -= self.mean[SIZE + axis];
        }
        if !measured.sized {
            innovation.fixed_rows_mut::<3>(3).fill(0.0);
        }
        innovation
    }

    #[cfg(test)]
    pub(crate) fn is_positive_definite(&self) -> bool {
        self.covariance.cholesky().is_some() && self.covariance == self.covariance.transpose()
    }
}

/// M Hᵀ: the columns of what is measured.
fn observed(matrix: &Covariance) -> Gain {
    let mut columns = Gain::zeros();
    columns.fixed_columns_mut::<3>(0).copy_from(&matrix.fixed_columns::<3>(POSITION));
    columns.fixed_columns_mut::<3>(3).copy_from(&matrix.fixed_columns::<3>(SIZE));
    columns
}

/// H M Hᵀ, of M Hᵀ.
fn seen(cross: &Gain) -> Matrix6<f64> {
    let mut rows = Matrix6::zeros();
    rows.fixed_rows_mut::<3>(0).copy_from(&cross.fixed_rows::<3>(POSITION));
    rows.fixed_rows_mut::<3>(3).copy_from(&cross.fixed_rows::<3>(SIZE));
    rows
}

#[cfg(test)]
mod tests {
    use nalgebra::{Cholesky, Const};
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const MOTION: Motion = Motion { velocity_walk_mps: 0.05, size_walk_m: 0.01 };

    fn normal<const N: usize>(random: &mut ChaCha8Rng, covariance: &SMatrix<f64, N, N>) -> SVector<f64, N>
    where
        Const<N>: nalgebra::DimSub<nalgebra::U1>,
    {
        let root = Cholesky::new(*covariance).unwrap().l();
        root * SVector::<f64, N>::from_fn(|_, _| StandardNormal.sample(random))
    }

    /// Covariance of centre and size along one line of sight: the far side is not seen, so both go together.
    fn typical() -> Matrix6<f64> {
        let mut all = Matrix6::from_diagonal(&Vector6::new(4e-4, 1e-4, 1e-4, 9e-4, 4e-4, 4e-4));
        all[(0, 3)] = 4e-4;
        all[(3, 0)] = 4e-4;
        all
    }

    fn diffuse() -> Filter {
        let mean = [Vector3::zeros(), Vector3::zeros(), Vector3::from_element(1.0)];
        Filter::new(mean, 20.0, Matrix3::identity(), 1.0)
    }

    /// One obstacle that obeys the model: the filter after `sweeps`, its error of position and velocity, the sum of NIS.
    fn simulated(random: &mut ChaCha8Rng, sweeps: usize) -> (Filter, Vector6<f64>, f64) {
        let mut position = Vector3::<f64>::from_fn(|_, _| StandardNormal.sample(random)) * 20.0;
        let mut velocity = Vector3::<f64>::from_fn(|_, _| StandardNormal.sample(random));
        let mut size = Vector3::from_element(1.0) + Vector3::<f64>::from_fn(|_, _| StandardNormal.sample(random));
        let mut filter = diffuse();
        let mut nis = 0.0;
        for sweep in 0..sweeps {
            if sweep > 0 {
                let dt_s: f64 = [0.1, 0.09, 0.12][sweep % 3];
                let walk = MOTION.velocity_walk_mps.powi(2);
                let mixed = walk * dt_s.powi(2) / 2.0;
                let noise = nalgebra::Matrix2::new(walk * dt_s.powi(3) / 3.0, mixed, mixed, walk * dt_s);
                for axis in 0..3 {
                    let kick = normal(random, &noise);
                    position[axis] += dt_s * velocity[axis] + kick[0];
                    velocity[axis] += kick[1];
                    let step: f64 = StandardNormal.sample(random);
                    size[axis] += step * MOTION.size_walk_m * dt_s.sqrt();
                }
                filter.predict(dt_s, &MOTION);
            }
            // The view changes, and with it how wrong a fit may be.
            let covariance = typical() * (1.0 + 0.5 * (sweep % 4) as f64);
            let noise = normal(random, &covariance);
            let value = Vector6::from_fn(|row, _| noise[row] + if row < 3 { position[row] } else { size[row - 3] });
            nis += filter.update(&Measured { value, sized: true, covariance }).unwrap();
        }
        let mut wrong = Vector6::zeros();
        wrong.fixed_rows_mut::<3>(0).copy_from(&(filter.position_m() - position));
        wrong.fixed_rows_mut::<3>(3).copy_from(&(filter.velocity_mps() - velocity));
        (filter, wrong, nis)
    }

    // verifies TRA-003
    #[test]
    fn errors_are_as_large_as_the_covariance_says_where_the_model_holds() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for sweeps in [1, 3, 30] {
            let (mut nees, mut nis) = (0.0, 0.0);
            let runs = 400;
            for _ in 0..runs {
                let (filter, wrong, sum) = simulated(&mut random, sweeps);
                nees += wrong.dot(&filter.kinematic_covariance().cholesky().unwrap().solve(&wrong));
                nis += sum;
            }
            // Sums are χ² with 6·runs and 6·runs·sweeps degrees of freedom; normal to a good approximation.
            for (sum, freedom) in [(nees, 6.0 * runs as f64), (nis, 6.0 * (runs * sweeps) as f64)] {
                let deviation = (sum - freedom) / (2.0 * freedom).sqrt();
                assert!(deviation.abs() < 1.96, "{sweeps} sweeps: {deviation} standard deviations");
            }
        }
    }

    // verifies TRA-002
    #[test]
    fn a_constant_velocity_is_recovered() {
        let velocity = Vector3::new(0.7, -0.4, 0.1);
        let mut filter = diffuse();
        let still = Motion { velocity_walk_mps: 0.0, ..MOTION };
        for sweep in 0..50 {
            if sweep > 0 {
                filter.predict(0.1, &still);
            }
            let centre = velocity * (0.1 * f64::from(sweep));
            let value = Vector6::new(centre.x, centre.y, centre.z, 2.0, 1.5, 1.0);
            filter.update(&Measured { value, sized: true, covariance: typical() }).unwrap();
        }
        assert!((filter.velocity_mps() - velocity).norm() < 1e-3);
        assert!((filter.position_m() - velocity * 4.9).norm() < 1e-3);
        assert!((filter.size_m() - Vector3::new(2.0, 1.5, 1.0)).norm() < 1e-2);
    }

    #[test]
    fn a_measurement_without_extents_says_nothing_of_the_size() {
        let mut filter = diffuse();
        let covariance = Matrix6::from_diagonal(&Vector6::new(1e-4, 1e-4, 1e-4, 1e4, 1e4, 1e4));
        let before = (filter.size_m(), filter.size_covariance());
        let value = Vector6::new(1.0, 2.0, 3.0, f64::NAN, f64::NAN, f64::NAN);
        filter.update(&Measured { value, sized: false, covariance }).unwrap();
        assert_eq!(filter.size_m(), before.0);
        assert!((filter.size_covariance() - before.1).abs().max() < 1e-3);
        assert!((filter.position_m() - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-3);
    }

    #[test]
    fn a_covariance_without_a_root_changes_nothing() {
        let mut filter = diffuse();
        let measured = Measured { value: Vector6::zeros(), sized: true, covariance: Matrix6::identity() * -1e9 };
        assert_eq!(filter.update(&measured), None);
        assert_eq!(filter.distance(&measured), f64::INFINITY);
        assert_eq!(filter.position_m(), Vector3::zeros());
    }

    /// A covariance with standard deviations of 1 mm to 100 m, turned at random.
    fn odd_covariance() -> impl Strategy<Value = Matrix6<f64>> {
        (prop::array::uniform6(-3.0..2.0_f64), prop::collection::vec(-1.0..1.0_f64, 36)).prop_map(|(sigmas, turn)| {
            let turn = Matrix6::from_iterator(turn).qr().q();
            let diagonal = Matrix6::from_diagonal(&Vector6::from_iterator(sigmas.map(|sigma| 100_f64.powf(sigma))));
            let turned = turn * diagonal * turn.transpose();
            (turned + turned.transpose()) * 0.5 + Matrix6::identity() * 1e-6
        })
    }

    // verifies TRA-004
    #[test]
    fn a_covariance_stays_positive_definite_whatever_is_measured() {
        let step = (odd_covariance(), prop::array::uniform6(-1e3..1e3_f64), -0.1..3.0_f64);
        let config = ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() };
        let mut runner = proptest::test_runner::TestRunner::new_with_rng(
            config,
            proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
        );
        let run = runner.run(&prop::collection::vec(step, 1..40), |steps| {
            let mut filter = diffuse();
            for round in 0..5 {
                for (covariance, value, dt_s) in &steps {
                    filter.predict(*dt_s, &MOTION);
                    let value = Vector6::from(*value);
                    let measured = Measured { value, sized: round % 2 == 0, covariance: *covariance };
                    prop_assert!(filter.update(&measured).is_some());
                    prop_assert!(filter.is_positive_definite());
                }
            }
            Ok(())
        });
        run.unwrap();
    }
}
