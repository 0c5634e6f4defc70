//! Sweeps and detections by hand, in sectors as the chain sends them, and recordings read back.

#![allow(dead_code, unreachable_pub, reason = "shared by test files, each of which uses its own share")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use lidar::{Column, ObstacleClass, Return, Ring};
use messages::{
    ClosestApproach, ClusterSummary, Cutter, Detection, Detections, Message, Part, Raw, Solid, Sweep, Trace, Track,
    TrackState, TrackTable, Truth, TruthObject,
};
use tape::{About, Settings, Tape, TapeFile, Topic};
use zerocopy::FromZeros;

/// The host's UTC at which everything begins [ns].
pub const UTC_NS: u64 = 1_700_000_000_000_000_000;
/// Duration of a turn [ns].
pub const PERIOD_NS: u64 = 100_000_000;
const COLUMNS: u32 = 120;
/// Neighbouring columns that make a cluster; the first of each has a refused return.
const CLUSTER_COLUMNS: u32 = 6;

/// A sweep with all that the chain says of it.
pub struct Made {
    pub number: u64,
    pub sweep: Box<Sweep>,
    pub detections: Box<Detections>,
    pub tracks: Box<TrackTable>,
    pub truth: Box<Truth>,
}

/// Clusters of six columns by two rings each, of all classes in turn, with solids but for the unclassified.
pub fn made(number: u64) -> Made {
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    let step = TAU as f32 / COLUMNS as f32;
    let header = &mut sweep.header;
    (header.organised, header.complete, header.column_step_rad) = (1, 1, step);
    (header.period_ns, header.sensor_time_ns) = (PERIOD_NS, 5_000_000_000 + number * PERIOD_NS);
    for elevation_rad in [-0.1, 0.1] {
        sweep.rings.push(Ring { elevation_rad, offset_ns: 10 }).unwrap();
    }
    let mut recorded = 0;
    for column in 0..COLUMNS {
        let azimuth_rad = column as f32 * step - 3.0;
        sweep.columns.push(Column { azimuth_rad, offset_ns: column * 1_000, valid: 1 }).unwrap();
        recorded += u32::from(column % CLUSTER_COLUMNS == 0);
        for ring in 0..2 {
            let range_m = 5.0 + (number % 7) as f32 * 0.5;
            let (x, y) = (range_m * azimuth_rad.cos(), range_m * azimuth_rad.sin());
            let intensity = (number % 251) as u8;
            let echo = Return { x, y, z: 0.5, column: column as u16, ring, intensity };
            sweep.returns.push(echo).unwrap();
            sweep.recorded_index.push(recorded).unwrap();
            recorded += 1;
        }
    }
    sweep.header.recorded = recorded;
    sweep.header.refused[0] = COLUMNS / CLUSTER_COLUMNS;
    Cutter::new(1).measure(&mut sweep);
    let detections = detections(&sweep);
    let tracks = tracks(&detections);
    let mut truth = Truth::new_box_zeroed().unwrap();
    truth.sensor_time_ns = sweep.header.sensor_time_ns;
    truth.objects.push(TruthObject { id: 1, centre_m: [number as f32, 0.0, 0.0], ..TruthObject::default() }).unwrap();
    Made { number, sweep, detections, tracks, truth }
}

fn detections(sweep: &Sweep) -> Box<Detections> {
    let mut whole = Detections::new_box_zeroed().unwrap();
    whole.header = sweep.header;
    let each = 2 * CLUSTER_COLUMNS as usize;
    for (number, members) in sweep.recorded_index.chunks(each).enumerate() {
        let class = ObstacleClass::ALL[number % 5];
        let (first_member, first_solid) = (whole.members.len() as u32, whole.solids.len() as u32);
        let solids = u32::from(class != ObstacleClass::Unclassified);
        let summary = ClusterSummary {
            key: members[0],
            first_member,
            points: each as u32,
            rings: 2,
            centroid_m: sweep.returns[number * each].position(),
            ..ClusterSummary::default()
        };
        let posterior = [0.1, 0.2, 0.3, 0.4];
        whole.members.extend_from_slice(members).unwrap();
        whole
            .detections
            .push(Detection { summary, posterior, first_solid, solids, class, ..Detection::default() })
            .unwrap();
        if solids > 0 {
            let centre_m = summary.centroid_m;
            whole.solids.push(Solid { centre_m, size_m: [1.0, 2.0, 3.0], ..Solid::default() }).unwrap();
        }
    }
    whole
}

