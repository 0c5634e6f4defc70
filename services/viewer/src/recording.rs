use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use messages::{Detections, Message, Raw, Sweep, Trace};
use zerocopy::FromZeros;

use crate::ViewError;
use crate::cloud;
use crate::records::{Records, Top, inner};

const SWEEPS: &str = "/encke/raw/sweep";
const DETECTIONS: &str = "/encke/raw/detections";
/// Name of the metadata record that says what was recorded.
const RUN: &str = "encke.run";
/// Classes, `Unclassified` at 0.
const CLASSES: usize = 5;
/// Faults of a file that are told in full.
const TOLD: usize = 8;

/// Where a message lies: offset of its top-level record in the file, and its place among that record's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Spot {
    record: u64,
    message: usize,
}

/// What is known of a sweep without drawing it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Number of the sweep in its run.
    pub sweep: u32,
    /// Sensor time of its first firing [ns].
    pub sensor_time_ns: u64,
    /// Accepted returns; 0 where the recording lost the sweep.
    pub returns: u32,
    /// Obstacles by class, as `ObstacleClass` numbers them.
    pub classes: [u32; CLASSES],
    /// Last return to last detection [ns]; none where the recording lost the detections.
    pub latency_ns: Option<u64>,
    /// Number of the step of degradation at which it was made.
    pub step: u32,
    /// Whether the whole turn was seen.
    pub complete: bool,
    cloud: Option<Spot>,
    found: Option<Spot>,
}

/// Which sweeps to show: `sweeps` from `first` on, every `every`-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Place of the first among the recording's, from 0.
    pub first: usize,
    /// Most sweeps looked at from there on.
    pub sweeps: usize,
    /// 1 = all of them; 0 counts as 1.
    pub every: usize,
}

impl Default for Selection {
    fn default() -> Self {
        Self { first: 0, sweeps: usize::MAX, every: 1 }
    }
}

/// A recording that was looked through once: what it holds of each sweep, and where.
pub struct Recording {
    path: PathBuf,
    records: Records,
    channels: BTreeMap<u16, Kind>,
    rows: Vec<Row>,
    run: BTreeMap<String, String>,
    damage: Vec<String>,
    sweep: Box<Sweep>,
    detections: Box<Detections>,
}

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Sweep,
    Detections,
}

