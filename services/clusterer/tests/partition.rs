//! Every method parts every sweep as comparing all pairs does.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::f64::consts::{PI, TAU};

use clusterer::validation::brute_force_roots;
use clusterer::{Clusterer, Method};
use common::scanner::Scanner;
use common::{WHOLE, assert_exact, cloud, empty_turn, put, room};
use messages::{Clusters, Sweep, Verdict};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stage::Stage;
use zerocopy::FromZeros;

/// From less than the noise to more than the room.
const RANGES_D_M: [f32; 7] = [0.005, 0.05, 0.3, 1.0, 3.0, 8.0, 100.0];

#[track_caller]
fn exact_at_all_ranges(scanner: &Scanner) {
    let sweep = scanner.sweep();
    assert!(!sweep.returns.is_empty());
    for range_d_m in RANGES_D_M {
        assert_exact(&sweep, range_d_m);
    }
}

// verifies CLU-001, CLU-002
#[test]
fn a_room_with_obstacles_is_parted_exactly_in_either_sense() {
    for sense in [1.0, -1.0] {
        exact_at_all_ranges(&Scanner { sense, ..Scanner::default() });
    }
}

// verifies CLU-001, CLU-002
#[test]
fn obstacles_in_open_space_are_parted_exactly() {
    for (seed, sense) in [(2, 1.0), (3, -1.0)] {
        exact_at_all_ranges(&Scanner { walls_m: None, obstacles: 60, seed, sense, ..Scanner::default() });
    }
}

// verifies CLU-001, CLU-002
#[test]
fn many_columns_or_few_or_one_are_parted_exactly() {
    for (rings, columns) in [(4, 1_100), (64, 45), (32, 7), (16, 8), (16, 9), (8, 1), (1, 500), (1, 1)] {
        exact_at_all_ranges(&Scanner { rings, columns, dropout: 0.0, ..Scanner::default() });
    }
}

// verifies CLU-002
#[test]
fn azimuths_that_jump_back_and_forth_are_parted_exactly() {
    for (jitter, sense) in [(0.4, 1.0), (1.5, -1.0), (6.0, 1.0)] {
        exact_at_all_ranges(&Scanner { jitter, sense, seed: 4, ..Scanner::default() });
    }
}

// verifies CLU-002
#[test]
fn columns_that_were_not_received_hide_no_neighbour() {
    for missing in [0.1, 0.6, 0.95] {
        exact_at_all_ranges(&Scanner { missing, seed: 5, ..Scanner::default() });
    }
}

// verifies CLU-002
#[test]
fn sweeps_of_less_or_more_than_a_turn_are_parted_exactly() {
    for (turns, sense) in [(0.1, 1.0), (0.5, -1.0), (0.97, 1.0), (1.03, -1.0), (1.2, 1.0), (1.45, -1.0), (1.7, 1.0)] {
        for start_rad in [-PI, 0.5, 3.0] {
            let scanner = Scanner { turns, sense, start_rad, columns: 120, seed: 6, ..Scanner::default() };
            let sweep = scanner.sweep();
            for range_d_m in [0.3, 1.0, 8.0] {
                assert_exact(&sweep, range_d_m);
            }
        }
    }
}

// verifies CLU-002
#[test]
fn uneven_rings_and_lasers_that_look_sideways_are_parted_exactly() {
    for (sideways_rad, seed) in [(0.0, 7), (0.04, 8), (0.2, 9), (0.45, 10), (1.5, 11)] {
        exact_at_all_ranges(&Scanner { uneven: true, sideways_rad, seed, ..Scanner::default() });
    }
}

// verifies CLU-002, CLU-006
#[test]
fn returns_nearer_to_the_axis_than_d_are_parted_exactly() {
    for (dust, dust_m, walls_m) in [(0.02, 3.0, Some([9.0, 14.0, 4.0])), (0.3, 1.5, None), (0.01, 12.0, None)] {
        exact_at_all_ranges(&Scanner { dust, dust_m, walls_m, obstacles: 8, seed: 12, ..Scanner::default() });
    }
}