/// One of each state at the end of the sweep, the first on alert; all but the coasting one were seen.
fn tracks(detections: &Detections) -> Box<TrackTable> {
    let mut table = TrackTable::new_box_zeroed().unwrap();
    table.time_ns = detections.header.sensor_time_ns + PERIOD_NS;
    let valid_until_ns = table.time_ns + 3 * PERIOD_NS;
    let states = [TrackState::Confirmed, TrackState::Tentative, TrackState::Coasting];
    for (place, (state, detection)) in states.into_iter().zip(&detections.detections).enumerate() {
        let (first_key, keys) = (table.keys.len() as u32, u32::from(state != TrackState::Coasting));
        if keys > 0 {
            table.keys.push(detection.summary.key).unwrap();
        }
        let track = Track {
            id: 1_025 + place as u64,
            valid_until_ns,
            position_m: detection.summary.centroid_m,
            velocity_mps: [0.5, 0.0, -0.25],
            size_m: [1.0, 2.0, 3.0],
            attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
            posterior: detection.posterior,
            approach: ClosestApproach { collision_probability: 0.5, ..ClosestApproach::default() },
            first_key,
            keys,
            state,
            class: detection.class,
            alert: u8::from(place == 0),
            ..Track::default()
        };
        table.tracks.push(track).unwrap();
    }
    table
}

impl Made {
    pub fn trace(&self, sector: u32, sectors: u32) -> Trace {
        let ordinal = self.number * u64::from(sectors) + u64::from(sector);
        let sensor_time_ns = self.sweep.header.sensor_time_ns;
        let part = Part { ordinal, sweep: self.number, sector, sectors, sensor_time_ns, ..Part::default() };
        Trace { part, due_ns: 1_000 + ordinal, ..Trace::default() }
    }

    /// The sweep's sectors as the source sends them.
    pub fn sweep_parts(&self, sectors: u32) -> Vec<(Trace, Box<Sweep>)> {
        let part = |sector| {
            let mut piece = Sweep::new_box_zeroed().unwrap();
            Cutter::new(sectors).fill(&self.sweep, sector, &mut piece);
            (self.trace(sector, sectors), piece)
        };
        (0..sectors).map(part).collect()
    }

    /// The detections as the last stage sends them: clusters spread over the sectors, not in order of key.
    pub fn detection_parts(&self, sectors: u32) -> Vec<(Trace, Box<Detections>)> {
        let part = |(sector, (trace, sweep)): (usize, (Trace, Box<Sweep>))| {
            let mut piece = Detections::new_box_zeroed().unwrap();
            piece.header = sweep.header;
            let here = |place: usize| (place * 7 + 3) % sectors as usize == sector;
            for (_, detection) in self.detections.detections.iter().enumerate().filter(|&(place, _)| here(place)) {
                let mut detection = *detection;
                let members = &self.detections.members[detection.summary.member_places()];
                detection.summary.first_member = piece.members.len() as u32;
                piece.members.extend_from_slice(members).unwrap();
                if let Some(place) = detection.solid_place() {
                    detection.first_solid = piece.solids.len() as u32;
                    piece.solids.push(self.detections.solids[place]).unwrap();
                }
                piece.detections.push(detection).unwrap();
            }
            (trace, piece)
        };
        self.sweep_parts(sectors).into_iter().enumerate().map(part).collect()
    }

    /// The tracks that come with a part: all with the last, none before.
    pub fn tracks_with(&self, trace: &Trace) -> Box<TrackTable> {
        let mut table = empty::<TrackTable>();
        if trace.part.is_last() {
            table.read_raw(&bytes(&*self.tracks)).unwrap();
        }
        table
    }
}