impl Recording {
    /// Looks through the whole file. What is intact is kept; what is not is in [`Recording::damage`].
    ///
    /// # Errors
    /// A file that cannot be read, is no MCAP, or holds no sweeps of this Encke's layout.
    pub fn open(path: &Path) -> Result<Self, ViewError> {
        let file = File::open(path).map_err(|cause| ViewError::read(path, cause))?;
        let records = Records::open(file).map_err(|cause| ViewError::read(path, cause))?;
        let Some(records) = records else { return Err(ViewError::NotMcap { path: path.to_owned() }) };
        let mut recording = Self {
            path: path.to_owned(),
            records,
            channels: BTreeMap::new(),
            rows: Vec::new(),
            run: BTreeMap::new(),
            damage: Vec::new(),
            sweep: Sweep::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            detections: Detections::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
        };
        recording.look_through()?;
        Ok(recording)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// All sweeps, by number.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// What the file says of its run, word by word as it stands there.
    pub fn run(&self) -> &BTreeMap<String, String> {
        &self.run
    }

    /// What could not be read, in words; empty for an intact file.
    pub fn damage(&self) -> &[String] {
        &self.damage
    }

    /// Places in [`Recording::rows`] of the sweeps selected.
    ///
    /// # Errors
    /// None is selected.
    pub fn select(&self, selection: Selection) -> Result<Vec<usize>, ViewError> {
        let end = selection.first.saturating_add(selection.sweeps).min(self.rows.len());
        let places: Vec<usize> = (selection.first..end).step_by(selection.every.max(1)).collect();
        if places.is_empty() {
            return Err(ViewError::NothingSelected { path: self.path.clone(), sweeps: self.rows.len() });
        }
        Ok(places)
    }

    /// The sweep at a place in [`Recording::rows`], as the page reads it, with at most so many returns.
    ///
    /// # Errors
    /// The file is not what it was when it was looked through. A place that is none counts as that too.
    pub fn encoded(&mut self, place: usize, most_points: usize) -> Result<Vec<u8>, ViewError> {
        let row = self.rows.get(place).cloned().unwrap_or_default();
        let changed = |cause: String| ViewError::Changed { path: self.path.clone(), sweep: row.sweep, cause };
        for spot in [row.cloud, row.found].into_iter().flatten() {
            let bytes = message(&mut self.records, spot).map_err(changed)?;
            let read = if Some(spot) == row.cloud {
                self.sweep.read_raw(&bytes)
            } else {
                Trace::read_raw(&bytes).and_then(|(_, bytes)| self.detections.read_raw(bytes))
            };
            read.map_err(|cause| changed(cause.to_string()))?;
        }
        let sweep = row.cloud.map(|_| &*self.sweep);
        let detections = row.found.map(|_| &*self.detections);
        cloud::encode(sweep, detections, most_points).map_err(ViewError::Write)
    }

    fn look_through(&mut self) -> Result<(), ViewError> {
        let mut found = Found::default();
        loop {
            let top = self.records.next().map_err(|cause| ViewError::read(&self.path, cause))?;
            let offset = match top {
                Top::Record { offset } => offset,
                Top::End => break,
                Top::Torn(cause) => {
                    self.damage.push(cause);
                    break;
                }
            };
            let mut place = 0;
            let read = inner(self.records.bytes(), |record| {
                let spot = Spot { record: offset, message: place };
                place += usize::from(matches!(record, Record::Message { .. }));
                match record {
                    Record::Schema { header, .. } => drop(found.schemas.insert(header.id, header.name)),
                    Record::Channel(channel) => found.channel(channel, &mut self.channels),
                    Record::Metadata(metadata) if metadata.name == RUN => self.run = metadata.metadata,
                    Record::Message { header, data } => {
                        let kind = self.channels.get(&header.channel_id);
                        let row = kind.map(|_| found.rows.entry(header.sequence).or_default());
                        let read = match (kind, row) {
                            (Some(Kind::Sweep), Some(row)) => read_sweep(&data, spot, &mut self.sweep, row),
                            (Some(Kind::Detections), Some(row)) => read_found(&data, spot, &mut self.detections, row),
                            _ => Ok(()),
                        };
                        if let Err(cause) = read {
                            let sweep = header.sequence;
                            self.damage.push(format!("sweep {sweep}, in the record at byte {offset}: {cause}"));
                        }
                    }
                    _ => (),
                }
            });
            if let Err(cause) = read {
                self.damage.push(format!("the record at byte {offset} is left out: {cause}"));
            }
        }
        self.settle(found)
    }

    fn settle(&mut self, found: Found) -> Result<(), ViewError> {
        let path = self.path.clone();
        let rows = found.rows.into_iter().map(|(sweep, row)| Row { sweep, ..row });
        self.rows = rows.filter(|row| row.cloud.is_some() || row.found.is_some()).collect();
        if self.damage.len() > TOLD {
            let more = self.damage.len() - TOLD;
            self.damage.truncate(TOLD);
            self.damage.push(format!("and {more} more"));
        }
        if !self.rows.is_empty() {
            return Ok(());
        }
        if let Some((topic, found, expected)) = found.foreign {
            return Err(ViewError::Layout { path, topic, found, expected });
        }
        let topics: Vec<&str> = found.topics.iter().map(String::as_str).collect();
        let found = match (topics.as_slice(), self.damage.first()) {
            ([], Some(damage)) => format!("damage: {damage}"),
            ([], None) => "no messages".to_owned(),
            (topics, _) => topics.join(", "),
        };
        Err(ViewError::NoSweeps { path, found })
    }
}

/// What was found so far.
#[derive(Default)]
struct Found {
    schemas: BTreeMap<u16, String>,
    topics: std::collections::BTreeSet<String>,
    /// Topic, layout found, layout known.
    foreign: Option<(String, String, &'static str)>,
    rows: BTreeMap<u32, Row>,
}

impl Found {
    fn channel(&mut self, channel: mcap::records::Channel, channels: &mut BTreeMap<u16, Kind>) {
        let (kind, expected) = match channel.topic.as_str() {
            SWEEPS => (Kind::Sweep, Sweep::TYPE),
            DETECTIONS => (Kind::Detections, Detections::TYPE),
            _ => {
                self.topics.insert(channel.topic);
                return;
            }
        };
        match self.schemas.get(&channel.schema_id) {
            Some(name) if name == expected => drop(channels.insert(channel.id, kind)),
            other => {
                let found = other.map_or("of no schema", String::as_str).to_owned();
                self.foreign.get_or_insert((channel.topic, found, expected));
            }
        }
    }
}

fn read_sweep(bytes: &[u8], spot: Spot, sweep: &mut Sweep, row: &mut Row) -> Result<(), messages::RawError> {
    sweep.read_raw(bytes)?;
    note_sweep(sweep, row);
    row.cloud = Some(spot);
    Ok(())
}

fn read_found(bytes: &[u8], spot: Spot, found: &mut Detections, row: &mut Row) -> Result<(), messages::RawError> {
    let (trace, bytes) = Trace::read_raw(bytes)?;
    found.read_raw(bytes)?;
    note_detections(&trace, found, row.cloud.is_some(), row);
    row.found = Some(spot);
    Ok(())
}

/// Puts down what is known of a whole sweep.
pub(crate) fn note_sweep(sweep: &Sweep, row: &mut Row) {
    row.sensor_time_ns = sweep.header.sensor_time_ns;
    row.complete = sweep.header.is_complete();
    row.returns = sweep.returns.len() as u32;
}

/// Puts down what was found in a whole sweep; what the sweep itself says of it where that is not known.
pub(crate) fn note_detections(trace: &Trace, found: &Detections, has_sweep: bool, row: &mut Row) {
    if !has_sweep {
        row.sensor_time_ns = found.header.sensor_time_ns;
        row.complete = found.header.is_complete();
    }
    row.classes = [0; CLASSES];
    for detection in &found.detections {
        row.classes[detection.class as usize] += 1;
    }
    row.latency_ns = trace.hops().last().map(|hop| hop.finished_ns.saturating_sub(trace.due_ns));
    row.step = trace.part.step;
}

/// The bytes of a message.
fn message(records: &mut Records, spot: Spot) -> Result<Vec<u8>, String> {
    records.again(spot.record).map_err(|cause| cause.to_string())?;
    let (mut place, mut bytes) = (0, None);
    inner(records.bytes(), |record| {
        if let Record::Message { data, .. } = record {
            if place == spot.message {
                bytes = Some(data.into_owned());
            }
            place += 1;
        }
    })?;
    bytes.ok_or_else(|| "it is not there any more".to_owned())
}
