use lidar::ObstacleClass;
use messages::ClosestApproach;
use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::surface::distance_m;
use super::*;

const OWN_M: f64 = 2.0;
const HORIZON_S: f64 = 30.0;

/// Passes along x, nearest on the y axis, in ten seconds.
struct Pass {
    body: Body,
    velocity_mps: Vector3<f64>,
}

impl Pass {
    fn position_m(&self, beside_m: f64) -> Vector3<f64> {
        Vector3::new(0.0, beside_m, 0.0) - self.velocity_mps * 10.0
    }

    /// What is seen of one that passes so far beside: known to some centimetres.
    fn seen(&self, beside_m: f64, sigma_m: f64) -> ClosestApproach {
        let [distance_m, distance_sigma_m] = [beside_m, sigma_m].map(|one| one as f32);
        ClosestApproach { time_s: 10.0, distance_m, distance_sigma_m, collision_probability: 0.0 }
    }

    fn touch(&self, sigma_m: f64) -> Touch {
        let about_m = OWN_M + 0.25 * self.body.size_m.iter().sum::<f64>() / 1.5;
        let (position_m, seen) = (self.position_m(about_m), self.seen(about_m, sigma_m));
        self.body.passing(OWN_M, &position_m, &self.velocity_mps, &seen, HORIZON_S)
    }

    /// Whether the body comes within the own radius: looked at every two hundredths of a second.
    fn touches(&self, beside_m: f64, spin_radps: &Vector3<f64>) -> bool {
        let from = self.position_m(beside_m);
        (0..1_500).map(|step| 0.02 * f64::from(step)).any(|time_s| {
            let attitude = Rotation3::from_scaled_axis(spin_radps * time_s) * self.body.attitude.to_rotation_matrix();
            let own = attitude.inverse() * -(from + self.velocity_mps * time_s);
            distance_m(self.body.class, &self.body.size_m, &own) <= OWN_M
        })
    }

