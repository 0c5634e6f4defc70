use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

/// For errors that are what the fits say.
const PARAMS: SpinParams = SpinParams {
    min_points: 20,
    prior_radps: 0.3,
    wander_radps: 0.002,
    floor_rad: 0.005,
    inflation: 1.0,
    ellipsoid_inflation: 1.0,
    freedom: 4.0,
    blind_rad: 0.08,
    gate: 30.0,
    patience: 5,
    most_sigma_radps: 0.1,
};
const SIZE: [f64; 3] = [2.0, 1.4, 0.9];

fn vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// A body that turns at a constant rate, and what fits to it say.
struct Body {
    class: ObstacleClass,
    start: Rotation3<f64>,
    spin: Vector3<f64>,
    sigma_rad: f64,
    /// Where the fits see the body's axes, in the body.
    wrong: Rotation3<f64>,
    rng: ChaCha8Rng,
}

impl Body {
    fn new(class: ObstacleClass, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let start = Rotation3::from_scaled_axis(vector(&mut rng) * 2.0);
        let spin = vector(&mut rng).normalize() * rng.random_range(0.03..0.7);
        Self { class, start, spin, sigma_rad: 0.02, wrong: Rotation3::identity(), rng }
    }

    fn attitude(&self, time_s: f64) -> Rotation3<f64> {
        Rotation3::from_scaled_axis(self.spin * time_s) * self.start
    }

    fn across(&self, time_s: f64) -> Vector3<f64> {
        let axis = self.attitude(time_s) * Vector3::z();
        self.spin - axis * axis.dot(&self.spin)
    }

    /// A fit with its error, axes named and turned as it happens.
    fn fit(&mut self, time_s: f64) -> AttitudeFit {
        let turn = Rotation3::from_scaled_axis(vector(&mut self.rng) * self.sigma_rad);
        let mut attitude = turn * self.attitude(time_s) * self.wrong;
        let mut size_m = SIZE;
        let rng = &mut self.rng;
        let quarter = |axis: Vector3<f64>, times: i32| {
            Rotation3::from_scaled_axis(axis * f64::from(times) * 0.5 * std::f64::consts::PI)
        };
        match self.class {
            ObstacleClass::Cylindrical => {
                size_m = [1.0, 1.0, 2.0];
                let roll = Rotation3::from_scaled_axis(Vector3::z() * rng.random_range(0.0..6.0));
                attitude = attitude * quarter(Vector3::x(), 2 * rng.random_range(0..2)) * roll;
            }
            ObstacleClass::Conical => {
                size_m = [1.0, 1.0, 2.0];
                attitude *= Rotation3::from_scaled_axis(Vector3::z() * rng.random_range(0.0..6.0));
            }
            _ => {
                for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                    let times = rng.random_range(0..4);
                    attitude *= quarter(axis, times);
                    if times % 2 == 1 {
                        let kept = axis.iamax();
                        size_m.swap((kept + 1) % 3, (kept + 2) % 3);
                    }
                }
            }
        }
        AttitudeFit {
            time_s,
            attitude: UnitQuaternion::from_rotation_matrix(&attitude),
            covariance_rad2: Matrix3::from_diagonal_element(self.sigma_rad * self.sigma_rad),
            class: self.class,
            size_m: size_m.map(|size| size * (1.0 + 0.03 * rng.sample::<f64, _>(StandardNormal))),
            size_sigma_m: [0.05; 3],
        }
    }

    fn followed(&mut self, sweeps: u32) -> SpinFilter {
        let mut filter = SpinFilter::new(&self.fit(0.0), &PARAMS).unwrap();
        for sweep in 1..sweeps {
            filter.update(&self.fit(f64::from(sweep) * 0.1), &PARAMS);
        }
        filter
    }
}

// verifies TRA-023
#[test]
fn the_spin_of_every_class_is_found_within_its_deviation() {
    for class in ObstacleClass::SOLIDS {
        let mut squares = 0.0;
        for seed in 0..60 {
            let mut body = Body::new(class, seed);
            let found = body.followed(30).estimate(&PARAMS);
            let (truth, dimensions) = match found.observed {
                Observed::Whole => (body.spin, 3.0),
                _ => (body.across(2.9), 2.0),
            };
            let error = (found.radps - truth).norm();
            assert!(error < 0.06, "{class:?} {seed}: {found:?} {truth:?}");
            assert!(found.sigma_radps < 0.03 && found.sigma_radps > 0.001);
            squares += error * error / (found.sigma_radps * found.sigma_radps * dimensions);
        }
        // 60 times χ² with 2 or 3 degrees of freedom; robust weights and the wander make it less than 1.
        let mean = squares / 60.0;
        assert!(mean > 0.3 && mean < 1.35, "{class:?}: {mean}");
    }
}

