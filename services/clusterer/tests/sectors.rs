//! A sweep in sectors: the same clusters as whole, each as early as can be.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::f64::consts::{PI, TAU};

use clusterer::Method;
use clusterer::validation::brute_force_roots;
use common::scanner::Scanner;
use common::sectors::{Sender, assert_same_in_sectors};
use common::{any, empty_turn, put, room};
use messages::{Cutter, Refusal, Sweep, Verdict};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Numbers of sectors, and one a column.
fn numbers(sweep: &Sweep) -> Vec<u32> {
    let columns = sweep.columns.len() as u32;
    [1, 2, 4, 7, 36, 90, columns].into_iter().filter(|&sectors| (1..=columns).contains(&sectors)).collect()
}

/// Refuses every seventh recorded return, so that places and indices differ.
fn refuse_some(sweep: &mut Sweep) {
    let count = sweep.returns.len() as u32;
    for place in 0..count {
        sweep.recorded_index.push(place + place / 6 + 1).unwrap();
    }
    sweep.header.recorded = count + count / 6 + 2;
    sweep.header.refused[Refusal::TooNear as usize] = count / 6 + 2;
}

/// The clusters of a sweep in sectors are the oracle's.
#[track_caller]
fn assert_exact_in_sectors(sender: &mut Sender, sweep: &mut Sweep, range_d_m: f32, numbers: &[u32]) -> usize {
    let early = assert_same_in_sectors(sender, sweep, numbers);
    let roots = brute_force_roots(sweep, range_d_m);
    let most = *numbers.last().unwrap();
    for closed in sender.send_all(sweep, most) {
        let place = |index: &u32| (0..sweep.returns.len()).find(|&place| sweep.index_of(place) >= *index).unwrap();
        let places: Vec<usize> = closed.members.iter().map(place).collect();
        assert!(places.iter().all(|&member| roots[member] as usize == places[0]));
        assert_eq!(places.len(), roots.iter().filter(|&&root| root as usize == places[0]).count());
    }
    early
}

// verifies CLU-013
#[test]
fn rooms_and_open_space_are_the_same_in_any_number_of_sectors() {
    let plain = Scanner { rings: 16, columns: 360, ..Scanner::default() };
    let open = Scanner { walls_m: None, obstacles: 60, ..plain.clone() };
    let scanners = [
        Scanner { sense: -1.0, ..plain.clone() },
        Scanner { dust: 0.02, dust_m: 2.0, ..open.clone() },
        Scanner { missing: 0.2, sideways_rad: 0.05, sense: -1.0, ..open.clone() },
        Scanner { turns: 0.6, start_rad: 1.0, ..open.clone() },
        Scanner { turns: 0.98, turning: false, ..open.clone() },
        Scanner { rings: 64, columns: 90, seed: 3, ..open.clone() },
        Scanner { rings: 4, columns: 2_000, obstacles: 90, seed: 4, ..open.clone() },
        plain,
        open,
    ];
    for (number, scanner) in scanners.iter().enumerate() {
        for range_d_m in [0.05, 0.3, 1.0, 3.0] {
            let mut sweep = scanner.sweep();
            if number % 2 == 0 {
                refuse_some(&mut sweep);
            }
            let numbers = numbers(&sweep);
            let early = assert_same_in_sectors(&mut Sender::new(room(Method::Auto, range_d_m)), &mut sweep, &numbers);
            assert!(sweep.header.stray_rad > 0.0, "{scanner:?} is cut");
            assert!(early > 0 || range_d_m > 0.3, "{scanner:?} at {range_d_m}: nothing went out early");
        }
    }
}

// verifies CLU-013
#[test]
fn sweeps_that_may_not_be_cut_and_those_for_the_tree_go_out_with_their_last_sector() {
    let mut dual = Scanner::default().sweep();
    let again = *dual.returns.last().unwrap();
    dual.returns.push(again).unwrap();
    dual.header.recorded += 1;
    let sweeps = [
        dual,
        Scanner { jitter: 3.0, ..Scanner::default() }.sweep(),
        Scanner { turns: 1.3, ..Scanner::default() }.sweep(),
        common::cloud(&[[1.0, 2.0, 3.0], [1.0, 2.0, 3.5], [9.0, 2.0, 3.5]]),
    ];
    for mut sweep in sweeps {
        for method in common::METHODS {
            sweep.header.stray_rad = 0.0;
            let mut sender = Sender::new(room(method, 0.5));
            assert_eq!(assert_same_in_sectors(&mut sender, &mut sweep, &[1, 4, 36]), 0);
            assert_eq!(sweep.header.stray_rad, 0.0);
        }
    }
    let mut sweep = Scanner { walls_m: None, ..Scanner::default() }.sweep();
    assert_eq!(assert_same_in_sectors(&mut Sender::new(room(Method::Kdtree, 0.5)), &mut sweep, &[1, 4, 36]), 0);
    assert!(sweep.header.stray_rad > 0.0);
}