pub fn bytes(of: &impl Raw) -> Vec<u8> {
    let mut bytes = Vec::new();
    of.write_raw(&mut bytes);
    bytes
}

pub fn empty<M: Message>() -> Box<M> {
    M::new_box_zeroed().unwrap()
}

pub fn shipped() -> TapeFile {
    toml::from_str(include_str!("../../../../config/tape.toml")).unwrap()
}

pub fn settings(topics: &[Topic]) -> Settings {
    TapeFile { topics: topics.to_vec(), ..shipped() }.checked().unwrap()
}

pub fn about(sectors: u32) -> About {
    About {
        version: "0.1.0".into(),
        source: "scenes/x.toml".into(),
        sensor: "hdl-32e".into(),
        sectors,
        pace: "fast".into(),
        instance: "i".into(),
        deadline_ms: None,
    }
}

pub fn start(settings: Settings, path: &Path, sectors: u32) -> Tape {
    Tape::start(settings, path, about(sectors), None, UTC_NS).unwrap()
}

/// Hands over a whole sweep, its truth first, detections last.
pub fn give(tape: &mut Tape, made: &Made, sectors: u32) {
    let utc_ns = UTC_NS + made.number * PERIOD_NS;
    tape.truth(utc_ns, &made.trace(0, sectors), &made.truth);
    if sectors == 1 {
        tape.sweep(utc_ns, &made.trace(0, 1), &made.sweep);
        tape.detections(utc_ns, &made.trace(0, 1), &made.detections);
        tape.tracks(utc_ns, &made.trace(0, 1), &made.tracks);
        return;
    }
    for (trace, piece) in made.sweep_parts(sectors) {
        tape.sweep(utc_ns, &trace, &piece);
    }
    for (trace, piece) in made.detection_parts(sectors) {
        tape.detections(utc_ns, &trace, &piece);
        tape.tracks(utc_ns, &trace, &made.tracks_with(&trace));
    }
}

/// Hands over many sweeps that differ in number and time alone, as one part each.
pub fn give_many(tape: &mut Tape, numbers: std::ops::Range<u64>) {
    let mut made = made(numbers.start);
    for number in numbers {
        made.number = number;
        give(tape, &made, 1);
    }
}

/// A message as it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Read {
    pub topic: String,
    pub sequence: u32,
    pub log_time_ns: u64,
    pub utc_ns: u64,
    pub data: Vec<u8>,
}

/// All messages of bytes up to where they are torn, and whether they are.
pub fn read_bytes(bytes: &[u8]) -> (Vec<Read>, bool) {
    let mut read = Vec::new();
    let Ok(stream) = mcap::MessageStream::new_with_options(bytes, mcap::read::Options::IgnoreEndMagic.into()) else {
        return (read, true);
    };
    for message in stream {
        let Ok(message) = message else { return (read, true) };
        read.push(Read {
            topic: message.channel.topic.clone(),
            sequence: message.sequence,
            log_time_ns: message.log_time,
            utc_ns: message.publish_time,
            data: message.data.into_owned(),
        });
    }
    (read, mcap::Summary::read(bytes).is_err())
}

/// All messages of a whole file, which must agree with its summary.
pub fn read(path: &Path) -> Vec<Read> {
    let bytes = std::fs::read(path).unwrap();
    let (read, torn) = read_bytes(&bytes);
    assert!(!torn, "{}", path.display());
    let stats = mcap::Summary::read(&bytes).unwrap().unwrap().stats.unwrap();
    assert_eq!(stats.message_count, read.len() as u64);
    read
}

pub fn of(read: &[Read], topic: Topic) -> Vec<Read> {
    read.iter().filter(|read| read.topic == topic.name()).cloned().collect()
}

pub fn sequences(read: &[Read], topic: Topic) -> Vec<u32> {
    of(read, topic).iter().map(|read| read.sequence).collect()
}

/// The recordings in a folder, by name.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}
