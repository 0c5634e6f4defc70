//! The k-d tree against brute force: the same neighbours in the same order, ties and coincident points included.

mod common;

use common::{brute_neighbours, scattered};
use extractor::{MAX_OTHERS, Neighbours};

fn check(points: &[[f32; 3]], others: usize) {
    let mut tree = Neighbours::new(points.len(), others);
    tree.find(points);
    for (index, expected) in brute_neighbours(points, others).iter().enumerate() {
        assert_eq!(tree.of(index), expected, "point {index} of {}", points.len());
        for (&other, &distance) in expected.iter().zip(tree.distances_m(index)) {
            let apart: Vec<f32> = (0..3).map(|a| points[index][a] - points[other as usize][a]).collect();
            assert_eq!(distance, ((apart[0] * apart[0] + apart[1] * apart[1]) + apart[2] * apart[2]).sqrt());
        }
    }
}

// verifies EXT-003
#[test]
fn neighbours_are_those_of_brute_force_at_every_size() {
    for count in [1, 2, 4, 5, 6, 8, 9, 16, 17, 18, 50, 500, 5_000] {
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
