use messages::ClusterSummary;
use zerocopy::FromZeros;

use super::*;

const COLUMNS: u16 = 500;

/// A message of one cluster with these returns (column, ring) 5 m ahead, and these cells.
fn message(members: &[(u16, u8)], cells: &[Cell]) -> Box<Clusters> {
    let mut message = Clusters::new_box_zeroed().unwrap();
    message.header.reach_m = 100.0;
    message.turn_columns = u64::from(COLUMNS);
    message
        .ring_elevation_rad
        .extend_from_slice(&std::array::from_fn::<f32, 32, _>(|ring| ring as f32 * 0.02))
        .unwrap();
    for &(column, ring) in members {
        let one = Return { x: 5.0, y: 1.0, z: 2.0, column, ring, intensity: 0 };
        message.returns.push(one).unwrap();
    }
    message.cells.extend_from_slice(cells).unwrap();
    let summary = ClusterSummary { points: members.len() as u32, ..ClusterSummary::default() };
    message.clusters.push(Cluster { summary, first_cell: 0, cells: cells.len() as u32 }).unwrap();
    message
}

fn take(message: &Clusters) -> Bundle {
    let mut bundle = Bundle::new(100, 100);
    bundle.take(message, &message.clusters[0], &message.returns);
    assert!(bundle.members.iter().all(|&rings| rings == 0), "left clean");
    bundle
}

fn cell(column: u16, ring: u8, kind: CellKind) -> Cell {
    Cell { column, ring, kind, azimuth_rad: 0.5, range_m: if kind == CellKind::Farther { 30.0 } else { 0.0 } }
}

/// Whether an empty cell among these members is taken for a miss.
fn is_miss(column: u16, ring: u8, members: &[(u16, u8)]) -> bool {
    let misses = take(&message(members, &[cell(column, ring, CellKind::Miss)])).misses.len();
    assert!(misses <= 1);
    misses == 1
}

#[test]
fn each_kind_of_cell_tells_what_it_saw() {
    use CellKind::{Farther, Miss, Nearer, Unknown};
    let cells = [Unknown, Miss, Nearer, Farther, Nearer, Farther].map(|kind| cell(40, 3, kind));
    let bundle = take(&message(&[(50, 5)], &cells));
    assert_eq!(bundle.nearer, 2);
    let ranges: Vec<f64> = bundle.misses.iter().map(|ray| ray.range_m).collect();
    assert_eq!(ranges, [100.0, 30.0, 30.0]);
    let ((sin_az, cos_az), (sin_el, cos_el)) = (0.5_f64.sin_cos(), f64::from(0.06_f32).sin_cos());
    for ray in &bundle.misses {
        assert_eq!(ray.direction, Vector3::new(cos_el * cos_az, cos_el * sin_az, sin_el));
    }
}

#[test]
fn returns_become_hits_and_those_at_the_sensor_are_left_out() {
    let mut message = message(&[(1, 1), (2, 2), (3, 3)], &[]);
    message.returns[1] = Return::default();
    let bundle = take(&message);
    assert_eq!(bundle.hits.len(), 2);
    assert!((bundle.hits[0].range_m - 30.0_f64.sqrt()).abs() < 1e-12);
    assert!((bundle.hits[0].end_m() - Vector3::new(5.0, 1.0, 2.0)).norm() < 1e-12);
}

// verifies EXT-019
#[test]
fn an_empty_cell_among_five_of_eight_neighbours_is_a_lost_echo() {
    let around: [(u16, u8); 8] = [(9, 4), (10, 4), (11, 4), (9, 5), (11, 5), (9, 6), (10, 6), (11, 6)];
    // Each of the 256 sets of neighbours.
    for set in 0..256_u32 {
        let members: Vec<(u16, u8)> = (0..8).filter(|place| set >> place & 1 == 1).map(|place| around[place]).collect();
        assert_eq!(is_miss(10, 5, &members), members.len() < 5, "{set:08b}");
    }
    // Those two away do not count, nor does a second return of the same cell.
    assert!(is_miss(10, 5, &[(8, 5), (12, 5), (10, 3), (10, 7), (9, 5)]));
    assert!(is_miss(10, 5, &[(9, 5), (9, 5), (9, 5), (9, 5), (9, 5)]));
    // Something farther was seen, whatever is round it.
    assert_eq!(take(&message(&around, &[cell(10, 5, CellKind::Farther)])).misses.len(), 1);
}

// verifies EXT-019
#[test]
fn neighbours_are_counted_across_the_seam_of_a_complete_turn_and_not_of_another() {
    let last = COLUMNS - 1;
    let at_start = [(last, 4), (last, 5), (last, 6), (0, 4), (0, 6)];
    let at_end = [(0, 4), (0, 5), (0, 6), (last, 4), (last, 6)];
    assert!(!is_miss(0, 5, &at_start));
    assert!(!is_miss(last, 5, &at_end));
    for (column, members) in [(0, at_start), (last, at_end)] {
        let mut message = message(&members, &[cell(column, 5, CellKind::Miss)]);
        message.turn_columns = 0;
        assert_eq!(take(&message).misses.len(), 1);
    }
}

#[test]
fn the_lowest_and_the_highest_ring_have_five_neighbours_at_most() {
    let five = |ring: u8, beside: u8| [(9, ring), (11, ring), (9, beside), (10, beside), (11, beside)];
    assert!(!is_miss(10, 0, &five(0, 1)));
    assert!(!is_miss(10, 31, &five(31, 30)));
    assert!(is_miss(10, 0, &five(0, 1)[..4]));
}

fn numbered(count: usize) -> Vec<Ray> {
    (0..count).map(|i| Ray { direction: Vector3::x(), range_m: i as f64 }).collect()
}

// verifies EXT-020
#[test]
fn rays_are_thinned_evenly_in_order_and_never_to_more_than_asked() {
    let mut thinned = Vec::new();
    for most in [8, 36, 96, 255] {
        for count in [0, 1, most - 1, most, most + 1, 2 * most, 1_000, 77_777] {
            thin(&numbered(count), most, &mut thinned);
            assert_eq!(thinned.len(), count.min(most));
            assert!(thinned.windows(2).all(|pair| pair[0].range_m < pair[1].range_m), "{count} to {most}: none twice");
            let stretch = count as f64 / thinned.len().max(1) as f64;
            for (place, ray) in thinned.iter().enumerate() {
                // One of each of equal stretches.
                let low = (place as f64 * stretch).floor();
                assert!((low..=low + stretch.ceil()).contains(&ray.range_m), "{count} to {most}: {}", ray.range_m);
            }
        }
    }
}

#[test]
fn no_rhythm_comes_through_thinning() {
    // Rings fire in turn: of 32 each keeps its share, within a factor of two.
    let mut thinned = Vec::new();
    for per_ring in [100, 200, 333] {
        thin(&numbered(32 * per_ring), 32 * 10, &mut thinned);
        let mut of_ring = [0; 32];
        thinned.iter().for_each(|ray| of_ring[ray.range_m as usize % 32] += 1);
        assert!(of_ring.iter().all(|&count| (5..=20).contains(&count)), "{per_ring}: {of_ring:?}");
    }
}
