//! Recordings made without processes: simulated sweeps through the chain's rooms, as the recorder would write them.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test file uses what it needs, and may panic")]

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use classifier::{Classifier, ModelFiles};
use clusterer::Clusterer;
use extractor::Extractor;
use lidar::SensorFile;
use messages::{Clusters, Descriptors, Detections, Hop, Message, Part, Raw, Sweep, Trace, Truth};
use simulator::{SceneFile, Simulator};
use stage::Stage;
use zerocopy::FromZeros;

pub fn config(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(path);
    fs::read_to_string(&path).unwrap_or_else(|cause| panic!("{}: {cause}", path.display()))
}

/// The default scene.
pub fn scene() -> Simulator {
    let file: SceneFile = toml::from_str(&config("scenes/default.toml")).unwrap();
    let sensor: SensorFile = toml::from_str(&config("sensors/hdl-32e.toml")).unwrap();
    Simulator::new(file.checked(&sensor.checked().unwrap(), &BTreeMap::new()).unwrap())
}

/// Clusterer, extractor and classifier in a row.
pub struct Rooms {
    clusterer: Clusterer,
    extractor: Extractor,
    classifier: Classifier,
    clusters: Box<Clusters>,
    descriptors: Box<Descriptors>,
    pub detections: Box<Detections>,
}

impl Rooms {
    pub fn new() -> Self {
        fn init<S: Stage>(text: &str, complete: impl FnOnce(&mut S::Params)) -> S {
            let mut params = toml::from_str(text).unwrap();
            complete(&mut params);
            S::init(params).unwrap()
        }
        Self {
            clusterer: init(&config("stages/clusterer.toml"), |_| ()),
            extractor: init(&config("stages/extractor.toml"), |_| ()),
            classifier: init::<Classifier>(&config("stages/classifier.toml"), |params| {
                params.overload = None;
                let card = config("models/solids/card.toml");
                params.files = Some(ModelFiles { card, model: config("models/solids/model.txt").into() });
            }),
            clusters: Clusters::new_box_zeroed().unwrap(),
            descriptors: Descriptors::new_box_zeroed().unwrap(),
            detections: Detections::new_box_zeroed().unwrap(),
        }
    }

    pub fn process(&mut self, number: u64, sweep: &Sweep) {
        let part = Part { ordinal: number, sweep: number, sectors: 1, ..Part::default() };
        self.clusters.clear();
        self.descriptors.clear();
        self.detections.clear();
        self.clusterer.process(part, sweep, &mut self.clusters);
        self.extractor.process(part, &self.clusters, &mut self.descriptors);
        self.classifier.process(part, &self.descriptors, &mut self.detections);
    }
}

/// A file as the recorder writes it.
pub struct Writer {
    mcap: mcap::Writer<Cursor<Vec<u8>>>,
    sweeps: u16,
    detections: u16,
}

impl Writer {
    pub fn new(run: &[(&str, &str)], chunk_size: u64) -> Self {
        let options = mcap::WriteOptions::new().profile("encke").chunk_size(Some(chunk_size));
        let mut mcap = options.create(Cursor::new(Vec::new())).unwrap();
        let metadata = run.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        mcap.write_metadata(&mcap::records::Metadata { name: "encke.run".to_owned(), metadata }).unwrap();
        let mut channel = |topic, layout| {
            let schema = mcap.add_schema(layout, "", &[]).unwrap();
            mcap.add_channel(schema, topic, "encke", &BTreeMap::new()).unwrap()
        };
        let sweeps = channel("/encke/raw/sweep", Sweep::TYPE);
        let detections = channel("/encke/raw/detections", Detections::TYPE);
        Self { mcap, sweeps, detections }
    }

    pub fn sweep(&mut self, number: u32, sweep: &Sweep) {
        let mut bytes = Vec::new();
        sweep.write_raw(&mut bytes);
        self.write(self.sweeps, number, sweep.header.sensor_time_ns, &bytes);
    }

    pub fn detections(&mut self, number: u32, trace: &Trace, message: &Detections) {
        let mut bytes = Vec::new();
        trace.write_raw(&mut bytes);
        message.write_raw(&mut bytes);
        self.write(self.detections, number, message.header.sensor_time_ns, &bytes);
    }

    pub fn write(&mut self, channel_id: u16, sequence: u32, log_time: u64, bytes: &[u8]) {
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, bytes).unwrap();
    }

    pub fn finish(mut self) -> Vec<u8> {
        self.mcap.finish().unwrap();
        self.mcap.into_inner().into_inner()
    }
}

/// A trace with this latency.
pub fn trace(sweep: u64, latency_ns: u64) -> Trace {
    let part = Part { ordinal: sweep, sweep, sectors: 1, ..Part::default() };
    let mut trace = Trace { part, due_ns: 1_000_000, ..Trace::default() };
    for hop in 1..4 {
        trace.push(Hop { finished_ns: 1_000_000 + latency_ns * hop / 3, stage: hop as u16, ..Hop::default() });
    }
    trace
}

pub const RUN: [(&str, &str); 4] =
    [("source", "scenes/default.toml"), ("sensor", "hdl-32e"), ("pace", "realtime"), ("deadline_ms", "100")];

/// So many sweeps of the default scene, recorded; in small chunks.
pub fn recorded(sweeps: u32) -> Vec<u8> {
    let mut simulator = scene();
    let mut rooms = Rooms::new();
    let mut writer = Writer::new(&RUN, 1 << 16);
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    let mut truth = Truth::new_box_zeroed().unwrap();
    for number in 0..sweeps {
        sweep.clear();
        truth.clear();
        simulator.sweep(number.into(), &mut sweep, &mut truth);
        rooms.process(number.into(), &sweep);
        writer.sweep(number, &sweep);
        let latency_ns = 6_000_000 + u64::from(number * 37 % 11) * 700_000;
        writer.detections(number, &trace(number.into(), latency_ns), &rooms.detections);
    }
    writer.finish()
}

/// A file of these bytes in a folder of its own.
pub fn file(dir: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = dir.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}