// verifies CLU-002
#[test]
fn returns_that_lie_about_their_ring_or_column_are_parted_exactly() {
    let mut random = ChaCha8Rng::seed_from_u64(13);
    for lies in [1, 20, 2_000] {
        let mut sweep = Scanner { walls_m: None, obstacles: 60, seed: 13, ..Scanner::default() }.sweep();
        for _ in 0..lies {
            let place = random.random_range(0..sweep.returns.len());
            sweep.returns[place].ring = random.random_range(0..16);
            sweep.returns[place].column = random.random_range(0..180);
        }
        for range_d_m in RANGES_D_M {
            assert_exact(&sweep, range_d_m);
        }
    }
}

// verifies CLU-002
#[test]
fn a_return_in_any_other_column_than_its_own_is_parted_exactly() {
    let mut sweep = empty_turn(1, 90);
    for column in 10..13 {
        put(&mut sweep, 0, column, 9.0);
    }
    for column in (0..90).filter(|&column| column != 10 && column != 11) {
        sweep.returns[2].column = column;
        assert_eq!(assert_exact(&sweep, 1.0).clusters.len(), 1, "column {column}");
    }
}

// verifies CLU-002
#[test]
fn azimuths_that_say_nothing_are_parted_exactly() {
    for (from, to) in [(0.0_f32, 0.0_f32), (-3.0, 3.0), (1e6, 2e6), (-1e30, 1e30)] {
        let mut random = ChaCha8Rng::seed_from_u64(14);
        let mut sweep = Scanner { walls_m: None, obstacles: 60, seed: 14, ..Scanner::default() }.sweep();
        for column in sweep.columns.iter_mut() {
            column.azimuth_rad = from + (to - from) * random.random::<f32>();
        }
        for range_d_m in [0.3, 1.0] {
            assert_exact(&sweep, range_d_m);
        }
    }
}

// verifies CLU-002
#[test]
fn two_echoes_of_one_firing_are_parted_exactly() {
    let mut sweep = Scanner { seed: 15, ..Scanner::default() }.sweep();
    for place in (0..sweep.returns.len()).step_by(3) {
        let mut second = sweep.returns[place];
        [second.x, second.y, second.z] = second.position().map(|value| value * 1.1);
        sweep.returns.push(second).unwrap();
        sweep.header.recorded += 1;
    }
    for range_d_m in RANGES_D_M {
        assert_exact(&sweep, range_d_m);
    }
}

// verifies CLU-001
#[test]
fn clouds_without_order_are_parted_exactly() {
    for (seed, count, lattice_m) in [(16, 2, None), (17, 500, None), (18, 3_000, None), (19, 3_000, Some(0.5))] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut coordinate = || {
            let value = random.random_range(-6.0..6.0_f32);
            lattice_m.map_or(value, |step: f32| (value / step).round() * step)
        };
        let points: Vec<_> = (0..count).map(|_| [coordinate(), coordinate(), coordinate()]).collect();
        for range_d_m in [0.005, 0.25, 0.5, 0.7, 1.0, 50.0] {
            assert_exact(&cloud(&points), range_d_m);
        }
    }
}

/// A pair of returns as near to d apart as single precision can be trusted to keep within d, whose direction differs by exactly as much as it can: the line between
/// them stands upright on the ray of the nearer one. `apart_rad` is that difference; gives (nearer, farther) ranges.
fn at_the_edge(range_d_m: f64, apart_rad: f64) -> (f64, f64) {
    let farther = range_d_m * (1.0 - 1e-6 - 6e-7 / apart_rad.sin()) / apart_rad.sin();
    (farther * apart_rad.cos(), farther)
}

/// The scan window joins two returns, given as (ring, column, range), that the oracle joins.
struct Pairs {
    sut: Clusterer,
    sweep: Box<Sweep>,
    output: Box<Clusters>,
}

impl Pairs {
    fn new(rings: usize, columns: usize) -> Self {
        let output = Clusters::new_box_zeroed().unwrap();
        Self { sut: room(Method::Scan, 1.0), sweep: empty_turn(rings, columns), output }
    }

    #[track_caller]
    fn assert_joined(&mut self, pair: [(usize, usize, f64); 2]) {
        self.sweep.returns.clear();
        self.sweep.header.recorded = 0;
        for (ring, column, range_m) in pair {
            put(&mut self.sweep, ring, column, range_m);
        }
        assert_eq!(brute_force_roots(&self.sweep, 1.0), [0, 0], "{pair:?}: the test is wrong");
        assert_eq!(self.sut.process(WHOLE, &self.sweep, &mut self.output), Verdict::Complete);
        assert_eq!(self.output.clusters.len(), 1, "{pair:?}");
    }
}