#[test]
fn bodies_with_planes_tell_all_and_bodies_with_an_axis_what_is_across() {
    for class in ObstacleClass::SOLIDS {
        let mut body = Body::new(class, 7);
        let found = body.followed(40).estimate(&PARAMS);
        if matches!(class, ObstacleClass::Rectangular | ObstacleClass::Ellipsoidal) {
            assert_eq!(found.observed, Observed::Whole);
        } else {
            assert_eq!(found.observed, Observed::AcrossAxis);
            let axis = body.attitude(3.9) * Vector3::z();
            assert!(found.radps.dot(&axis).abs() < 0.05 * body.spin.norm());
        }
    }
}

#[test]
fn a_cylinder_that_turns_about_its_axis_alone_seems_at_rest() {
    let mut body = Body::new(ObstacleClass::Cylindrical, 8);
    body.spin = body.start * Vector3::z() * 0.6;
    let found = body.followed(40).estimate(&PARAMS);
    assert_eq!(found.observed, Observed::AcrossAxis);
    assert!(found.radps.norm() < 0.03, "{found:?}");
}

#[test]
fn wrong_minima_now_and_then_do_not_matter() {
    for seed in 0..30 {
        let mut body = Body::new(ObstacleClass::Rectangular, 100 + seed);
        let mut filter = SpinFilter::new(&body.fit(0.0), &PARAMS).unwrap();
        for sweep in 1..60 {
            let mut fit = body.fit(f64::from(sweep) * 0.1);
            if body.rng.random_bool(0.2) && sweep > 5 {
                let wrong =
                    Rotation3::from_scaled_axis(vector(&mut body.rng).normalize() * body.rng.random_range(0.4..0.7));
                fit.attitude = UnitQuaternion::from_rotation_matrix(&(wrong * fit.attitude.to_rotation_matrix()));
            }
            filter.update(&fit, &PARAMS);
        }
        let found = filter.estimate(&PARAMS);
        assert!((found.radps - body.spin).norm() < 0.03, "{seed}: {found:?} {:?}", body.spin);
    }
}

#[test]
fn a_minimum_that_stays_is_believed_and_the_spin_goes_on() {
    let mut body = Body::new(ObstacleClass::Rectangular, 9);
    let mut filter = body.followed(40);
    body.wrong = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.4, 0.1));
    let mut counted = 0;
    for sweep in 40..70 {
        counted += u32::from(filter.update(&body.fit(f64::from(sweep) * 0.1), &PARAMS));
    }
    assert_eq!(counted, 30 - PARAMS.patience, "all but the first few");
    assert!((filter.estimate(&PARAMS).radps - body.spin).norm() < 0.03);
}

#[test]
fn too_short_a_time_tells_nothing() {
    let mut body = Body::new(ObstacleClass::Rectangular, 10);
    let filter = body.followed(1);
    assert_eq!(filter.estimate(&PARAMS), SpinEstimate::default());
    body.sigma_rad = 0.5;
    assert_eq!(body.followed(10).estimate(&PARAMS).observed, Observed::Nothing);
}

#[test]
fn what_is_no_attitude_is_not_taken() {
    let mut body = Body::new(ObstacleClass::Rectangular, 11);
    let good = body.fit(1.0);
    let broken = AttitudeFit { covariance_rad2: Matrix3::from_element(f64::NAN), ..good };
    let unclassified = AttitudeFit { class: ObstacleClass::Unclassified, ..good };
    assert_eq!(SpinFilter::new(&broken, &PARAMS), None);
    assert_eq!(SpinFilter::new(&unclassified, &PARAMS), None);
    let mut filter = SpinFilter::new(&good, &PARAMS).unwrap();
    let before = filter;
    for fit in [broken, unclassified, AttitudeFit { time_s: 0.9, ..good }, AttitudeFit { time_s: f64::NAN, ..good }] {
        assert!(!filter.update(&fit, &PARAMS));
        assert_eq!(filter, before);
    }
    // Once more at the same time is information, not a division by zero.
    assert!(filter.update(&good, &PARAMS));
    assert!(filter.estimate(&PARAMS).sigma_radps.is_finite());
}

#[test]
fn another_class_is_believed_after_some_patience() {
    let mut body = Body::new(ObstacleClass::Rectangular, 12);
    let mut filter = body.followed(10);
    body.class = ObstacleClass::Cylindrical;
    for sweep in 10..40 {
        filter.update(&body.fit(f64::from(sweep) * 0.1), &PARAMS);
    }
    let found = filter.estimate(&PARAMS);
    assert_eq!(found.observed, Observed::AcrossAxis);
    assert!((found.radps - body.across(3.9)).norm() < 0.05);
}

#[test]
fn covariances_stay_positive_through_a_long_life() {
    for class in ObstacleClass::SOLIDS {
        let filter = Body::new(class, 13).followed(3_000);
        let least = filter.covariance.symmetric_eigenvalues().min();
        assert!(least > -1e-9, "{class:?}: {least}");
        assert!((filter.attitude.matrix().determinant() - 1.0).abs() < 1e-9);
    }
}
