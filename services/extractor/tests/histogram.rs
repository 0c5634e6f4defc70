//! The cluster's histogram against Eqs. 1 to 4 in `f64` as they stand, and what it must not depend on.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{histogram_params, scattered, slow_histogram, sphere};
use extractor::{Darboux, Features, Histogram, Neighbours, Params, estimate_normals};
use lidar::Return;

fn features(neighbours: u32) -> Features {
    Features::new(&Params { neighbours, ..histogram_params() }.checked().unwrap())
}

fn dense(features: &mut Features, returns: &[Return], stride: usize) -> Vec<f64> {
    let mut weights = vec![0.0; 1_728];
    let mut last = None;
    for bin in features.describe(returns, stride).bins() {
        assert!(Some(bin.index) > last && bin.weight > 0.0);
        last = Some(bin.index);
        weights[bin.index as usize] = f64::from(bin.weight);
    }
    weights
}

fn returns(points: &[[f32; 3]]) -> Vec<Return> {
    points.iter().map(|&[x, y, z]| Return { x, y, z, ..Return::default() }).collect()
}

/// Half the sum of differences: the share of weight that lies elsewhere.
fn moved(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / 2.0
}

// verifies EXT-002
#[test]
fn the_histogram_is_that_of_the_equations() {
    for (count, neighbours) in [(5, 5), (6, 5), (9, 3), (50, 5), (50, 6), (500, 5), (1_500, 4)] {
        let points = scattered(count, count as u64, None);
        let sut = dense(&mut features(neighbours), &returns(&points), 1);
        let slow = slow_histogram(&points, neighbours as usize - 1);
        // Pairs whose angle lies within rounding of an edge may fall on its other side.
        assert!(moved(&sut, &slow) < 1e-4, "{count}: {} of the weight moved", moved(&sut, &slow));
    }
}

