//! The real captures against their oracles: HDL-32E (Monterey) and, of the same kind of blocks, VLP-16.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use lidar::Return;
use messages::{Refusal, Sweep};
use serde_json::Value;
use support::{all, assert_true, data, opened};

const CAPTURE: &str = "hdl32e/monterey_hdl32e.pcap";
const HOUR_NS: u64 = 3_600_000_000_000;

fn capture() -> Option<(Vec<Box<Sweep>>, Value)> {
    let (capture, oracle) = (data(CAPTURE)?, data("hdl32e/monterey_hdl32e.oracle.json")?);
    let mut recording = opened(&capture).unwrap();
    let sweeps = all(&mut recording);
    assert_eq!(recording.faults().found().count(), 0, "the capture is intact");
    let oracle = serde_json::from_str(&std::fs::read_to_string(oracle).unwrap()).unwrap();
    Some((sweeps, oracle))
}

fn numbers(value: &Value) -> [f64; 3] {
    std::array::from_fn(|i| value[i].as_f64().unwrap())
}

/// Furthest of the coordinates of `a` from those of `b`.
fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

// verifies RPL-001, RPL-002
#[test]
fn every_sweep_has_the_oracles_count_box_centroid_and_times() {
    let Some((sweeps, oracle)) = capture() else { return };
    let facts = oracle["sweeps"].as_array().unwrap();
    assert_eq!(sweeps.len(), 19);
    assert_eq!(sweeps.iter().filter(|sweep| sweep.header.is_complete()).count(), 17);
    assert_eq!(sweeps.iter().map(|sweep| sweep.returns.len()).sum::<usize>(), 872_800);
    for (sweep, fact) in sweeps.iter().zip(facts) {
        assert_true(sweep);
        let positions = || sweep.returns.iter().map(|found| found.position().map(f64::from));
        let mean = |axis: usize| positions().map(|p| p[axis]).sum::<f64>() / sweep.returns.len() as f64;
        let low: [f64; 3] = std::array::from_fn(|axis| positions().map(|p| p[axis]).fold(f64::MAX, f64::min));
        let high: [f64; 3] = std::array::from_fn(|axis| positions().map(|p| p[axis]).fold(f64::MIN, f64::max));
        let index = &fact["index"];
        assert_eq!(sweep.returns.len() as u64, fact["points"].as_u64().unwrap(), "sweep {index}");
        assert_eq!(sweep.columns.len() as u64, fact["blocks"].as_u64().unwrap(), "sweep {index}");
        assert_eq!(sweep.header.is_complete(), fact["complete"].as_bool().unwrap(), "sweep {index}");
        assert!(apart(low, numbers(&fact["bbox_min"])) < 1e-3, "sweep {index}");
        assert!(apart(high, numbers(&fact["bbox_max"])) < 1e-3, "sweep {index}");
        assert!(apart([mean(0), mean(1), mean(2)], numbers(&fact["centroid"])) < 1e-3, "sweep {index}");
        let start_ns = fact["start_toh_us"].as_f64().unwrap() * 1e3;
        let of_hour_ns = (sweep.header.sensor_time_ns % HOUR_NS) as f64;
        assert!((of_hour_ns - start_ns).abs() <= 1.0, "sweep {index}: {of_hour_ns} {start_ns}");
        let azimuth_cdeg = f64::from(sweep.columns[0].azimuth_rad).to_degrees() * -100.0;
        let first_cdeg = fact["first_azimuth_cdeg"].as_f64().unwrap();
        let off = (azimuth_cdeg - first_cdeg + 18_000.0).rem_euclid(36_000.0) - 18_000.0;
        assert!(off.abs() < 0.01, "sweep {index}");
    }
}

// verifies RPL-002
#[test]
fn sensor_time_is_the_hosts_hour_with_the_sensors_microseconds() {
    let Some((sweeps, oracle)) = capture() else { return };
    let host_s = oracle["pcap"]["first_record_unix"].as_f64().unwrap();
    let behind_s = oracle["toh_us"]["sensor_minus_host_s"].as_f64().unwrap();
    let first_s = sweeps[0].header.sensor_time_ns as f64 * 1e-9;
    assert!((first_s - host_s - behind_s).abs() < 1e-3, "{first_s} {host_s} {behind_s}");
    for pair in sweeps.windows(2) {
        let apart_ns = pair[1].header.sensor_time_ns - pair[0].header.sensor_time_ns;
        if pair[0].header.is_complete() {
            assert_eq!(pair[0].header.period_ns, apart_ns);
        }
    }
    // 11.775 Hz, also where only a part of the turn was seen.
    for sweep in &sweeps {
        let hz = 1e9 / sweep.header.period_ns as f64;
        assert!((hz - 11.775).abs() < 0.02, "{hz}");
        assert!((f64::from(sweep.header.column_step_rad).to_degrees() - 0.19530).abs() < 1e-3);
    }
}

// verifies RPL-001
#[test]
fn every_channel_of_the_first_packets_is_where_the_oracle_has_it() {
    let Some((sweeps, _)) = capture() else { return };
    let Some(table) = data("hdl32e/monterey_hdl32e.packets0-2.csv") else { return };
    let table = std::fs::read_to_string(table).unwrap();
    let mut returns = sweeps[0].returns.iter();
    let (mut rows, mut worst) = (0, 0.0_f64);
    for row in table.lines().skip(1) {
        let row: Vec<f64> = row.split(',').map(|field| field.parse().unwrap()).collect();
        let [packet, block, _, ring, _, _, distance, intensity, _, x, y, z] = row[..] else { panic!("{row:?}") };
        rows += 1;
        if distance == 0.0 {
            continue;
        }
        let found: &Return = returns.next().unwrap();
        worst = worst.max(apart(found.position().map(f64::from), [x, y, z]));
        assert_eq!(f64::from(found.ring), ring);
        assert_eq!(f64::from(found.intensity), intensity);
        assert_eq!(f64::from(found.column), packet * 12.0 + block);
    }
    assert_eq!(rows, 1_152);
    // The table is rounded to 10 µm.
    assert!(worst < 2e-5, "{worst}");
}

