use messages::ClosestApproach;
use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

const NONE: Matrix6<f64> = Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6]));

fn of(position: [f64; 3], velocity: [f64; 3], covariance: &Matrix6<f64>, touch: f64, horizon: f64) -> ClosestApproach {
    closest_approach(&Vector3::from(position), &Vector3::from(velocity), covariance, touch, horizon)
}

/// Position and velocity each as well known in all directions [m, m/s].
fn even(position: f64, velocity: f64) -> Matrix6<f64> {
    let (p, v) = (position * position, velocity * velocity);
    Matrix6::from_diagonal(&Vector6::new(p, p, p, v, v, v))
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

struct Encounter {
    mean: Vector6<f64>,
    root: Matrix6<f64>,
    touch_m: f64,
    horizon_s: f64,
}

impl Encounter {
    /// As constant-velocity filters give them: positions measured to 1 to 40 cm at 10 Hz, unevenly in the directions, 2 to
    /// 60 times, at up to 1.2 m/s, passing at up to a few radii, before, within or after the horizon; one in ten at rest.
    fn random(rng: &mut ChaCha8Rng) -> Self {
        let touch_m = rng.random_range(0.8..3.2);
        let horizon_s = [10.0, 20.0, 30.0, 60.0][rng.random_range(0..4)];
        let mut turn = || Rotation3::from_scaled_axis(Vector3::from_fn(|_, _| 2.0 * normal(rng)));
        let (axes, way) = (turn().into_inner(), turn());
        let sweeps = f64::exp(rng.random_range(0.7..4.1)).floor();
        let noise = 10_f64.powf(rng.random_range(-2.0..-0.4));
        let mut covariance = Matrix6::zeros();
        for axis in 0..3 {
            let sigma = (noise * 10_f64.powf(rng.random_range(-0.5..0.5))).min(0.6);
            // Information of positions at −0.1 s, −0.2 s, … about where it is now and how fast, and of the prior.
            let (mut pp, mut pv, mut vv) = (0.0, 0.0, 1.0 / 0.36);
            for sweep in 0..sweeps as i32 {
                let ago = -0.1 * f64::from(sweep);
                let weight = 1.0 / (sigma * sigma);
                (pp, pv, vv) = (pp + weight, pv + weight * ago, vv + weight * ago * ago);
            }
            let determinant = pp * vv - pv * pv;
            let outer = axes.column(axis) * axes.column(axis).transpose();
            let lag = 0.09 * sigma * sigma;
            for (row, column, value) in [
                (0, 0, vv / determinant + lag),
                (0, 3, -pv / determinant),
                (3, 0, -pv / determinant),
                (3, 3, pp / determinant),
            ] {
                let mut block = covariance.fixed_view_mut::<3, 3>(row, column);
                block += outer * value;
            }
        }
        let speed = if rng.random_bool(0.1) { 0.0 } else { rng.random_range(0.0..1.2) };
        let miss = rng.random_range(0.0..2.5) * touch_m;
        let velocity = way * Vector3::new(speed, 0.0, 0.0);
        let position = way * Vector3::new(0.0, miss, 0.0) - velocity * (rng.random_range(-0.1..1.1) * horizon_s);
        let mean = Vector6::from_iterator(position.iter().chain(velocity.iter()).copied());
        Self { mean, root: motion::root(&covariance), touch_m, horizon_s }
    }

    fn answer(&self) -> ClosestApproach {
        let (position, velocity) = (self.mean.fixed_rows::<3>(0).into(), self.mean.fixed_rows::<3>(3).into());
        closest_approach(&position, &velocity, &(self.root * self.root.transpose()), self.touch_m, self.horizon_s)
    }

    /// Least distance of one motion that is as likely as this says.
    fn drawn_m(&self, rng: &mut ChaCha8Rng) -> f64 {
        let state = self.mean + self.root * Vector6::from_fn(|_, _| normal(rng));
        let (position, velocity) = (state.fixed_rows::<3>(0).into_owned(), state.fixed_rows::<3>(3).into_owned());
        let time_s = (-position.dot(&velocity) / velocity.norm_squared().max(1e-30)).clamp(0.0, self.horizon_s);
        (position + velocity * time_s).norm()
    }
}

#[test]
fn at_rest_and_known_it_touches_or_does_not() {
    let outside = of([3.0, 4.0, 0.0], [0.0; 3], &NONE, 4.9, 30.0);
    assert_eq!((outside.time_s, outside.distance_m, outside.collision_probability), (0.0, 5.0, 0.0));
    assert!(outside.distance_sigma_m < 1e-6);
    assert_eq!(of([3.0, 4.0, 0.0], [0.0; 3], &NONE, 5.1, 30.0).collision_probability, 1.0);
    assert_eq!(of([0.0; 3], [0.0; 3], &NONE, 1.0, 30.0).collision_probability, 1.0);
}

#[test]
fn a_known_course_touches_only_within_the_horizon() {
    let course = |horizon| of([0.0, 10.0, 1.0], [0.0, -1.0, 0.0], &NONE, 2.0, horizon);
    let seen = course(20.0);
    assert_eq!((seen.time_s, seen.distance_m, seen.collision_probability), (10.0, 1.0, 1.0));
    let early = course(5.0);
    assert_eq!((early.time_s, early.collision_probability), (5.0, 0.0));
    assert!((early.distance_m - 26_f32.sqrt()).abs() < 1e-6);
    // Contact is at 10 − √3 = 8.27 s.
    assert_eq!((course(8.2).collision_probability, course(8.3).collision_probability), (0.0, 1.0));
}

#[test]
fn what_goes_away_is_nearest_now() {
    let away = of([5.0, 0.0, 0.0], [0.5, 0.1, 0.0], &even(0.1, 0.05), 2.0, 60.0);
    assert_eq!((away.time_s, away.distance_m), (0.0, 5.0));
    assert!(away.collision_probability < 1e-5);
    assert!((away.distance_sigma_m - 0.1).abs() < 0.03);
}

#[test]
fn what_touches_already_touches() {
    for velocity in [[0.0; 3], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.7, 0.0]] {
        for sigma in [0.0, 0.05, 0.5] {
            let touching = of([1.6, 0.0, 0.0], velocity, &even(0.05, sigma), 2.0, 30.0);
            assert!(touching.collision_probability > 0.9999, "{velocity:?} {sigma}: {touching:?}");
        }
    }
}

