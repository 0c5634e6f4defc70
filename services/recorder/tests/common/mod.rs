//! Hand-made parts, and a recorder's output read back.
#![allow(dead_code, unreachable_pub, reason = "shared by test files, each of which uses its own share")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use lidar::ObstacleClass;
use messages::{ClusterSummary, Detection, Detections, Hop, MAX_FITS, Message, Part, Solid, Trace, Tracks, Verdict};
use recorder::{Recorder, RecorderError, Settings};
use serde::Deserialize;
use stage::Sink;
use zerocopy::FromZeros;

/// A recorder and the count of what it has settled.
pub struct Sut {
    recorder: Recorder,
    settled: Arc<AtomicU64>,
    /// Detections as the recorder takes them.
    message: Box<Tracks>,
}

impl Sut {
    /// Takes detections among which nothing is tracked.
    pub fn accept(&mut self, trace: &Trace, input: &Detections) -> Verdict {
        self.fill(input);
        self.recorder.accept(trace, &self.message)
    }

    pub fn refuse(&mut self, trace: &Trace, input: &Detections, verdict: Verdict) -> Verdict {
        self.fill(input);
        self.recorder.refuse(trace, &self.message, verdict)
    }

    fn fill(&mut self, input: &Detections) {
        self.message.clear();
        self.message.detections.copy_from(input);
    }

    pub fn settled(&self) -> u64 {
        self.settled.load(Ordering::Acquire)
    }
}

impl Deref for Sut {
    type Target = Recorder;

    fn deref(&self) -> &Recorder {
        &self.recorder
    }
}

impl DerefMut for Sut {
    fn deref_mut(&mut self) -> &mut Recorder {
        &mut self.recorder
    }
}

/// Starts a recorder that counts.
pub fn start(settings: Settings) -> Result<Sut, RecorderError> {
    let settled = Arc::new(AtomicU64::new(0));
    let counter = Arc::clone(&settled);
    let tell = Arc::new(move |_part| _ = counter.fetch_add(1, Ordering::Release));
    Ok(Sut { recorder: Recorder::start(settings, tell)?, settled, message: Tracks::new_box_zeroed().unwrap() })
}

/// Settings without files.
pub fn settings() -> Settings {
    Settings {
        detections: None,
        tracks: None,
        labels: None,
        trace: None,
        statistics: None,
        resume: false,
        queue_parts: 4,
        lossless: true,
        in_order_from: None,
        paced: true,
        rate: 1.0,
        deadline_ms: 100.0,
        stages: ["simulator", "clusterer", "extractor", "classifier"].map(str::to_owned).to_vec(),
    }
}

/// Both files in a folder.
pub fn settings_in(folder: &Path) -> Settings {
    Settings {
        detections: Some(folder.join("detections.jsonl")),
        labels: Some(folder.join("labels.csv")),
        ..settings()
    }
}

/// A sweep as its clusters: each the indices of its returns, with a class.
#[derive(Clone, Debug)]
pub struct HandMade {
    pub sweep: u64,
    pub recorded: u32,
    pub clusters: Vec<(Vec<u32>, ObstacleClass)>,
}

impl HandMade {
    /// `recorded` returns in `clusters` clusters, interleaved; every `refused_every`-th one refused.
    pub fn interleaved(sweep: u64, recorded: u32, clusters: u32, refused_every: u32) -> Self {
        let mut members = vec![Vec::new(); clusters as usize];
        for index in (0..recorded).filter(|index| index % refused_every != refused_every - 1) {
            members[(index % clusters) as usize].push(index);
        }
        let class = |place: usize| ObstacleClass::ALL[place % 5];
        let clusters = members.into_iter().filter(|members| !members.is_empty());
        let mut clusters: Vec<_> = clusters.enumerate().map(|(place, members)| (members, class(place))).collect();
        clusters.sort_by_key(|(members, _)| members[0]);
        Self { sweep, recorded, clusters }
    }

    pub fn accepted(&self) -> u32 {
        self.clusters.iter().map(|(members, _)| members.len() as u32).sum()
    }

    /// The sweep as one part.
    pub fn whole(&self) -> (Trace, Box<Detections>) {
        self.sectors(1, |_| 0).remove(0)
    }

