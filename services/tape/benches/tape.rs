//! CPU time that a sweep costs the recording process, by compression: the default scene, and a dense sweep of 60,000
//! returns; all that is shipped, and what replay needs alone. Prints the bytes of a sweep, too.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

use std::f32::consts::{PI, TAU};
use std::time::Duration;

use criterion::{Criterion, Throughput};
use lidar::{Column, ObstacleClass, Return, Ring};
use messages::{
    ClusterSummary, Cutter, Detection, Detections, MAX_TRACKS, Part, Solid, Sweep, Trace, Track, TrackState,
    TrackTable, Truth,
};
use rustix::time::{ClockId, clock_gettime};
use simulator::{SceneFile, Simulator};
use tape::{About, Compression, Tape, TapeFile, Topic};
use zerocopy::FromZeros;

/// A sweep in one part, with its detections, tracks and truth.
struct Input {
    sweep: Box<Sweep>,
    detections: Box<Detections>,
    tracks: Box<TrackTable>,
    truth: Box<Truth>,
}

/// Sweeps of the default scene; what belongs to an object is a cluster, all others are one.
fn default_scene(sweeps: u64) -> Vec<Input> {
    let sensor: lidar::SensorFile = toml::from_str(include_str!("../../../config/sensors/hdl-32e.toml")).unwrap();
    let scene: SceneFile = toml::from_str(include_str!("../../../config/scenes/default.toml")).unwrap();
    let mut simulator = Simulator::new(scene.checked(&sensor.checked().unwrap(), &Default::default()).unwrap());
    let one = |number| {
        let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
        simulator.sweep(number, &mut sweep, &mut truth);
        Cutter::new(1).measure(&mut sweep);
        let detections = detections(&sweep, |place| truth.owners[place].into());
        Input { sweep, tracks: tracks(number, &detections), detections, truth }
    };
    (0..sweeps).map(one).collect()
}

/// A hall of 32 rings and 1,875 columns, every firing of which returns, with 2 cm of noise in steps of 2 mm.
fn dense(sweeps: u64) -> Vec<Input> {
    let mut seed = 1_u32;
    let mut noise_m = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((seed >> 24) as f32 - 127.5) / 127.5 * 0.034
    };
    let mut one = |number: u64| {
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        let (columns, rings) = (1_875_u32, 32_u8);
        let step = TAU / columns as f32;
        (sweep.header.organised, sweep.header.complete, sweep.header.column_step_rad) = (1, 1, step);
        (sweep.header.sensor_time_ns, sweep.header.period_ns) = (number * 100_000_000, 100_000_000);
        let elevation_rad = |ring: u8| (f32::from(ring) - 23.0) * 0.0233;
        for ring in 0..rings {
            sweep.rings.push(Ring { elevation_rad: elevation_rad(ring), offset_ns: u32::from(ring) * 1_152 }).unwrap();
        }
        for column in 0..columns {
            let azimuth_rad = column as f32 * step - PI;
            sweep.columns.push(Column { azimuth_rad, offset_ns: column * 53_000, valid: 1 }).unwrap();
            for ring in 0..rings {
                let wall_m = 12.0 + 4.0 * (azimuth_rad * 3.0).sin() + f32::from(ring) * 0.05;
                let range_m = ((wall_m + noise_m()) / 0.002).round() * 0.002;
                let (sine, cosine) = elevation_rad(ring).sin_cos();
                let (x, y) = (range_m * cosine * azimuth_rad.cos(), range_m * cosine * azimuth_rad.sin());
                let intensity = 40 + (noise_m() * 300.0) as i8 as u8;
                sweep.returns.push(Return { x, y, z: range_m * sine, column: column as u16, ring, intensity }).unwrap();
            }
        }
        sweep.header.recorded = sweep.returns.len() as u32;
        Cutter::new(1).measure(&mut sweep);
        let detections = detections(&sweep, |place| place as u32 / 100);
        Input { sweep, tracks: tracks(number, &detections), detections, truth: Truth::new_box_zeroed().unwrap() }
    };
    (0..sweeps).map(&mut one).collect()
}

fn detections(sweep: &Sweep, owner: impl Fn(usize) -> u32) -> Box<Detections> {
    let mut clusters = std::collections::BTreeMap::<u32, Vec<usize>>::new();
    for place in 0..sweep.returns.len() {
        clusters.entry(owner(place)).or_default().push(place);
    }
    let mut clusters: Vec<Vec<usize>> = clusters.into_values().collect();
    clusters.sort_unstable();
    let mut whole = Detections::new_box_zeroed().unwrap();
    whole.header = sweep.header;
    for (number, members) in clusters.iter().enumerate() {
        let summary = ClusterSummary {
            key: sweep.index_of(members[0]),
            first_member: whole.members.len() as u32,
            points: members.len() as u32,
            centroid_m: sweep.returns[members[0]].position(),
            ..ClusterSummary::default()
        };
        let class = ObstacleClass::SOLIDS[number % 4];
        let first_solid = whole.solids.len() as u32;
        let solids = u32::from(whole.solids.push(Solid { size_m: [1.0, 2.0, 3.0], ..Solid::default() }).is_ok());
        let posterior = [0.25; 4];
        members.iter().for_each(|&place| whole.members.push(sweep.index_of(place)).unwrap());
        let detection = Detection { summary, posterior, first_solid, solids, class, ..Detection::default() };
        whole.detections.push(detection).unwrap();
    }
    whole
}