#[test]
fn without_a_horizon_it_is_a_normal_distribution_in_a_ball() {
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    for (distance, sigma, touch) in
        [(0.5, 1.0, 1.0), (2.0, 0.5, 1.5), (3.0, 1.5, 2.0), (1.0, 0.02, 1.01), (4.0, 0.3, 3.5)]
    {
        let (near, far): (f64, f64) = ((touch - distance) / sigma, (touch + distance) / sigma);
        let exact = normal::between(-far, near) - sigma / distance * (density(near) - density(far));
        let found = of([0.0, 0.0, distance], [0.3, 0.0, 0.0], &even(sigma, 0.2), touch, 0.0);
        assert!(
            (f64::from(found.collision_probability) - exact).abs() < 0.006,
            "{distance} {sigma}: {found:?} {exact}"
        );
        assert_eq!(found.time_s, 0.0);
    }
}

#[test]
fn a_known_place_and_any_direction_make_the_solid_angle() {
    for distance in [1.3_f64, 2.0, 4.0, 8.0] {
        let exact = 0.5 * (1.0 - (1.0 - 1.0 / (distance * distance)).sqrt());
        let found = of([0.0, -distance, 0.0], [0.0; 3], &even(0.001, 0.5), 1.0, 300.0);
        let found = f64::from(found.collision_probability);
        assert!((found / exact - 1.0).abs() < 0.03, "{distance}: {found} {exact}");
    }
}

#[test]
fn a_known_velocity_makes_the_integral_over_a_disc() {
    // Foster and Estes (1992): position at passage, across the velocity, in a disc; here by a fine grid.
    for (miss, sigma) in [(0.0, [1.0, 1.0]), (1.5, [0.4, 0.4]), (2.0, [0.8, 0.2]), (2.0, [0.2, 1.6]), (2.4, [0.1, 0.1])]
    {
        let (touch, cells) = (2.0, 400);
        let mut exact = 0.0;
        for cell in 0..cells * cells {
            let place = |cell: usize| (cell as f64 + 0.5) / cells as f64 * 2.0 * touch - touch;
            let (y, z) = (place(cell % cells), place(cell / cells));
            if y * y + z * z < touch * touch {
                let power = ((y - miss) / sigma[0]).powi(2) + (z / sigma[1]).powi(2);
                exact += (-0.5 * power).exp() / (2.0 * std::f64::consts::PI * sigma[0] * sigma[1]);
            }
        }
        exact *= (2.0 * touch / cells as f64).powi(2);
        let mut covariance = NONE;
        for (axis, sigma) in [0.5, sigma[0], sigma[1]].into_iter().enumerate() {
            covariance[(axis, axis)] = sigma * sigma;
        }
        let found = of([-8.0, miss, 0.0], [1.0, 0.0, 0.0], &covariance, touch, 20.0);
        assert!((f64::from(found.collision_probability) - exact).abs() < 0.004, "{miss} {sigma:?}: {found:?} {exact}");
    }
}

#[test]
fn a_covariance_may_be_singular() {
    // All that is uncertain is how fast it comes: 0.5 ± 0.1 m/s, and 8 m to go before it touches.
    let mut covariance = NONE;
    covariance[(3, 3)] = 0.01;
    let found = of([-10.0, 0.0, 0.0], [0.5, 0.0, 0.0], &covariance, 2.0, 16.0);
    assert!((found.collision_probability - 0.5).abs() < 0.01, "{found:?}");
    // And a place that is known along one direction only because of the other.
    let mut tied = NONE;
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        tied[(row, column)] = 0.25;
    }
    let found = of([-10.0, 0.0, 0.0], [0.5, 0.0, 0.0], &tied, 2.0, 60.0);
    assert!(found.collision_probability > 0.999, "{found:?}");
}

