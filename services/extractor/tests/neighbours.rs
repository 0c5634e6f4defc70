//! Blocks and k-d tree against brute force: the same neighbours in the same order, ties and coincident points included.

mod common;

use common::{brute_neighbours, scattered, sphere};
use extractor::{MAX_OTHERS, Neighbours};
use lidar::Return;

/// However they are found: in no order, and by rings, true ones or not.
fn check(points: &[[f32; 3]], others: usize) {
    let mut sut = Neighbours::new(points.len(), others);
    let expected = brute_neighbours(points, others);
    sut.find(points);
    assert_found(&sut, points, &expected);
    for rings in [1, 7, 32, 256] {
        let rings: Vec<u8> = (0..points.len()).map(|i| (i * rings / points.len().max(1) * 37 % 256) as u8).collect();
        sut.find_in_rings(points, &rings);
        assert_found(&sut, points, &expected);
    }
}

fn assert_found(sut: &Neighbours, points: &[[f32; 3]], expected: &[Vec<u32>]) {
    for (index, expected) in expected.iter().enumerate() {
        assert_eq!(sut.of(index), expected, "point {index} of {}", points.len());
        for (&other, &distance) in expected.iter().zip(sut.distances_m(index)) {
            let apart: Vec<f32> = (0..3).map(|a| points[index][a] - points[other as usize][a]).collect();
            assert_eq!(distance, ((apart[0] * apart[0] + apart[1] * apart[1]) + apart[2] * apart[2]).sqrt());
        }
    }
}

// verifies EXT-003
#[test]
fn neighbours_are_those_of_brute_force_at_every_size() {
    for count in [1, 2, 4, 5, 6, 8, 9, 15, 16, 17, 32, 33, 48, 49, 64, 65, 127, 128, 129, 257, 500, 4_200] {
        check(&scattered(count, count as u64, None), 4);
    }
}

#[test]
fn equal_distances_go_to_the_smaller_index() {
    for count in [6, 50, 500, 2_000] {
        for others in 1..=MAX_OTHERS {
            check(&scattered(count, 3, Some(0.25)), others);
        }
    }
}

#[test]
fn coincident_points_are_neighbours_of_each_other() {
    check(&[[1.0, 2.0, 3.0]; 40], 4);
    check(&[[1.0, 2.0, 3.0]; 300], 5);
}

#[test]
fn points_on_a_line_and_of_very_uneven_density_are_served() {
    let line: Vec<[f32; 3]> = (0..300).map(|i| [5.0, i as f32 * 0.01, 0.0]).collect();
    check(&line, 4);
    let uneven: Vec<[f32; 3]> = scattered(600, 9, None).iter().map(|p| p.map(|c| c * c * c * c)).collect();
    check(&uneven, 5);
}

#[test]
fn no_points_have_no_neighbours() {
    let mut tree = Neighbours::new(3, 4);
    tree.find(&[]);
    tree.find(&[[1.0; 3]]);
    assert!(tree.of(0).is_empty());
}

#[test]
fn a_smaller_cluster_after_a_larger_one_sees_nothing_of_it() {
    let mut tree = Neighbours::new(500, 4);
    tree.find(&scattered(500, 1, None));
    let points = scattered(3, 2, None);
    tree.find(&points);
    for (index, expected) in brute_neighbours(&points, 4).iter().enumerate() {
        assert_eq!(tree.of(index), expected);
    }
}

#[test]
fn a_sphere_seen_in_rings_is_served_by_its_rings() {
    for step_deg in [0.18, 0.72] {
        let returns = sphere([5.0, 0.4, -0.2], 1.4, step_deg, 0.02, 3);
        let points: Vec<[f32; 3]> = returns.iter().map(Return::position).collect();
        let rings: Vec<u8> = returns.iter().map(|r| r.ring).collect();
        let mut sut = Neighbours::new(points.len(), 4);
        sut.find_in_rings(&points, &rings);
        assert_found(&sut, &points, &brute_neighbours(&points, 4));
    }
}

#[test]
fn fifty_thousand_points_have_the_same_neighbours_by_blocks_and_by_tree() {
    // A wall of 50 rings, rough, in firing order.
    let rough = scattered(50_000, 4, None);
    let points: Vec<[f32; 3]> = rough
        .iter()
        .enumerate()
        .map(|(i, p)| [p[0] * 0.1, (i / 50) as f32 * 0.013 + p[1] * 0.002, (i % 50) as f32 * 0.023])
        .collect();
    let rings: Vec<u8> = (0..50_000).map(|i| (i % 50) as u8).collect();
    let (mut blocks, mut tree) = (Neighbours::new(50_000, 4), Neighbours::new(50_000, 4));
    blocks.find_in_rings(&points, &rings);
    tree.find(&points);
    for index in 0..50_000 {
        assert_eq!(blocks.of(index), tree.of(index), "point {index}");
        assert_eq!(blocks.distances_m(index), tree.distances_m(index));
    }
}

#[test]
fn rings_that_are_not_as_many_as_the_points_are_not_used() {
    let points = scattered(300, 6, None);
    let mut sut = Neighbours::new(300, 4);
    sut.find_in_rings(&points, &[1; 299]);
    assert_found(&sut, &points, &brute_neighbours(&points, 4));
}
