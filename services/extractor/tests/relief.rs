//! What the numbers of a cluster's relief do and do not depend on.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::sphere;
use extractor::Relief;
use lidar::Return;
use messages::RELIEF;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Places of the numbers that the tests name.
const PER_RING: usize = 9;
const SLOPE: usize = 5;
const CURVATURE: usize = 6;
const BENDS: [usize; 2] = [7, 8];
const OVER_ALL: usize = 45;
const QUADRIC: [usize; 3] = [OVER_ALL + 3, OVER_ALL + 4, OVER_ALL + 5];
const RESIDUAL: usize = OVER_ALL + 6;
const RINGS: usize = OVER_ALL + 10;

fn describe(returns: &[Return]) -> [f32; RELIEF] {
    Relief::new().describe(returns)
}

/// A surface x = depth(y, z) seen by five rings, with more returns above than below.
fn surface(depth: impl Fn(f32, f32) -> f32) -> Vec<Return> {
    let mut returns = Vec::new();
    for ring in 0..5_u8 {
        for step in 0..12 + 2 * u16::from(ring % 4) {
            let (y, z) = (f32::from(step) * 0.07 - 0.5, f32::from(ring) * 0.2 - 0.4);
            returns.push(Return { x: 6.0 + depth(y, z), y, z, column: step, ring: ring + 10, intensity: 0 });
        }
    }
    returns
}

fn assert_close(one: &[f32; RELIEF], other: &[f32; RELIEF], tolerance: f32) {
    for (place, (a, b)) in one.iter().zip(other).enumerate() {
        assert!((a - b).abs() <= tolerance * (1.0 + a.abs()), "number {place}: {a} and {b}");
    }
}

fn rough(seed: u64) -> Vec<Return> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise: Vec<f32> = (0..200).map(|_| random.random::<f32>() * 0.1).collect();
    let mut returns = surface(|y, z| 0.3 * y + 0.4 * y * y - 0.2 * z * z + 0.1 * y * z);
    returns.iter_mut().zip(noise).for_each(|(r, noise)| r.x += noise);
    returns
}

// verifies EXT-021
#[test]
fn a_cluster_mirrored_left_to_right_has_the_same_numbers() {
    for seed in 0..20 {
        let returns = rough(seed);
        let mirrored: Vec<Return> = returns.iter().map(|r| Return { y: -r.y, column: 99 - r.column, ..*r }).collect();
        assert_close(&describe(&returns), &describe(&mirrored), 1e-3);
    }
}

// verifies EXT-021
#[test]
fn a_cluster_mirrored_upside_down_has_the_same_numbers() {
    for seed in 0..20 {
        let returns = rough(seed);
        let mirrored: Vec<Return> = returns.iter().map(|r| Return { z: -r.z, ring: 31 - r.ring, ..*r }).collect();
        assert_close(&describe(&returns), &describe(&mirrored), 1e-3);
    }
}

// verifies EXT-021
#[test]
fn turning_a_cluster_about_the_spin_axis_changes_nothing() {
    let returns = rough(3);
    for angle in [0.3_f32, 1.7, -2.9] {
        let (sin, cos) = angle.sin_cos();
        let turned: Vec<Return> =
            returns.iter().map(|r| Return { x: r.x * cos - r.y * sin, y: r.x * sin + r.y * cos, ..*r }).collect();
        assert_close(&describe(&returns), &describe(&turned), 1e-2);
    }
}

#[test]
fn a_plane_has_its_slope_and_no_curvature() {
    let relief = describe(&surface(|y, _| 0.5 * y));
    // Of the five rings the main one is the fourth: nothing is two beyond it.
    for along in relief[..4 * PER_RING].chunks_exact(PER_RING) {
        assert!(along[0] > 0.0 && (along[SLOPE].abs() - 0.5).abs() < 0.05, "{along:?}");
        assert!(along[CURVATURE].abs() < 0.02, "{along:?}");
        assert!(BENDS.iter().all(|&place| along[place].abs() < 1e-3), "{along:?}");
    }
    assert!(QUADRIC.iter().all(|&place| relief[place].abs() < 0.02));
    assert!(relief[RESIDUAL] < 0.01 && relief[RINGS] == 5.0);
}

#[test]
fn a_ball_is_curved_and_a_hollow_the_other_way() {
    let ball = describe(&sphere([6.0, 0.0, 0.0], 1.0, 0.72, 0.0, 1));
    assert!(ball[CURVATURE] > 0.2 && ball[QUADRIC[0]] > 0.05, "{ball:?}");
    let hollow = describe(&surface(|y, z| -0.5 * (y * y + z * z)));
    assert!(hollow[CURVATURE] < -0.2 && hollow[QUADRIC[0]] < -0.05, "{hollow:?}");
}

#[test]
fn what_is_not_defined_is_nought() {
    assert_eq!(describe(&[]), [0.0; RELIEF]);
    assert_eq!(describe(&[Return::default(); 7]), [0.0; RELIEF]);
    // One return: a count, and no width, slope or curvature; no other rings.
    let one = describe(&[Return { x: 5.0, ring: 3, ..Return::default() }]);
    assert_eq!(one[0], 1.0);
    assert!(one[1..OVER_ALL].iter().all(|&number| number == 0.0), "{one:?}");
    // Two returns have a slope and no curvature.
    let two = describe(&[Return { x: 5.0, ..Return::default() }, Return { x: 5.3, y: 0.6, ..Return::default() }]);
    assert!(two[SLOPE] != 0.0 && two[CURVATURE] == 0.0 && BENDS.iter().all(|&place| two[place] == 0.0));
    // The rings beside the only one.
    assert!(two[PER_RING..OVER_ALL].iter().all(|&number| number == 0.0));
}

#[test]
fn rings_that_no_sensor_has_and_clusters_overhead_do_no_harm() {
    let overhead: Vec<Return> = (0..9).map(|i| Return { z: 5.0 + i as f32, ring: 255, ..Return::default() }).collect();
    assert!(describe(&overhead).iter().all(|number| number.is_finite()));
}

#[test]
fn a_relief_does_not_remember_the_cluster_before_it() {
    let mut sut = Relief::new();
    let first = sut.describe(&rough(1));
    sut.describe(&rough(2)[..9]);
    assert_eq!(sut.describe(&rough(1)), first);
}
