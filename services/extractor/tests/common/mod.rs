//! Clusters to test with, and the slow twin of the extractor. Each test file uses a part of it.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use extractor::Params;
use lidar::Return;
use messages::{Cell, Cluster, ClusterSummary, Clusters, SweepHeader};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use zerocopy::FromZeros;

/// The shipped parameters, with both descriptions on.
pub(crate) fn params() -> Params {
    let file = include_str!("../../../../config/stages/extractor.toml");
    Params { histogram: true, solids: true, ..toml::from_str(file).unwrap() }
}

/// The shipped parameters of the histogram, and no solids.
pub(crate) fn histogram_params() -> Params {
    Params { solids: false, ..params() }
}

/// Points spread at random in a box of 2 m at 10 m, on a coarse lattice where `step_m` is given, so that many
/// distances are equal and many points coincide.
pub(crate) fn scattered(count: usize, seed: u64, step_m: Option<f32>) -> Vec<[f32; 3]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut coordinate = |from: f32| {
        let value = from + random.random::<f32>() * 2.0;
        step_m.map_or(value, |step| (value / step).round() * step)
    };
    (0..count).map(|_| [coordinate(10.0), coordinate(-1.0), coordinate(-1.0)]).collect()
}

/// Returns on a sphere of `radius_m` at `centre_m`, as 32 rings 1.33° apart and columns `step_deg` apart see it, with
/// range noise uniform within ±`noise_m`.
pub(crate) fn sphere(centre_m: [f64; 3], radius_m: f64, step_deg: f64, noise_m: f64, seed: u64) -> Vec<Return> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut returns = Vec::new();
    for column in 0..(360.0 / step_deg) as u16 {
        let azimuth = (f64::from(column) * step_deg).to_radians();
        for ring in 0..32_u8 {
            let elevation = (-30.67 + f64::from(ring) * 4.0 / 3.0).to_radians();
            let ray = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
            let along: f64 = (0..3).map(|a| ray[a] * centre_m[a]).sum();
            let centre2: f64 = centre_m.iter().map(|c| c * c).sum();
            let inside = along * along - centre2 + radius_m * radius_m;
            if along > 0.0 && inside > 0.0 {
                let range = along - inside.sqrt() + noise_m * (2.0 * random.random::<f64>() - 1.0);
                let [x, y, z] = ray.map(|c| (c * range) as f32);
                returns.push(Return { x, y, z, column, ring, intensity: 0 });
            }
        }
    }
    returns
}

/// A message of the given clusters, organised, columns `column_step_rad` apart.
pub(crate) fn message(clusters: &[Vec<Return>], column_step_rad: f32) -> Box<Clusters> {
    let mut message = Clusters::new_box_zeroed().unwrap();
    message.header = SweepHeader { organised: 1, column_step_rad, sensor_time_ns: 7, ..SweepHeader::default() };
    for returns in clusters {
        let first_member = message.returns.len() as u32;
        let points = returns.len() as u32;
        let summary = ClusterSummary { key: first_member, first_member, points, ..ClusterSummary::default() };
        message.clusters.push(Cluster { summary, ..Cluster::default() }).unwrap();
        message.returns.extend_from_slice(returns).unwrap();
        for member in first_member..first_member + points {
            message.members.push(member).unwrap();
        }
    }
    message
}

/// Gives the last cluster of a message these cells.
pub(crate) fn add_cells(message: &mut Clusters, cells: &[Cell]) {
    let first_cell = message.cells.len() as u32;
    let last = message.clusters.len() - 1;
    message.cells.extend_from_slice(cells).unwrap();
    let cluster = &mut message.clusters[last];
    (cluster.first_cell, cluster.cells) = (first_cell, cells.len() as u32);
}

