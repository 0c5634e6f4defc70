use lidar::SensorFile;
use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use super::*;
use crate::cast::{self, Hit, View};
use crate::ego::Ego;
use crate::obstacle::{Body, Motion, Obstacle, Shape};

fn turn(columns: usize, quantised: bool) -> Turn {
    let file: SensorFile = toml::from_str(include_str!("../../../../config/sensors/hdl-32e.toml")).unwrap();
    Turn::new(&file.checked().unwrap(), columns, quantised)
}

/// Near and far, small and huge, fast and tumbling, above and below, across the seam, round the sensor.
fn random_obstacle(rng: &mut ChaCha8Rng) -> Obstacle {
    let shape = Shape::ALL[rng.random_range(0..4)];
    let extent = rng.random_range(0.1..4.0);
    let mut size_m = Vector3::from_fn(|_, _| extent * rng.random_range(0.2..1.0));
    if shape.is_round() {
        size_m.y = size_m.x;
    }
    let mut vector = |length: f64| Vector3::from(rng.sample::<[f64; 3], _>(UnitSphere)) * length;
    let (position, axis, velocity, spin) = (vector(1.0), vector(1.0), vector(1.0), vector(1.0));
    let mut position_m = position * rng.random_range(0.5..30.0);
    if rng.random_bool(0.3) {
        position_m.y *= 0.01; // near the seam, before or behind
    }
    Obstacle {
        body: Body::Solid { shape, size_m },
        motion: Motion {
            position_m,
            attitude: UnitQuaternion::from_scaled_axis(axis * 3.0),
            velocity_mps: velocity * if rng.random_bool(0.5) { rng.random_range(0.0..60.0) } else { 0.0 },
            spin_radps: spin * if rng.random_bool(0.5) { rng.random_range(0.0..10.0) } else { 0.0 },
        },
        albedo: 0.5,
    }
}

#[test]
fn rays_outside_the_window_meet_nothing_and_those_inside_meet_the_same_bit_for_bit() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let still = Ego::default();
    let turning = Ego { spin_radps: Vector3::new(0.3, -0.2, 0.5), ..still };
    let (mut hits, mut smaller) = (0, 0);
    for round in 0..400 {
        let mut turn = turn([360, 500, 1_084][round % 3], round % 2 == 0);
        turn.begin(round as u64);
        let obstacle = random_obstacle(&mut rng);
        let start = obstacle.motion.pose(0.0, 1_000.0);
        let view = View { turn: &turn, ego: if round % 4 == 3 { &turning } else { &still }, start_s: 0.0 };
        let rays = turn.columns().len() * turn.rings().len();
        let cast_in = |window: &Window| {
            let mut hits = vec![Hit::MISS; rays];
            cast::cast(view, &obstacle, &start, window, 0, &mut hits);
            hits
        };
        let window = cast::window(view, &obstacle, &start);
        let (found, expected) = (cast_in(&window), cast_in(&Window::whole(&turn)));
        assert!(found == expected, "round {round}: {obstacle:?} {window:?}");
        hits += found.iter().filter(|hit| hit.range_m.is_finite()).count();
        smaller += usize::from(window.columns * window.rings.len() < rays / 10);
    }
    assert!(hits > 100_000, "{hits}");
    assert!(smaller > 200, "{smaller} windows of 400 are small");
}

#[test]
fn a_ball_round_the_sensor_is_seen_everywhere_and_one_overhead_in_every_column() {
    let turn = turn(500, true);
    assert_eq!(Window::around(&turn, &Vector3::new(0.5, 0.0, 0.0), 1.0), Window::whole(&turn));
    let overhead = Window::around(&turn, &Vector3::new(0.1, 0.0, 20.0), 4.0);
    assert_eq!(overhead.columns, 500);
    assert!(overhead.rings.is_empty(), "no ring looks up more than 10.67°");
}
