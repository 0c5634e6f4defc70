//! Sweeps to test with, and what every answer is held against. Each test file uses a part of it.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

pub(crate) mod any;
pub(crate) mod scanner;
pub(crate) mod sectors;
pub(crate) mod twins;

use clusterer::validation::{brute_force_roots, roots_of};
use clusterer::{Clusterer, Method, Params};
use lidar::{Column, Return, Ring};
use messages::{Clusters, Part, Sweep, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

pub(crate) const METHODS: [Method; 3] = [Method::Auto, Method::Scan, Method::Kdtree];
pub(crate) const WHOLE: Part =
    Part { ordinal: 0, sweep: 0, sector: 0, sectors: 1, sensor_time_ns: 0, step: 0, attempt: 0 };

pub(crate) fn room(method: Method, range_d_m: f32) -> Clusterer {
    Clusterer::init(Params { range_d_m, method, min_points: 5 }).unwrap()
}

pub(crate) fn process(room: &mut Clusterer, sweep: &Sweep) -> (Verdict, Box<Clusters>) {
    let mut output = Clusters::new_box_zeroed().unwrap();
    let verdict = room.process(WHOLE, sweep, &mut output);
    (verdict, output)
}

/// A cloud without rings and columns.
pub(crate) fn cloud(points: &[[f32; 3]]) -> Box<Sweep> {
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    for &[x, y, z] in points {
        sweep.returns.push(Return { x, y, z, ..Return::default() }).unwrap();
    }
    sweep.header.recorded = points.len() as u32;
    sweep.header.period_ns = 100_000_000;
    sweep
}

/// A complete turn without returns: `rings` of 1° from −1° times half their number, `columns` from azimuth −π on, each
/// fired in one instant.
pub(crate) fn empty_turn(rings: usize, columns: usize) -> Box<Sweep> {
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    let step_rad = std::f64::consts::TAU / columns as f64;
    for ring in 0..rings {
        let elevation_rad = (ring as f32 - rings as f32 / 2.0).to_radians();
        sweep.rings.push(Ring { elevation_rad, offset_ns: 0 }).unwrap();
    }
    for column in 0..columns {
        let azimuth_rad = (column as f64 * step_rad - std::f64::consts::PI) as f32;
        sweep.columns.push(Column { azimuth_rad, offset_ns: column as u32 * 1_000, valid: 1 }).unwrap();
    }
    sweep.header.period_ns = columns as u64 * 1_000;
    (sweep.header.complete, sweep.header.organised) = (1, 1);
    sweep.header.column_step_rad = step_rad as f32;
    sweep
}

/// Adds a return at `range_m` on the axis of a firing.
pub(crate) fn put(sweep: &mut Sweep, ring: usize, column: usize, range_m: f64) {
    let azimuth = f64::from(sweep.columns[column].azimuth_rad);
    let elevation = f64::from(sweep.rings[ring].elevation_rad);
    let (h_m, z) = (range_m * elevation.cos(), range_m * elevation.sin());
    let (x, y) = (h_m * azimuth.cos(), h_m * azimuth.sin());
    let [x, y, z] = [x, y, z].map(|value| value as f32);
    sweep.returns.push(Return { x, y, z, column: column as u16, ring: ring as u8, intensity: 0 }).unwrap();
    sweep.header.recorded += 1;
}

/// All methods give the oracle's partition and the same message, whose every field is the twins'. Gives the message.
#[track_caller]
pub(crate) fn assert_exact(sweep: &Sweep, range_d_m: f32) -> Box<Clusters> {
    let expected = brute_force_roots(sweep, range_d_m);
    let mut answers = METHODS.map(|method| {
        let (verdict, clusters) = process(&mut room(method, range_d_m), sweep);
        assert_eq!(verdict, Verdict::Complete, "{method:?} d = {range_d_m}");
        let roots = roots_of(sweep, &clusters).unwrap();
        if let Some(place) = (0..roots.len()).find(|&place| roots[place] != expected[place]) {
            let (is, must_be) = (roots[place], expected[place]);
            panic!("{method:?} d = {range_d_m}: return {place} is in cluster {is}, must be in {must_be}");
        }
        clusters
    });
    for other in &answers[1..] {
        twins::assert_same(&answers[0], other);
    }
    twins::assert_summaries(sweep, &answers[0], range_d_m);
    std::mem::replace(&mut answers[0], Clusters::new_box_zeroed().unwrap())
}
