//! The chain on real recordings, against oracles that nobody here wrote.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::BTreeMap;
use std::path::Path;

use messages::{Message, Sweep, Truth};
use stage::{Next, Source};
use support::{Run, recorded};
use zerocopy::FromZeros;

const MONTEREY: &str = "hdl32e/monterey_hdl32e.pcap";

#[test]
fn the_real_capture_has_every_sweep_and_every_return() {
    let Some(capture) = recorded(MONTEREY) else { return };
    let oracle = recorded("hdl32e/monterey_hdl32e.oracle.json").unwrap();
    let oracle: serde_json::Value = serde_json::from_slice(&std::fs::read(oracle).unwrap()).unwrap();
    let run =
        Run::new(&["--from", capture.to_str().unwrap(), "--pace", "fast"]).with_all_rows().finish().expect_code(0);
    assert!(run.is_closed());
    assert_eq!(run.sweeps(), (0..19).collect::<Vec<_>>());
    let complete = run.detections.iter().filter(|line| line["complete"] == true).count();
    assert_eq!(complete, 17);
    let returns: u64 = run.detections.iter().map(|line| line["returns"].as_u64().unwrap()).sum();
    assert_eq!(returns, 872_800);
    assert!(holds_number(&oracle, returns), "the oracle counts as many");
    assert_eq!(run.labels.lines().count() - 1, 872_800);
    assert_eq!(run.report["returns"], 872_800);
}

/// Whether a number stands anywhere in the oracle's file.
fn holds_number(value: &serde_json::Value, wanted: u64) -> bool {
    match value {
        serde_json::Value::Number(number) => number.as_u64() == Some(wanted),
        serde_json::Value::Array(list) => list.iter().any(|value| holds_number(value, wanted)),
        serde_json::Value::Object(map) => map.values().any(|value| holds_number(value, wanted)),
        _ => false,
    }
}

#[test]
fn labels_of_the_real_capture_are_the_components_of_brute_force() {
    let Some(capture) = recorded(MONTEREY) else { return };
    let run =
        Run::new(&["--from", capture.to_str().unwrap(), "--pace", "fast"]).with_all_rows().finish().expect_code(0);
    let labels = read_labels(&run.labels);
    let sweeps = read_sweeps(&capture);
    assert_eq!(labels.len(), sweeps.len());
    for (number, points) in sweeps.into_iter().enumerate() {
        // Not assert_eq: nobody wants to read fifty thousand numbers.
        assert!(labels[&(number as u64)] == components(&points, 1.0), "sweep {number}");
    }
}

/// Cluster of each return, by sweep.
fn read_labels(csv: &str) -> BTreeMap<u64, Vec<i64>> {
    let mut labels: BTreeMap<u64, Vec<i64>> = BTreeMap::new();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("sweep,return,cluster"));
    for line in lines {
        let mut fields = line.split(',');
        let sweep = fields.next().unwrap().parse().unwrap();
        let place: usize = fields.next().unwrap().parse().unwrap();
        let list = labels.entry(sweep).or_default();
        assert_eq!(place, list.len(), "returns are counted from 0");
        list.push(fields.next().unwrap().parse().unwrap());
    }
    labels
}

fn read_sweeps(capture: &Path) -> Vec<Vec<[f32; 3]>> {
    let lookup = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/sensors/{name}.toml"));
        let file: lidar::SensorFile = toml::from_str(&std::fs::read_to_string(path)?)?;
        Ok(file.checked()?)
    };
    let mut recording = replay::open(capture, &replay::Options::default(), &lookup).unwrap();
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    let mut sweeps = Vec::new();
    while recording.next(&mut sweep, &mut truth).unwrap() == Next::Sweep {
        sweeps.push(sweep.returns.iter().map(|r| r.position()).collect());
        sweep.clear();
    }
    sweeps
}

/// Components of "no farther than `d`", each return with each: numbered by their first return, as in the output.
fn components(points: &[[f32; 3]], d: f32) -> Vec<i64> {
    let mut parent: Vec<usize> = (0..points.len()).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for (i, &[x, y, z]) in points.iter().enumerate() {
        for (j, &[a, b, c]) in points[..i].iter().enumerate() {
            if (x - a) * (x - a) + (y - b) * (y - b) + (z - c) * (z - c) <= d * d {
                let (a, b) = (root(&mut parent, i), root(&mut parent, j));
                parent[a.max(b)] = a.min(b);
            }
        }
    }
    let mut number = BTreeMap::new();
    (0..points.len())
        .map(|i| {
            let root = root(&mut parent, i);
            let next = number.len() as i64;
            *number.entry(root).or_insert(next)
        })
        .collect()
}

#[test]
fn clouds_count_what_they_refuse_and_label_it_minus_one() {
    let nuscenes = "nuscenes/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";
    for (file, recorded_returns, refused) in
        [(nuscenes, 34_688, 8_029), ("clouds/fast_gicp_251370668.pcd", 69_088, 5_032)]
    {
        let Some(cloud) = recorded(file) else { return };
        let run = Run::new(&["--from", cloud.to_str().unwrap(), "--pace", "fast"]).with_all_rows();
        let run = run.finish().expect_code(0);
        assert!(run.is_closed());
        assert_eq!(run.detections.len(), 1);
        let line = &run.detections[0];
        assert_eq!(line["returns"].as_u64().unwrap(), recorded_returns - refused, "{file}");
        assert_eq!(support::sum(&line["refused"]), refused, "{file}");
        let labels = read_labels(&run.labels).remove(&0).unwrap();
        assert_eq!(labels.len() as u64, recorded_returns);
        assert_eq!(labels.iter().filter(|&&label| label == -1).count() as u64, refused);
    }
}