// verifies CLU-002
#[test]
fn neighbours_at_the_very_edge_of_the_window_are_found() {
    const COLUMNS: usize = 720;
    let step_rad = TAU / COLUMNS as f64;
    let mut pairs = Pairs::new(3, COLUMNS);
    pairs.sweep.rings[1].elevation_rad = 0.0;
    for first in (0..COLUMNS).step_by(3).chain(COLUMNS - 16..COLUMNS) {
        // To 78.5°, where returns become close.
        for apart in 1..158 {
            let (near, far) = at_the_edge(1.0, apart as f64 * step_rad);
            let second = (first + apart) % COLUMNS;
            pairs.assert_joined([(1, first, near), (1, second, far)]);
            pairs.assert_joined([(1, first, far), (1, second, near)]);
        }
    }
}

// verifies CLU-002
#[test]
fn neighbours_at_the_very_edge_of_the_window_in_elevation_are_found() {
    const RINGS: usize = 60;
    let mut pairs = Pairs::new(RINGS, 16);
    for first in 0..RINGS {
        for second in (0..RINGS).filter(|&second| second != first) {
            let elevation_rad = |ring: usize| f64::from(pairs.sweep.rings[ring].elevation_rad);
            let (near, far) = at_the_edge(1.0, (elevation_rad(first) - elevation_rad(second)).abs());
            pairs.assert_joined([(first, 3, near), (second, 3, far)]);
            pairs.assert_joined([(first, 3, far), (second, 3, near)]);
        }
    }
}

// verifies CLU-002
#[test]
fn neighbours_at_the_very_edge_of_the_range_are_found() {
    const COLUMNS: usize = 4_000;
    let mut pairs = Pairs::new(1, COLUMNS);
    pairs.sweep.rings[0].elevation_rad = 0.0;
    for (apart, near) in [(1, 1.1_f64), (1, 4.0), (8, 1.1), (20, 2.0), (40, 3.0)] {
        let apart_rad = apart as f64 * TAU / COLUMNS as f64;
        // Almost on one ray, a little less than d behind each other.
        let behind = (1.0 - (near * apart_rad.sin()).powi(2)).sqrt();
        let far = near * apart_rad.cos() + behind - 2e-6;
        for first in (0..COLUMNS).step_by(37).chain(COLUMNS - 45..COLUMNS) {
            let second = (first + apart) % COLUMNS;
            pairs.assert_joined([(0, first, near), (0, second, far)]);
            pairs.assert_joined([(0, first, far), (0, second, near)]);
        }
    }
}

// verifies CLU-001
#[test]
fn a_distance_of_exactly_d_joins_and_one_rounding_more_does_not() {
    let next = 2.0_f32.next_up();
    for (x, clusters) in [(1.5, 1), (next, 2), (2.0, 1), (2.0_f32.next_down(), 1)] {
        let points = [[1.0, 0.0, 0.0], [x, 0.0, 0.0]];
        assert_eq!(assert_exact(&cloud(&points), 1.0).clusters.len(), clusters, "{x}");
        let mut sweep = empty_turn(1, 4);
        for (column, point) in [(2, points[0]), (3, points[1])] {
            sweep.returns.push(lidar::Return { x: point[0], column, ..Default::default() }).unwrap();
            sweep.columns[usize::from(column)].azimuth_rad = f32::from(column) * 0.01 - 0.03;
        }
        sweep.header.recorded = 2;
        assert_eq!(assert_exact(&sweep, 1.0).clusters.len(), clusters, "{x}");
    }
    for far in [3.0_f32, 3.0_f32.next_up()] {
        let mut sweep = empty_turn(2, 8);
        put(&mut sweep, 0, 4, 2.0);
        put(&mut sweep, 0, 4, 2.0);
        sweep.returns[0] = lidar::Return { x: 2.0, column: 4, ..Default::default() };
        sweep.returns[1] = lidar::Return { x: far, column: 4, ring: 1, ..Default::default() };
        assert_eq!(assert_exact(&sweep, 1.0).clusters.len(), 1 + usize::from(far > 3.0));
    }
}