    /// The sweep as `sectors` parts; `closes_in` gives the sector in which the cluster at a place comes.
    pub fn sectors(&self, sectors: u32, closes_in: impl Fn(usize) -> u32) -> Vec<(Trace, Box<Detections>)> {
        let part = |sector: u32| {
            let mut message = Detections::new_box_zeroed().unwrap();
            let share = |count: u32| count * (sector + 1) / sectors - count * sector / sectors;
            let header = &mut message.header;
            header.sensor_time_ns = self.sweep * 100_000_000;
            header.period_ns = 100_000_000;
            header.refused[2] = share(self.recorded - self.accepted());
            header.recorded = header.refused[2] + share(self.accepted());
            header.complete = u32::from(sector + 1 == sectors);
            let here = self.clusters.iter().enumerate().filter(|&(place, _)| closes_in(place) == sector);
            for (place, (members, class)) in here {
                let posterior = if *class == ObstacleClass::Unclassified { [0.0; 4] } else { [0.1, 0.2, 0.3, 0.4] };
                let has_solid = *class != ObstacleClass::Unclassified && place < MAX_FITS;
                let detection = Detection {
                    summary: ClusterSummary {
                        key: members[0],
                        first_member: message.members.len() as u32,
                        points: members.len() as u32,
                        rings: 1 + place as u32 % 32,
                        last_offset_ns: 1_000 * members[members.len() - 1],
                        seam: u32::from(place % 7 == 3),
                        centroid_m: [place as f32 / 3.0, -1.0 / (1.0 + place as f32), 0.1],
                    },
                    posterior,
                    first_solid: message.solids.len() as u32,
                    solids: u32::from(has_solid),
                    class: *class,
                    reserved: [0; 3],
                };
                if has_solid {
                    message.solids.push(solid_of(place)).unwrap();
                }
                message.detections.push(detection).unwrap();
                message.members.extend_from_slice(members).unwrap();
            }
            let part = Part {
                ordinal: self.sweep * u64::from(sectors) + u64::from(sector),
                sweep: self.sweep,
                sector,
                sectors,
                sensor_time_ns: self.sweep * 100_000_000,
                ..Part::default()
            };
            (trace(part), message)
        };
        (0..sectors).map(part).collect()
    }
}

/// Unlike that of any other place.
fn solid_of(place: usize) -> Solid {
    let number = place as f32;
    Solid {
        centre_m: [number, 0.25, -number],
        attitude_wxyz: [0.6, 0.8, 0.0, 0.0],
        size_m: [1.0 + number / 3.0, 2.0, 3.0],
        covariance: std::array::from_fn(|entry| number + entry as f32 / 64.0),
    }
}

/// A trace of four hops: 1 ms late, then 100 µs of transport and 2 ms of work each.
pub fn trace(part: Part) -> Trace {
    let sweep_start_ns = 1_000_000_000 + 100_000_000 * part.sweep;
    let due_ns = sweep_start_ns + 100_000_000 * (u64::from(part.sector) + 1) / u64::from(part.sectors);
    let mut trace = Trace { part, due_ns, sweep_start_ns, ..Trace::default() };
    let mut sent_ns = due_ns + 1_000_000;
    trace.push(Hop { started_ns: due_ns, finished_ns: sent_ns, ..Hop::default() });
    for stage in 1..4 {
        let received_ns = sent_ns + 90_000;
        let started_ns = sent_ns + 100_000;
        sent_ns = started_ns + 2_000_000;
        trace.push(Hop { stage, received_ns, started_ns, finished_ns: sent_ns, ..Hop::default() });
    }
    trace
}

/// A line of detections, as anybody would read it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    pub sweep: u64,
    pub complete: bool,
    pub sensor_time_ns: u64,
    pub returns: u64,
    pub refused: BTreeMap<String, u64>,
    pub missing_sectors: Option<u32>,
    pub rejected_sectors: Option<u32>,
    pub detections: Vec<Row>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    pub cluster: usize,
    pub points: u32,
    pub class: ObstacleClass,
    pub posterior: Option<BTreeMap<String, f32>>,
    pub centroid_m: [f32; 3],
    pub centre_m: Option<[f32; 3]>,
    pub size_m: Option<[f32; 3]>,
    pub attitude_wxyz: Option<[f32; 4]>,
    pub centre_covariance_m2: Option<[f32; 9]>,
    pub range_m: f32,
    pub rings: u32,
}

/// The lines of a file.
pub fn lines(path: &Path) -> Vec<Line> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The rows of a file of labels: sweep, return, cluster.
pub fn rows(path: &Path) -> Vec<(u64, u32, i64)> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("sweep,return,cluster"));
    let row = |line: &str| {
        let [sweep, index, cluster] = line.split(',').collect::<Vec<_>>()[..] else { panic!("{line:?} is no row") };
        (sweep.parse().unwrap(), index.parse().unwrap(), cluster.parse().unwrap())
    };
    lines.map(row).collect()
}
