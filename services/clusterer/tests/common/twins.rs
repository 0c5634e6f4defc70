//! Slow and straightforward twins of what the message says of each cluster.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use clusterer::validation::brute_force_cells;
use messages::{Cluster, Clusters, Sweep};

/// Every field of both messages is equal, azimuths of cells to the bit.
#[track_caller]
pub(crate) fn assert_same(a: &Clusters, b: &Clusters) {
    assert_eq!(a.header, b.header);
    assert_eq!(a.ring_elevation_rad[..], b.ring_elevation_rad[..]);
    assert!(a.clusters[..] == b.clusters[..], "clusters differ");
    assert!(a.returns[..] == b.returns[..], "returns differ");
    assert!(a.members[..] == b.members[..], "members differ");
    assert!(a.cells[..] == b.cells[..], "cells differ");
}

/// Every summary is what its definition says of the cluster's returns.
#[track_caller]
pub(crate) fn assert_summaries(sweep: &Sweep, clusters: &Clusters, range_d_m: f32) {
    assert_eq!(clusters.header, sweep.header);
    let elevations: Vec<f32> = sweep.rings.iter().map(|ring| ring.elevation_rad).collect();
    assert_eq!(clusters.ring_elevation_rad[..], elevations[..]);
    for cluster in &clusters.clusters {
        assert_summary(sweep, clusters, cluster, range_d_m);
    }
}

#[track_caller]
fn assert_summary(sweep: &Sweep, clusters: &Clusters, cluster: &Cluster, range_d_m: f32) {
    let summary = cluster.summary;
    let members = &clusters.returns[summary.member_places()];
    assert_eq!(summary.key, *clusters.members[summary.member_places()].iter().min().unwrap());
    let mean = |value: fn(&lidar::Return) -> f32| {
        members.iter().map(|r| f64::from(value(r))).sum::<f64>() / members.len() as f64
    };
    for (is, must_be) in summary.centroid_m.into_iter().zip([mean(|r| r.x), mean(|r| r.y), mean(|r| r.z)]) {
        assert!((f64::from(is) - must_be).abs() <= 1e-6 * must_be.abs() + 1e-9, "centroid {is}, must be {must_be}");
    }
    if !sweep.header.is_organised() {
        let all = (summary.rings, u64::from(summary.last_offset_ns), summary.seam, cluster.cells);
        assert_eq!(all, (0, sweep.header.period_ns, 1, 0));
        return;
    }
    let rings: BTreeSet<u8> = members.iter().map(|r| r.ring).collect();
    assert_eq!(summary.rings as usize, rings.len());
    let time_ns =
        |r: &lidar::Return| sweep.columns[usize::from(r.column)].offset_ns + sweep.rings[usize::from(r.ring)].offset_ns;
    assert_eq!(Some(summary.last_offset_ns), members.iter().map(time_ns).max());
    // A window that ends within a rounding of the first or last column may be judged either way.
    let touches = |slip: f64| members.iter().any(|r| reaches_an_end(sweep, r, range_d_m, slip));
    assert!(u32::from(touches(-1e-3)) <= summary.seam && summary.seam <= u32::from(touches(1e-3)), "seam: {summary:?}");
}

/// Whether a return's window, and `slip` columns, reach the first or last column.
fn reaches_an_end(sweep: &Sweep, r: &lidar::Return, range_d_m: f32, slip: f64) -> bool {
    let h_m = f64::from(r.x).hypot(f64::from(r.y));
    let half_rad = if h_m <= f64::from(range_d_m) { TAU } else { (f64::from(range_d_m) / h_m).asin() };
    let window = (half_rad / f64::from(sweep.header.column_step_rad) + 1.0).max(3.0);
    let (column, last) = (f64::from(r.column), sweep.columns.len() as f64 - 1.0);
    column.min(last - column) <= window + slip
}

/// The cells of each cluster of at least `min_points` are those of the definition; others have none. Gives the number.
#[track_caller]
pub(crate) fn assert_cells(sweep: &Sweep, clusters: &Clusters, min_points: u32) -> usize {
    for (number, cluster) in clusters.clusters.iter().enumerate() {
        if cluster.summary.points < min_points {
            assert_eq!(cluster.cells, 0);
            continue;
        }
        let is: Vec<_> =
            clusters.cells[cluster.cell_places()].iter().map(|c| (c.column, c.ring, c.kind, c.range_m)).collect();
        let must_be: Vec<_> =
            brute_force_cells(sweep, clusters, number).iter().map(|c| (c.column, c.ring, c.kind, c.range_m)).collect();
        assert_eq!(is, must_be, "cluster {number}");
        for cell in &clusters.cells[cluster.cell_places()] {
            assert!((-std::f32::consts::PI..std::f32::consts::PI).contains(&cell.azimuth_rad), "{cell:?}");
            let Some(column) = sweep.columns.get(usize::from(cell.column)).filter(|c| c.valid != 0) else { continue };
            let turn = f64::from(sweep.rings[usize::from(cell.ring)].offset_ns) / sweep.header.period_ns as f64;
            let turned_rad = (f64::from(cell.azimuth_rad) - f64::from(column.azimuth_rad)).abs();
            let off_rad = (turned_rad - turn * TAU).abs();
            assert!(off_rad.min((TAU - turned_rad - turn * TAU).abs()) < 1e-5, "{cell:?}: {column:?}");
        }
    }
    clusters.cells.len()
}
