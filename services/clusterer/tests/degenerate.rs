//! The smallest, the largest and the strangest of sweeps.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::f64::consts::PI;

use common::scanner::Scanner;
use common::{assert_exact, cloud, empty_turn, put};

// verifies CLU-004
#[test]
fn no_return_is_no_cluster() {
    for sweep in [cloud(&[]), empty_turn(4, 9), empty_turn(0, 0), empty_turn(0, 5), empty_turn(5, 0)] {
        let clusters = assert_exact(&sweep, 1.0);
        assert!(clusters.clusters.is_empty() && clusters.cells.is_empty());
    }
}

// verifies CLU-004
#[test]
fn one_return_is_one_cluster_wherever_it_is() {
    for range_m in [0.0, 1e-30, 0.5, 1.0, 1.01, 1.02, 1.03, 2.03, 70.0, 1e5, 1e7, 1e18, 1e30] {
        let mut sweep = empty_turn(3, 12);
        put(&mut sweep, 2, 7, range_m);
        assert_eq!(assert_exact(&sweep, 1.0).clusters.len(), 1);
        let position = sweep.returns[0].position();
        assert_eq!(assert_exact(&cloud(&[position]), 1.0).clusters.len(), 1);
    }
}

// verifies CLU-004
#[test]
fn equal_returns_are_one_cluster() {
    for point in [[0.0; 3], [0.3, 0.0, -0.2], [5.0, -7.0, 1.0], [1e20, 1e20, 0.0]] {
        let points = vec![point; 700];
        assert_eq!(assert_exact(&cloud(&points), 0.001).clusters.len(), 1);
        let mut sweep = empty_turn(10, 70);
        for place in 0..700 {
            let (column, ring) = (place / 10, (place % 10) as u8);
            let [x, y, z] = point;
            sweep.returns.push(lidar::Return { x, y, z, column, ring, intensity: 0 }).unwrap();
        }
        sweep.header.recorded = 700;
        assert_eq!(assert_exact(&sweep, 0.001).clusters.len(), 1);
    }
}

// verifies CLU-004
#[test]
fn one_giant_cluster_holds_every_return_in_order() {
    let sweep = Scanner { columns: 250, ..Scanner::default() }.sweep();
    let clusters = assert_exact(&sweep, 4.0);
    assert_eq!(clusters.clusters.len(), 1);
    assert!(clusters.members.iter().copied().eq(0..sweep.returns.len() as u32));
}

// verifies CLU-004
#[test]
fn returns_far_from_each_other_are_each_a_cluster() {
    let mut sweep = empty_turn(8, 200);
    for column in 0..200 {
        for ring in 0..8 {
            put(&mut sweep, ring, column, 20.0 + 9.0 * ((column * 8 + ring) % 11) as f64);
        }
    }
    let clusters = assert_exact(&sweep, 0.3);
    assert_eq!(clusters.clusters.len(), 1_600);
    assert!(clusters.clusters.iter().all(|cluster| cluster.summary.points == 1 && cluster.cells == 0));
}

// verifies CLU-003
#[test]
fn a_cluster_across_the_seam_stays_whole() {
    for sense in [1.0, -1.0] {
        for shift in 0..30 {
            let start_rad = -PI + f64::from(shift) * 0.21;
            // A ball of 4 m at 10 m on the x axis: the seam passes through it or by it.
            let mut sweep = Scanner { walls_m: None, obstacles: 0, sense, start_rad, ..Scanner::default() }.sweep();
            for column in 0..sweep.columns.len() {
                let azimuth = f64::from(sweep.columns[column].azimuth_rad);
                for ring in 0..16 {
                    if azimuth.abs() < 0.4 {
                        put(&mut sweep, ring, column, 10.0 - 4.0 * (azimuth * 3.0).cos());
                    }
                }
            }
            let clusters = assert_exact(&sweep, 1.2);
            assert_eq!(clusters.clusters.len(), 1, "seam at {start_rad} rad");
        }
    }
}

// verifies CLU-003
#[test]
fn only_clusters_whose_window_reaches_an_end_are_marked() {
    // d/h = 1/4 is 0.253 rad, that is 40.2 columns of 1000; and one for the head's turn.
    for (column, seam) in [(0, 1), (41, 1), (42, 0), (500, 0), (957, 0), (958, 1), (999, 1)] {
        let mut sweep = empty_turn(1, 1_000);
        sweep.rings[0].elevation_rad = 0.0;
        put(&mut sweep, 0, column, 4.0);
        let clusters = assert_exact(&sweep, 1.0);
        assert_eq!(clusters.clusters[0].summary.seam, seam, "column {column}");
    }
}
