//! Recordings as the chain writes them, and as nobody should.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test file uses what it needs, and may panic")]

pub mod rooms;

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use messages::{Detections, Message, Raw, Sweep, Trace, Truth};
use zerocopy::FromZeros;

pub use rooms::{Rooms, scene, trace};

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