/// Sector of one column each with which a sweep's only cluster goes out.
fn out_with(sweep: &mut Sweep, range_d_m: f32) -> usize {
    let sectors = sweep.columns.len() as u32;
    Cutter::new(sectors).measure(sweep);
    let closed = Sender::new(room(Method::Auto, range_d_m)).send_all(sweep, sectors);
    assert_eq!(closed.len(), 1);
    closed[0].sector as usize
}

// verifies CLU-014
#[test]
fn an_obstacle_at_a_quarter_of_the_turn_is_out_before_half_of_it() {
    const COLUMNS: usize = 2_000;
    // At 10 m and d = 1 the window is 0.1002 rad: 31.9 columns.
    for (range_m, range_d_m, window) in [(10.0, 1.0, 32), (2.0, 1.0, 167), (30.0, 1.0, 11), (10.0, 0.05, 2)] {
        for first in 500..517 {
            let mut sweep = empty_turn(16, COLUMNS);
            for column in first..first + 20 {
                put(&mut sweep, 8, column, range_m);
            }
            let out = out_with(&mut sweep, range_d_m);
            let after = out - (first + 19);
            // Two more columns for rounding and the last one, and what a block of 16 may still lack.
            assert!((window.max(4)..window + 4 + 16).contains(&after), "{after} columns later at {range_m} m");
            assert!(out < COLUMNS / 2);
        }
    }
}

// verifies CLU-014
#[test]
fn what_is_at_the_seam_or_round_the_axis_goes_out_with_the_sweep() {
    for (column, range_m) in [(0, 10.0), (4, 50.0), (20, 10.0), (1_999, 10.0), (1_000, 0.9), (1_000, 1.01)] {
        let mut sweep = empty_turn(16, 2_000);
        put(&mut sweep, 8, column, range_m);
        assert_eq!(out_with(&mut sweep, 1.0), 1_999, "column {column} at {range_m} m");
    }
}

/// A return in some column, and one as far from it as the window reaches, d away.
fn edge(columns: usize, first: usize, apart: usize, swap: bool) -> Box<Sweep> {
    let apart_rad = TAU / columns as f64 * apart as f64;
    let far = (1.0 - 1e-6 - 6e-7 / apart_rad.sin()) / apart_rad.sin();
    let near = far * apart_rad.cos();
    let mut sweep = empty_turn(1, columns);
    sweep.rings[0].elevation_rad = 0.0;
    let (a, b) = if swap { (near, far) } else { (far, near) };
    let mut pair = [(first, a), ((first + apart) % columns, b)];
    pair.sort_by_key(|&(column, _)| column);
    for (column, range_m) in pair {
        put(&mut sweep, 0, column, range_m);
    }
    sweep
}

// verifies CLU-013
#[test]
fn a_neighbour_at_the_very_edge_of_the_window_is_waited_for() {
    const COLUMNS: usize = 720;
    let mut sender = Sender::new(room(Method::Auto, 1.0));
    for apart in 1..157 {
        for first in [100, 175, 176, 191, 192, 300] {
            for swap in [false, true] {
                let mut sweep = edge(COLUMNS, first, apart, swap);
                Cutter::new(COLUMNS as u32).measure(&mut sweep);
                let closed = sender.send_all(&sweep, COLUMNS as u32);
                assert_eq!(closed.len(), 1, "{apart} columns apart from {first}");
            }
        }
    }
}

// verifies CLU-013
#[test]
fn what_a_header_says_of_the_step_does_not_part_neighbours() {
    const COLUMNS: usize = 720;
    let mut sender = Sender::new(room(Method::Auto, 1.0));
    for factor in [10.0, 0.1] {
        for apart in [2, 10, 33, 60, 120, 150] {
            for first in [100, 191, 300, COLUMNS - 1, COLUMNS - apart / 2, COLUMNS - apart + 1] {
                for swap in [false, true] {
                    let mut sweep = edge(COLUMNS, first, apart, swap);
                    sweep.header.column_step_rad *= factor;
                    assert_same_in_sectors(&mut sender, &mut sweep, &[COLUMNS as u32]);
                    let closed = sender.send_all(&sweep, COLUMNS as u32);
                    assert_eq!(closed.len(), 1, "{apart} columns apart from {first}, step times {factor}");
                }
            }
        }
    }
}