// verifies EXT-001
#[test]
fn the_bins_of_a_cluster_sum_to_one() {
    for seed in 0..20 {
        let points = scattered(5 + 17 * seed as usize, seed, Some(0.1));
        let sum: f64 = dense(&mut features(5), &returns(&points), 1).iter().sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}

#[test]
fn fewer_than_five_points_or_five_equal_ones_have_no_bins() {
    let mut sut = features(5);
    for count in 0..5 {
        assert_eq!(sut.describe(&returns(&scattered(count, 1, None)), 1).bins().count(), 0);
    }
    assert!(sut.describe(&returns(&scattered(5, 1, None)), 1).bins().count() > 0);
    assert_eq!(sut.describe(&returns(&[[1.0; 3]; 9]), 1).bins().count(), 0);
}

#[test]
fn a_cluster_does_not_remember_the_one_before_it() {
    let first = returns(&scattered(300, 1, None));
    let second = returns(&scattered(30, 2, None));
    let mut used = features(5);
    let _ = used.describe(&first, 1).bins().count();
    assert_eq!(dense(&mut used, &second, 1), dense(&mut features(5), &second, 1));
}

// verifies EXT-006
#[test]
fn a_flat_wall_falls_into_one_bin_from_any_side_and_at_any_range() {
    let mut sut = features(5);
    for (range, turn) in [(3.0_f32, 0.0_f32), (10.0, 0.7), (30.0, 1.9), (90.0, -2.4)] {
        let spacing = 0.0126 * range;
        let wall: Vec<[f32; 3]> = (0..144)
            .map(|i| {
                let (side, up) = ((i % 12) as f32 * spacing, (i / 12) as f32 * 1.85 * spacing);
                let (x, y) = (range + 0.4 * side, side);
                [x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos(), up - 4.0 * spacing]
            })
            .collect();
        let weights = dense(&mut sut, &returns(&wall), 1);
        assert!((weights[(6 * 12 + 6) * 12 + 6] - 1.0).abs() < 1e-6, "at {range} m");
    }
}

#[test]
fn turning_a_cluster_about_the_spin_axis_leaves_its_histogram() {
    let turned = |columns: f64| {
        let angle = (columns * 0.72).to_radians();
        let centre = [7.0 * angle.cos(), 7.0 * angle.sin(), 0.4];
        sphere(centre, 1.2, 0.72, 0.0, 1)
    };
    let mut sut = features(5);
    let here = dense(&mut sut, &turned(0.0), 1);
    for columns in [1.0, 60.0, 125.0, 333.0] {
        let there = dense(&mut sut, &turned(columns), 1);
        // Rounding moves a pair near an edge, or a return at the rim, now and then.
        assert!(moved(&here, &there) < 0.1, "{columns} columns: {}", moved(&here, &there));
    }
}

// verifies EXT-007
#[test]
fn a_stride_reads_each_phase_as_a_sweep_of_its_own() {
    let fine = sphere([6.0, 0.5, 0.2], 1.0, 0.18, 0.02, 4);
    let mut sut = features(5);
    let strided = dense(&mut sut, &fine, 4);
    // Phases weigh as their pairs do; here they are almost equally large.
    let mut mean = vec![0.0; 1_728];
    for phase in 0..4 {
        let part: Vec<Return> = fine.iter().filter(|r| r.column % 4 == phase).copied().collect();
        for (sum, weight) in mean.iter_mut().zip(dense(&mut sut, &part, 1)) {
            *sum += weight / 4.0;
        }
    }
    assert!(moved(&strided, &mean) < 0.01, "{}", moved(&strided, &mean));
    let unstrided = dense(&mut sut, &fine, 1);
    assert!(moved(&strided, &unstrided) > 0.2, "the stride must matter: {}", moved(&strided, &unstrided));
}

/// Pair after pair, without lanes: the same sums in the same order.
fn one_by_one(points: &[[f32; 3]], normals: &[[f32; 3]], neighbours: &Neighbours) -> Vec<(u32, f32)> {
    let mut share = vec![1.0_f32; points.len()];
    for index in 0..points.len() {
        let others = neighbours.of(index);
        for (&other, &distance_m) in others.iter().zip(neighbours.distances_m(index)) {
            share[other as usize] += 1.0 / (distance_m.max(1e-3) * others.len() as f32);
        }
    }
    let (mut weights, mut total) = (vec![0.0_f64; 1_728], 0.0);
    for index in 0..points.len() {
        for (&other, &distance_m) in neighbours.of(index).iter().zip(neighbours.distances_m(index)) {
            let other = other as usize;
            let offset = std::array::from_fn(|axis| points[other][axis] - points[index][axis]);
            if let Some(pair) = Darboux::between(normals[index], normals[other], offset, distance_m) {
                weights[pair.bin()] += f64::from(share[index]);
                total += f64::from(share[index]);
            }
        }
    }
    let scale = 1.0 / total;
    let held = weights.iter().zip(0..).filter(|(weight, _)| **weight > 0.0);
    held.map(|(weight, bin)| (bin, (weight * scale) as f32)).collect()
}

#[test]
fn pairs_side_by_side_give_the_bits_of_pairs_one_by_one() {
    let line = |count: usize| (0..count).map(|i| [5.0, i as f32 * 0.01, 1.0]).collect::<Vec<_>>();
    let ring: Vec<[f32; 3]> = (0..200)
        .map(|i| (i as f32 * 0.0126, 6.0 + (i % 7) as f32 * 0.01))
        .map(|(angle, range)| [range * angle.cos(), range * angle.sin(), 0.7])
        .collect();
    let mut clusters = vec![vec![[1.0, 2.0, 3.0]; 40], line(5), line(300), ring, scattered(50_000, 8, None)];
    clusters.extend([5, 6, 15, 16, 17, 33, 500].map(|count| scattered(count, count as u64, None)));
    clusters.push(scattered(700, 2, Some(0.25)));
    for points in clusters {
        for others in [2, 4, 5] {
            let (mut neighbours, mut normals) = (Neighbours::new(points.len(), others), vec![[0.0; 3]; points.len()]);
            neighbours.find(&points);
            estimate_normals(&points, &neighbours, &mut normals);
            let mut sut = Histogram::new(points.len());
            sut.add(&points, &normals, &neighbours);
            let found: Vec<(u32, f32)> = sut.bins().map(|bin| (bin.index, bin.weight)).collect();
            assert_eq!(found, one_by_one(&points, &normals, &neighbours), "{} points", points.len());
        }
    }
}