    /// The farthest beside at which it touches.
    fn drawn_m(&self, spin_radps: &Vector3<f64>) -> f64 {
        let (mut low, mut high) = (OWN_M, OWN_M + Vector3::from(self.body.size_m).norm());
        for _ in 0..10 {
            let middle = 0.5 * (low + high);
            if self.touches(middle, spin_radps) { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    fn random(rng: &mut ChaCha8Rng) -> Self {
        let class = ObstacleClass::SOLIDS[rng.random_range(0..4)];
        let mut size_m = std::array::from_fn(|_| rng.random_range(0.5..3.5));
        if matches!(class, ObstacleClass::Cylindrical | ObstacleClass::Conical) {
            size_m[1] = size_m[0];
        }
        let turn = Vector3::from_fn(|_, _| 2.0 * rng.sample::<f64, _>(StandardNormal));
        let spin_radps = Vector3::from_fn(|_, _| 0.3 * rng.sample::<f64, _>(StandardNormal));
        let body = Body { attitude: UnitQuaternion::from_scaled_axis(turn), spin_radps, ..still(class, size_m) };
        Self { body, velocity_mps: Vector3::new(rng.random_range(0.4..1.0), 0.0, 0.0) }
    }
}

/// A body that is known and does not turn, its axes along those of the course.
fn still(class: ObstacleClass, size_m: [f64; 3]) -> Body {
    Body {
        class,
        size_m,
        size_sigma_m: [0.0; 3],
        attitude: UnitQuaternion::identity(),
        spin_radps: Vector3::zeros(),
        spin_covariance: Matrix3::zeros(),
        spin_wander_radps: 0.0,
    }
}

fn slow(body: Body) -> Pass {
    Pass { body, velocity_mps: Vector3::new(0.5, 0.0, 0.0) }
}

#[test]
fn a_ball_touches_at_the_sum_of_both_radii_however_it_turns() {
    let ball = still(ObstacleClass::Ellipsoidal, [2.0; 3]);
    let unknown = Body { spin_covariance: Matrix3::from_diagonal_element(0.09), ..ball };
    let found = slow(unknown).touch(0.03);
    assert!((found.tumbling_m - 3.0).abs() < 0.01 && found.sigma_m < 0.01, "{found:?}");
}

#[test]
fn a_rod_touches_from_farther_off_where_it_points_at_the_craft() {
    // Along the course, across it and at the craft: only in the last is its end nearer than its flank.
    for (size_m, expected_m) in [([4.0, 0.4, 0.4], 2.2), ([0.4, 0.4, 4.0], 2.2), ([0.4, 4.0, 0.4], 4.0)] {
        let found = slow(still(ObstacleClass::Rectangular, size_m)).touch(0.03);
        assert!((found.tumbling_m - expected_m).abs() < 0.02, "{size_m:?}: {found:?}");
        assert!(found.sigma_m < 1e-9);
    }
}

#[test]
fn a_turning_body_touches_where_its_surface_does() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut errors: Vec<f64> = (0..120)
        .map(|_| {
            let pass = Pass::random(&mut rng);
            (pass.touch(1e-6).tumbling_m - pass.drawn_m(&pass.body.spin_radps)).abs()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[60] < 0.005 && errors[108] < 0.01 && errors[119] < 0.1, "{:?}", &errors[100..]);
}

#[test]
fn an_unknown_spin_makes_the_distance_of_touch_as_uncertain_as_it_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let (mut means, mut spreads) = (Vec::new(), Vec::new());
    for _ in 0..20 {
        let mut pass = Pass::random(&mut rng);
        pass.body.spin_covariance = Matrix3::from_diagonal_element(0.09);
        pass.body.spin_radps = Vector3::zeros();
        let drawn: Vec<f64> = (0..60)
            .map(|_| pass.drawn_m(&Vector3::from_fn(|_, _| 0.3 * rng.sample::<f64, _>(StandardNormal))))
            .collect();
        let mean_m = drawn.iter().sum::<f64>() / 60.0;
        let spread_m = (drawn.iter().map(|one| (one - mean_m).powi(2)).sum::<f64>() / 59.0).sqrt();
        let found = pass.touch(1e-3);
        means.push(found.tumbling_m - mean_m);
        spreads.push(found.sigma_m - spread_m);
    }
    let worst = |all: &[f64]| all.iter().fold(0.0, |most: f64, one| most.max(one.abs()));
    let mean = |all: &[f64]| all.iter().sum::<f64>() / 20.0;
    assert!(worst(&means) < 0.2 && mean(&means).abs() < 0.03, "{means:?}");
    assert!(worst(&spreads) < 0.15 && mean(&spreads).abs() < 0.04, "{spreads:?}");
}

#[test]
fn of_what_is_sure_either_way_or_hardly_known_the_attitude_is_not_asked() {
    let pass = slow(still(ObstacleClass::Rectangular, [0.4, 4.0, 0.4]));
    let all = touch(OWN_M, pass.body.class, pass.body.size_m, [0.0; 3]);
    for (beside_m, sigma_m) in [(1.5, 0.05), (4.5, 0.05), (3.0, 20.0)] {
        let seen = pass.seen(beside_m, sigma_m);
        let found = pass.body.passing(OWN_M, &pass.position_m(beside_m), &pass.velocity_mps, &seen, HORIZON_S);
        assert_eq!(found, all, "{beside_m} {sigma_m}");
    }
    let half = slow(pass.body).touch(1.2).tumbling_m;
    assert!(half > all.tumbling_m + 0.1 && half < 3.9, "{half}");
}

#[test]
fn a_long_side_that_comes_round_is_foreseen_and_one_that_does_not_is_no_danger() {
    let sigma = Vector6::new(1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6);
    let covariance = Matrix6::from_diagonal(&sigma);
    let of = |spin: f64| {
        let body =
            Body { spin_radps: Vector3::new(0.0, 0.0, spin), ..still(ObstacleClass::Cylindrical, [0.4, 0.4, 4.0]) };
        // Its axis along x at the start; upright about x it would never reach out.
        let lies = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        let pass = slow(Body { attitude: lies, ..body });
        foresee(&pass.position_m(3.3), &pass.velocity_mps, &covariance, &pass.body, OWN_M, HORIZON_S)
    };
    // A quarter turn in ten seconds: across the course when it is nearest.
    let (turning, still) = (of(std::f64::consts::FRAC_PI_2 / 10.0), of(0.0));
    assert!(turning.collision_probability > 0.99, "{turning:?}");
    assert!(still.collision_probability < 1e-3, "{still:?}");
    assert_eq!((turning.time_s, turning.distance_m), (still.time_s, still.distance_m));
}

#[test]
fn of_what_is_not_a_number_the_worst_is_said() {
    let pass = slow(still(ObstacleClass::Conical, [1.0, 1.0, f64::NAN]));
    let of = |body: Body, x: f64| {
        let position_m = Vector3::new(x, 2.6, 0.0);
        foresee(&position_m, &pass.velocity_mps, &(Matrix6::identity() * 1e-4), &body, OWN_M, HORIZON_S)
    };
    assert_eq!(of(pass.body, -5.0), WORST);
    let known = still(ObstacleClass::Conical, [1.0, 1.0, 2.0]);
    assert_eq!(of(known, f64::NAN), WORST);
    let spin_radps = Vector3::new(f64::NAN, 0.0, f64::INFINITY);
    assert!(of(Body { spin_radps, ..known }, -5.0).collision_probability.is_finite());
}