// verifies RPL-001
#[test]
fn each_ring_has_as_many_returns_as_its_channel() {
    let Some((sweeps, oracle)) = capture() else { return };
    let mut counts = [0_u64; 32];
    for found in sweeps.iter().flat_map(|sweep| sweep.returns.iter()) {
        counts[usize::from(found.ring)] += 1;
    }
    for (channel, expected) in oracle["nonzero_returns_per_channel"].as_array().unwrap().iter().enumerate() {
        let ring = if channel % 2 == 0 { channel / 2 } else { 16 + (channel - 1) / 2 };
        assert_eq!(counts[ring], expected.as_u64().unwrap());
    }
}

// verifies RPL-001
#[test]
fn azimuths_of_returns_follow_their_column_by_less_than_a_step() {
    let Some((sweeps, _)) = capture() else { return };
    for sweep in &sweeps {
        let step_rad = f64::from(sweep.header.column_step_rad);
        for found in &sweep.returns {
            let column = sweep.columns[usize::from(found.column)];
            let behind = f64::from(column.azimuth_rad) - f64::from(found.y).atan2(f64::from(found.x));
            let behind = (behind + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
            assert!((-1e-6..step_rad).contains(&behind), "{behind}");
            let elevation_rad = f64::from(found.z).atan2(f64::from(found.x).hypot(f64::from(found.y)));
            let ring = sweep.rings[usize::from(found.ring)];
            assert!((elevation_rad - f64::from(ring.elevation_rad)).abs() < 1e-6);
        }
    }
}

// verifies RPL-007
#[test]
fn range_limits_of_the_caller_refuse_returns_but_keep_their_numbers() {
    let Some(capture) = data(CAPTURE) else { return };
    let whole = all(&mut opened(&capture).unwrap());
    let options = replay::Options { min_range_m: Some(3.0), max_range_m: Some(50.0), ..replay::Options::default() };
    let limited = all(&mut replay::open(&capture, &options, &support::sensors).unwrap());
    for (limited, whole) in limited.iter().zip(&whole) {
        assert_true(limited);
        assert_eq!(limited.header.recorded as usize, whole.returns.len());
        let far = whole.returns.iter().filter(|found| found.range_m() > 50.0).count();
        assert_eq!(limited.header.refused[Refusal::TooFar as usize] as usize, far);
        assert!(far > 0);
        for (place, found) in limited.returns.iter().enumerate() {
            assert_eq!(*found, whole.returns[limited.index_of(place) as usize]);
        }
    }
}

// verifies RPL-008
#[test]
fn a_loop_gives_the_same_sweeps_again_while_time_goes_on() {
    use zerocopy::FromZeros;
    let Some(capture) = data(CAPTURE) else { return };
    let options = replay::Options { repeat: true, ..replay::Options::default() };
    let mut recording = replay::open(&capture, &options, &support::sensors).unwrap();
    let mut truth = messages::Truth::new_box_zeroed().unwrap();
    let mut sweep = support::new_sweep();
    let (mut before_ns, mut counts, mut starts) = (0, Vec::new(), Vec::new());
    for _ in 0..3 * 19 {
        assert!(support::next(&mut recording, &mut sweep, &mut truth));
        assert!(sweep.header.sensor_time_ns > before_ns);
        before_ns = sweep.header.sensor_time_ns;
        counts.push(sweep.returns.len());
        starts.push(before_ns);
    }
    assert_eq!(counts[..19], counts[19..38]);
    assert_eq!(counts[..19], counts[38..]);
    assert_eq!(starts[19] - starts[0], starts[38] - starts[19]);
    assert!(starts[19] - starts[18] > 80_000_000, "a period lies between the last sweep and the first");
}

// verifies RPL-001
#[test]
fn a_vlp_16_named_by_the_caller_has_its_oracles_counts_and_boxes() {
    let (Some(capture), Some(oracle)) = (data("vlp16/veloview_vlp16.pcap"), data("vlp16/veloview_vlp16.oracle.json"))
    else {
        return;
    };
    let options = replay::Options { sensor: Some("vlp-16".to_owned()), ..replay::Options::default() };
    let sweeps = all(&mut replay::open(&capture, &options, &support::sensors).unwrap());
    let oracle: Value = serde_json::from_str(&std::fs::read_to_string(oracle).unwrap()).unwrap();
    let facts = oracle["sweeps"].as_array().unwrap();
    assert_eq!(sweeps.len(), facts.len());
    assert_eq!(sweeps.iter().map(|sweep| sweep.returns.len()).sum::<usize>(), 700_400);
    for (sweep, fact) in sweeps.iter().zip(facts) {
        assert_true(sweep);
        let index = &fact["index"];
        assert_eq!(sweep.returns.len() as u64, fact["points"].as_u64().unwrap(), "sweep {index}");
        assert_eq!(sweep.columns.len() as u64, 2 * fact["blocks"].as_u64().unwrap(), "sweep {index}");
        for (axis, name) in (0..3).flat_map(|axis| [(axis, "bbox_min"), (axis, "bbox_max")]) {
            let along = sweep.returns.iter().map(|found| f64::from(found.position()[axis]));
            let edge = along.fold(f64::NAN, if name == "bbox_min" { f64::min } else { f64::max });
            assert!((edge - numbers(&fact[name])[axis]).abs() < 1e-3, "sweep {index} {name}: {edge}");
        }
    }
}