/// A track for each cluster, whose numbers differ from sweep to sweep as those of a filter do.
fn tracks(sweep: u64, detections: &Detections) -> Box<TrackTable> {
    let mut table = TrackTable::new_box_zeroed().unwrap();
    table.time_ns = detections.header.sensor_time_ns + 100_000_000;
    let mut seed = sweep as u32;
    let mut noise = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / 16_777_216.0
    };
    for (place, detection) in detections.detections.iter().take(MAX_TRACKS).enumerate() {
        let track = Track {
            id: 1_025 + place as u64,
            last_seen_ns: table.time_ns - u64::from(detection.summary.last_offset_ns),
            valid_until_ns: table.time_ns + 500_000_000,
            position_m: detection.summary.centroid_m.map(|at| at + noise()),
            velocity_mps: [0; 3].map(|_| noise()),
            covariance: [0; 21].map(|_| noise()),
            size_m: [0; 3].map(|_| noise()),
            size_sigma_m: [0; 3].map(|_| noise()),
            attitude_wxyz: [1.0, noise(), noise(), noise()],
            posterior: detection.posterior,
            keys: 1,
            first_key: place as u32,
            age_sweeps: 1 + sweep as u32,
            state: TrackState::Confirmed,
            class: detection.class,
            ..Track::default()
        };
        table.tracks.push(track).unwrap();
        table.keys.push(detection.summary.key).unwrap();
    }
    table
}

/// What this thread has had of the processor: others may have the rest.
fn cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

fn give(tape: &mut Tape, number: u64, input: &Input) {
    let trace =
        Trace { part: Part { ordinal: number, sweep: number, sectors: 1, ..Part::default() }, ..Trace::default() };
    tape.truth(number, &trace, &input.truth);
    tape.sweep(number, &trace, &input.sweep);
    tape.detections(number, &trace, &input.detections);
    tape.tracks(number, &trace, &input.tracks);
    if number % 10 == 9 {
        tape.checkpoint(number);
    }
}

fn bench(c: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let shipped: TapeFile = toml::from_str(include_str!("../../../config/tape.toml")).unwrap();
    let (scene, hall) = (default_scene(10), dense(10));
    let replay = vec![Topic::RawSweep, Topic::RawDetections, Topic::RawTracks];
    for (name, inputs) in [("default", &scene), ("dense", &hall)] {
        let mut group = c.benchmark_group(name);
        group.throughput(Throughput::Elements(inputs[0].sweep.returns.len() as u64));
        for (what, topics) in [("all", &shipped.topics), ("raw", &replay)] {
            for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
                let of = TapeFile {
                    compression,
                    topics: topics.clone(),
                    quota_mib: 512,
                    rotate_mib: 128,
                    ..shipped.clone()
                };
                let start = |path| Tape::start(of.checked().unwrap(), path, About::default(), None, 0).unwrap();
                let path = folder.path().join("counted.mcap");
                let mut tape = start(&path);
                inputs.iter().enumerate().for_each(|(number, input)| give(&mut tape, number as u64, input));
                tape.finish(0).unwrap();
                let bytes = std::fs::metadata(&path).unwrap().len() / inputs.len() as u64;
                println!(
                    "{name}/{what}/{compression:?}: {bytes} bytes a sweep, {} returns",
                    inputs[0].sweep.returns.len()
                );
                if let Some(kept) = std::env::var_os("TAPE_KEEP") {
                    std::fs::copy(
                        &path,
                        std::path::Path::new(&kept).join(format!("{name}-{what}-{compression:?}.mcap")),
                    )
                    .unwrap();
                }
                let mut tape = start(&folder.path().join("timed.mcap"));
                let mut number = 0;
                group.bench_function(format!("{what}/{compression:?}"), |b| {
                    b.iter_custom(|sweeps| {
                        let from = cpu_time();
                        for _ in 0..sweeps {
                            give(&mut tape, number, &inputs[(number % 10) as usize]);
                            number += 1;
                        }
                        cpu_time() - from
                    });
                });
                tape.finish(0).unwrap();
            }
        }
        group.finish();
    }
}

fn main() {
    let mut criterion = Criterion::default().sample_size(30).configure_from_args();
    bench(&mut criterion);
    criterion.final_summary();
}