#[test]
fn what_is_not_a_number_is_not_called_safe() {
    let worst = ClosestApproach { collision_probability: 1.0, ..ClosestApproach::default() };
    let mut broken = even(0.1, 0.1);
    broken[(2, 4)] = f64::NAN;
    assert_eq!(of([5.0, 0.0, 0.0], [0.0; 3], &broken, 1.0, 10.0), worst);
    assert_eq!(of([f64::NAN, 0.0, 0.0], [0.0; 3], &NONE, 1.0, 10.0), worst);
    assert_eq!(of([5.0, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], &NONE, 1.0, 10.0), worst);
    assert_eq!(of([5.0, 0.0, 0.0], [0.0; 3], &NONE, f64::NAN, 10.0), worst);
    assert_eq!(of([5.0, 0.0, 0.0], [0.0; 3], &NONE, 1.0, f64::NAN), worst);
    // Less than nothing is nothing.
    let negative = of([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], &-even(0.1, 0.1), 1.0, -3.0);
    assert_eq!((negative.time_s, negative.collision_probability), (0.0, 0.0));
    assert_eq!(of([5.0, 0.0, 0.0], [-1.0, 0.0, 0.0], &NONE, -1.0, 10.0).collision_probability, 0.0);
}

#[test]
fn probabilities_are_those_of_drawn_motions() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut squares, mut worst, mut sure) = (0.0, 0.0_f64, 0);
    const ENCOUNTERS: usize = 250;
    const DRAWS: usize = 2_000;
    for _ in 0..ENCOUNTERS {
        let encounter = Encounter::random(&mut rng);
        let found = f64::from(encounter.answer().collision_probability);
        let touched = (0..DRAWS).filter(|_| encounter.drawn_m(&mut rng) <= encounter.touch_m).count();
        let share = touched as f64 / DRAWS as f64;
        squares += (found - share).powi(2);
        worst = worst.max((found - share).abs());
        sure += usize::from(share == 0.0 || share == 1.0);
    }
    let rms = (squares / ENCOUNTERS as f64).sqrt();
    // Drawing alone makes 0.011 at a probability of 0.5.
    assert!(rms < 0.015 && worst < 0.12, "rms {rms}, worst {worst}");
    assert!(sure < ENCOUNTERS / 2, "{sure} of {ENCOUNTERS} say nothing");
}

#[test]
fn of_encounters_called_as_likely_that_share_touches() {
    // One motion drawn for each of 4,000 encounters; bins of the answer as in a reliability plot.
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let edges = [0.0, 0.01, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01];
    let mut bins = [(0.0, 0.0, 0.0); 8];
    for _ in 0..4_000 {
        let encounter = Encounter::random(&mut rng);
        let found = f64::from(encounter.answer().collision_probability);
        let touched = encounter.drawn_m(&mut rng) <= encounter.touch_m;
        let bin = edges.iter().rposition(|&edge| found >= edge).unwrap();
        bins[bin].0 += found;
        bins[bin].1 += f64::from(u8::from(touched));
        bins[bin].2 += found * (1.0 - found);
    }
    for (bin, (expected, touched, variance)) in bins.into_iter().enumerate() {
        assert!((touched - expected).abs() < 3.5 * f64::sqrt(variance) + 1.0, "bin {bin}: {touched} of {expected}");
    }
}

#[test]
fn the_deviation_is_that_of_drawn_distances() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut ratios: Vec<f64> = (0..150)
        .map(|_| {
            let encounter = Encounter::random(&mut rng);
            let found = encounter.answer();
            let distance = f64::from(found.distance_m);
            let sum: f64 = (0..1_000).map(|_| (encounter.drawn_m(&mut rng) - distance).powi(2)).sum();
            f64::from(found.distance_sigma_m) / (sum / 1_000.0).sqrt()
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    assert!((ratios[75] - 1.0).abs() < 0.05 && ratios[8] > 0.8 && ratios[142] < 1.25, "{ratios:?}");
    // Through the origin the distance is Rayleigh's: √2 σ, where a linearised one would be 0 or σ.
    let through = of([-5.0, 0.0, 0.0], [0.5, 0.0, 0.0], &even(0.3, 0.0), 1.0, 30.0);
    assert!((f64::from(through.distance_sigma_m) / (0.3 * std::f64::consts::SQRT_2) - 1.0).abs() < 0.05, "{through:?}");
}

#[test]
fn the_answer_does_not_depend_on_the_axes() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..50 {
        let encounter = Encounter::random(&mut rng);
        let turn: Matrix3<f64> = Rotation3::from_euler_angles(0.4, -1.1, 2.0).into_inner();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        let turned = Encounter { mean: both * encounter.mean, root: both * encounter.root, ..encounter };
        let (one, other) = (encounter.answer(), turned.answer());
        assert!((one.collision_probability - other.collision_probability).abs() < 0.03, "{one:?} {other:?}");
        assert!((one.distance_m - other.distance_m).abs() < 1e-4);
    }
}