/// The neighbours of each point by brute force: all others, sorted by squared distance in `f32`, then by index.
pub(crate) fn brute_neighbours(points: &[[f32; 3]], others: usize) -> Vec<Vec<u32>> {
    (0..points.len())
        .map(|i| {
            let distance2 = |j: usize| {
                let [x, y, z] = std::array::from_fn(|axis| points[i][axis] - points[j][axis]);
                (x * x + y * y) + z * z
            };
            let mut all: Vec<usize> = (0..points.len()).filter(|&j| j != i).collect();
            all.sort_by(|&a, &b| distance2(a).total_cmp(&distance2(b)).then(a.cmp(&b)));
            all.into_iter().take(others).map(|j| j as u32).collect()
        })
        .collect()
}

/// Eqs. 1 to 4 as they stand, in `f64`, without any of the extractor's short cuts: 1728 weights that sum to 1 (all 0
/// where no pair has angles).
pub(crate) fn slow_histogram(points: &[[f32; 3]], others: usize) -> Vec<f64> {
    let near = brute_neighbours(points, others);
    let wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
    let normals: Vec<[f64; 3]> = (0..points.len())
        .map(|i| {
            let hood: Vec<[f64; 3]> =
                std::iter::once(i).chain(near[i].iter().map(|&j| j as usize)).map(|j| wide[j]).collect();
            least_squares_normal(&hood)
        })
        .collect();
    let spfh: Vec<Vec<f64>> = (0..points.len())
        .map(|i| {
            let mut counts = vec![0.0; 1_728];
            for &j in &near[i] {
                if let Some(bin) = slow_bin(wide[i], wide[j as usize], normals[i], normals[j as usize]) {
                    counts[bin] += 1.0;
                }
            }
            counts
        })
        .collect();
    let mut sum = vec![0.0; 1_728];
    for i in 0..points.len() {
        for bin in 0..1_728 {
            sum[bin] += spfh[i][bin];
            for &j in &near[i] {
                let distance = norm(minus(wide[j as usize], wide[i])).max(1e-3);
                sum[bin] += spfh[j as usize][bin] / (near[i].len() as f64 * distance);
            }
        }
    }
    let total: f64 = sum.iter().sum();
    sum.iter().map(|weight| if total > 0.0 { weight / total } else { 0.0 }).collect()
}

/// Eq. 4: solves M n = b by Cramer's rule; not for singular M.
pub(crate) fn least_squares_normal(hood: &[[f64; 3]]) -> [f64; 3] {
    let mut m = [[0.0; 3]; 3];
    let mut b = [0.0; 3];
    for p in hood {
        for row in 0..3 {
            b[row] += p[row];
            for column in 0..3 {
                m[row][column] += p[row] * p[column];
            }
        }
    }
    let whole = determinant(m);
    let n: [f64; 3] = std::array::from_fn(|replaced| {
        let mut with_b = m;
        for row in 0..3 {
            with_b[row][replaced] = b[row];
        }
        determinant(with_b) / whole
    });
    let length = norm(n);
    n.map(|c| c / length)
}

fn slow_bin(pi: [f64; 3], pj: [f64; 3], ni: [f64; 3], nj: [f64; 3]) -> Option<usize> {
    let offset = minus(pj, pi);
    let distance = norm(offset);
    let across = cross(offset, ni);
    if distance == 0.0 || norm(across) < 1e-6 * distance {
        return None;
    }
    let v = across.map(|c| c / norm(across));
    let w = cross(ni, v);
    let flat = |sine: f64| if sine.abs() < 1e-3 { 0.0 } else { sine };
    let alpha = flat(dot(v, nj));
    let phi = flat(dot(ni, offset) / distance);
    let theta = flat(dot(w, nj)).atan2(dot(ni, nj));
    let level = |share: f64| ((share * 12.0).floor() as usize).min(11);
    let pi2 = std::f64::consts::TAU;
    Some((level((alpha + 1.0) / 2.0) * 12 + level((phi + 1.0) / 2.0)) * 12 + level((theta + pi2 / 2.0) / pi2))
}

fn determinant(m: [[f64; 3]; 3]) -> f64 {
    dot(m[0], cross(m[1], m[2]))
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}
