//! The cells round each cluster are those of their definition.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use clusterer::validation::roots_of;
use clusterer::{Clusterer, Method, Params};
use common::scanner::Scanner;
use common::twins::assert_cells;
use common::{assert_exact, cloud, empty_turn, process, put, room};
use lidar::MAX_RETURNS;
use messages::{CellKind, MAX_CELLS, Verdict};
use stage::Stage;

// verifies CLU-007
#[test]
fn every_kind_of_cell_agrees_with_its_definition() {
    for (seed, sense, turns) in [(1, 1.0, 1.0), (2, -1.0, 1.0), (3, 1.0, 0.7), (4, -1.0, 1.1)] {
        let scanner = Scanner {
            rings: 24,
            columns: 90,
            dropout: 0.15,
            missing: 0.1,
            dust: 0.03,
            walls_m: None,
            obstacles: 50,
            seed,
            sense,
            turns,
            ..Scanner::default()
        };
        let sweep = scanner.sweep();
        let clusters = assert_exact(&sweep, 0.7);
        assert!(assert_cells(&sweep, &clusters, 5) > 100);
        for kind in [CellKind::Unknown, CellKind::Miss, CellKind::Nearer, CellKind::Farther] {
            assert!(clusters.cells.iter().any(|cell| cell.kind == kind), "no {kind:?}");
        }
    }
}

// verifies CLU-007
#[test]
fn cells_of_many_rings_and_of_few_columns_agree_with_their_definition() {
    for (rings, columns) in [(64, 30), (64, 1), (5, 2), (5, 3), (5, 4), (5, 5), (1, 64), (3, 62), (3, 126)] {
        for turns in [1.0, 0.5] {
            let scanner = Scanner { rings, columns, dropout: 0.4, turns, obstacles: 10, ..Scanner::default() };
            let sweep = scanner.sweep();
            let clusters = assert_exact(&sweep, 2.0);
            assert_cells(&sweep, &clusters, 5);
        }
    }
}

// verifies CLU-007
#[test]
fn the_nearest_of_two_echoes_is_the_cells() {
    let mut sweep = Scanner { walls_m: None, obstacles: 50, rings: 24, ..Scanner::default() }.sweep();
    for place in (0..sweep.returns.len()).step_by(2) {
        let mut second = sweep.returns[place];
        let factor = if place % 4 == 0 { 0.8 } else { 1.3 };
        [second.x, second.y, second.z] = second.position().map(|value| value * factor);
        sweep.returns.push(second).unwrap();
        sweep.header.recorded += 1;
    }
    let clusters = assert_exact(&sweep, 0.5);
    assert!(assert_cells(&sweep, &clusters, 5) > 100);
}

// verifies CLU-007
#[test]
fn cells_of_a_complete_turn_lie_beyond_the_seam_and_those_of_a_part_beyond_its_ends() {
    for (complete, columns) in [(1, vec![0, 1, 2, 18, 19]), (0, vec![0, 1, 2, 65_534, 65_535])] {
        let mut sweep = empty_turn(5, 20);
        sweep.header.complete = complete;
        for ring in 0..5 {
            put(&mut sweep, ring, 0, 5.0);
        }
        let clusters = assert_exact(&sweep, 1.0);
        let mut found: Vec<u16> = clusters.cells.iter().map(|cell| cell.column).collect();
        let first = found[0];
        found.sort();
        found.dedup();
        assert_eq!(found, columns[1..]);
        assert_eq!(first, if complete == 1 { 1 } else { 65_534 });
        let beyond = clusters.cells.iter().filter(|cell| cell.column > 2);
        let kind = if complete == 1 { CellKind::Miss } else { CellKind::Unknown };
        assert!(beyond.clone().count() == 10 && beyond.clone().all(|cell| cell.kind == kind));
    }
}

// verifies CLU-007
#[test]
fn clusters_under_the_minimum_of_points_and_clouds_have_no_cells() {
    let sweep = Scanner { walls_m: None, obstacles: 50, ..Scanner::default() }.sweep();
    for min_points in [1, 2, 40, MAX_RETURNS as u32] {
        let mut sut = Clusterer::init(Params { range_d_m: 1.0, method: Method::Auto, min_points }).unwrap();
        let (_, clusters) = process(&mut sut, &sweep);
        let cells = assert_cells(&sweep, &clusters, min_points);
        assert_eq!(cells == 0, min_points == MAX_RETURNS as u32);
    }
    assert!(assert_exact(&cloud(&[[1.0, 1.0, 1.0]; 9]), 1.0).cells.is_empty());
}

// verifies CLU-008
#[test]
fn clusters_whose_cells_no_longer_fit_have_none() {
    // Each return alone in a 5 × 5 square of its own: 24 cells a return.
    let mut sweep = empty_turn(64, 2_304);
    for column in (2..2_302).step_by(2) {
        for ring in (2..62).step_by(3) {
            put(&mut sweep, ring, column, 50.0);
        }
    }
    let mut sut = Clusterer::init(Params { range_d_m: 0.001, method: Method::Auto, min_points: 1 }).unwrap();
    let (verdict, clusters) = process(&mut sut, &sweep);
    assert_eq!(verdict, Verdict::PartialCells);
    roots_of(&sweep, &clusters).unwrap();
    assert_eq!(clusters.cells.len(), MAX_CELLS / 24 * 24);
    let with = clusters.clusters.iter().filter(|cluster| cluster.cells != 0).count();
    assert_eq!(with, MAX_CELLS / 24);
    assert!(clusters.clusters[..with].iter().all(|cluster| cluster.cells == 24));
    // And the room forgets it.
    let next = Scanner::default().sweep();
    assert_eq!(process(&mut sut, &next).0, Verdict::Complete);
    let (_, after) = process(&mut sut, &next);
    let mut fresh = Clusterer::init(Params { range_d_m: 0.001, method: Method::Auto, min_points: 1 }).unwrap();
    common::twins::assert_same(&after, &process(&mut fresh, &next).1);
    assert_eq!(process(&mut room(Method::Auto, 1.0), &sweep).0, Verdict::Complete);
}