// verifies CLU-013
#[test]
fn a_last_sector_without_columns_changes_nothing() {
    const SECTORS: u32 = 10;
    let mut sender = Sender::new(room(Method::Auto, 0.1));
    for column in 130..160 {
        let mut sweep = empty_turn(1, 160);
        put(&mut sweep, 0, column, 50.0);
        Cutter::new(SECTORS).measure(&mut sweep);
        let whole = sender.send_all(&sweep, 1);
        let mut closed = Vec::new();
        for sector in 0..=SECTORS {
            sender.cut(&sweep, SECTORS, sector.min(SECTORS - 1));
            if sector >= SECTORS - 1 {
                sender.piece.header.complete = u32::from(sector == SECTORS);
            }
            if sector == SECTORS {
                (sender.piece.first_column, sender.piece.first_return, sender.piece.header.recorded) = (160, 1, 0);
                sender.piece.columns.clear();
                sender.piece.returns.clear();
            }
            assert_eq!(sender.send(SECTORS + 1, sector), Verdict::Complete);
            sender.closed(sector, &mut closed);
        }
        assert_eq!(closed.len(), 1);
        assert!(closed[0].bytes() == whole[0].bytes(), "column {column}: {:?}", closed[0].cluster);
    }
}

// verifies CLU-013
#[test]
fn a_neighbour_that_strays_as_far_as_promised_is_waited_for() {
    const COLUMNS: usize = 720;
    let mut sender = Sender::new(room(Method::Auto, 1.0));
    for stray_columns in [1, 5, 11] {
        for apart in [10, 40, 120] {
            let mut sweep = edge(COLUMNS, 200, apart, false);
            // Both lasers look sideways: the first return comes early and the second late.
            sweep.returns[0].column -= stray_columns;
            sweep.returns[1].column += stray_columns;
            Cutter::new(COLUMNS as u32).measure(&mut sweep);
            assert!(sweep.header.stray_rad > 0.0);
            assert_eq!(sender.send_all(&sweep, COLUMNS as u32).len(), 1, "{apart} apart, stray {stray_columns}");
        }
    }
}

// verifies CLU-013
#[test]
fn the_seam_flag_is_that_of_the_whole_sweep_for_every_window_and_column() {
    let mut sender = Sender::new(room(Method::Auto, 1.0));
    for columns in [90_usize, 200, 500] {
        for range_m in [1.1, 1.5, 3.0, 7.0, 20.0, 60.0] {
            for column in (0..columns).step_by(3).chain(columns - 40..columns) {
                let mut sweep = empty_turn(1, columns);
                sweep.rings[0].elevation_rad = 0.0;
                put(&mut sweep, 0, column, range_m);
                assert_same_in_sectors(&mut sender, &mut sweep, &[columns as u32]);
            }
        }
    }
}

/// Scanners whose sweeps may be cut, but for those that turn out otherwise.
fn scanner() -> impl Strategy<Value = Scanner> {
    any::scanner(any::Bounds {
        columns: 20..300,
        most_turns: 1.0,
        most_jitter: 0.45,
        most_missing: 0.9,
        most_sideways_rad: 0.09,
        most_obstacles: 40,
    })
}

proptest! {
    #![proptest_config(any::config(300))]

    // verifies CLU-001, CLU-013
    #[test]
    fn any_sweep_is_the_same_in_any_number_of_sectors(
        scanner in scanner(),
        refused in any::<bool>(),
        range_d_m in prop_oneof![0.01_f32..0.3, 0.3_f32..4.0],
    ) {
        let mut sweep = scanner.sweep();
        if refused {
            refuse_some(&mut sweep);
        }
        let numbers = numbers(&sweep);
        let mut sender = Sender::new(room(Method::Auto, range_d_m));
        if sweep.returns.len() < 1_500 {
            assert_exact_in_sectors(&mut sender, &mut sweep, range_d_m, &numbers);
        } else {
            assert_same_in_sectors(&mut sender, &mut sweep, &numbers);
        }
    }
}

// verifies CLU-013
#[test]
fn few_returns_about_the_length_of_d_are_the_same_in_any_number_of_sectors() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut early = 0;
    for _ in 0..300 {
        let columns = random.random_range(40..400);
        let mut sweep = empty_turn(8, columns);
        let shift = random.random_range(-PI..PI);
        for column in sweep.columns.iter_mut() {
            column.azimuth_rad = ((f64::from(column.azimuth_rad) + shift + PI).rem_euclid(TAU) - PI) as f32;
        }
        for column in 0..columns {
            for ring in 0..8 {
                if random.random_bool(0.02) {
                    let range_m = random.random_range(0.9..6.0);
                    put(&mut sweep, ring, column, range_m);
                }
            }
        }
        let range_d_m = random.random_range(0.3..1.4);
        let numbers = numbers(&sweep);
        early +=
            assert_exact_in_sectors(&mut Sender::new(room(Method::Auto, range_d_m)), &mut sweep, range_d_m, &numbers);
    }
    assert!(early > 300, "only {early} clusters went out early");
}
