use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::records::Record;
use messages::{Detections, Message, Raw, Sweep, Trace, TrackTable};
use zerocopy::FromZeros;

use crate::ViewError;
use crate::cloud::{self, Known};
use crate::paths::Paths;
use crate::records::{Records, Top, inner};
use crate::row::{Row, Spot, read_found, read_sweep, read_tracks};

const SWEEPS: &str = "/encke/raw/sweep";
const DETECTIONS: &str = "/encke/raw/detections";
const TRACKS: &str = "/encke/raw/tracks";
/// Name of the metadata record that says what was recorded.
const RUN: &str = "encke.run";
/// Faults of a file that are told in full.
const TOLD: usize = 8;

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
    paths: Paths,
    sweep: Box<Sweep>,
    detections: Box<Detections>,
    table: Box<TrackTable>,
}

/// What a channel carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Sweep,
    Detections,
    Tracks,
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
            paths: Paths::default(),
            sweep: Sweep::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            detections: Detections::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            table: TrackTable::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
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
        for spot in [row.cloud, row.found, row.table].into_iter().flatten() {
            let bytes = message(&mut self.records, spot).map_err(changed)?;
            let read = if Some(spot) == row.cloud {
                self.sweep.read_raw(&bytes)
            } else if Some(spot) == row.found {
                Trace::read_raw(&bytes).and_then(|(_, bytes)| self.detections.read_raw(bytes))
            } else {
                Trace::read_raw(&bytes).and_then(|(_, bytes)| self.table.read_raw(bytes))
            };
            read.map_err(|cause| changed(cause.to_string()))?;
        }
        let known = Known {
            number: row.sweep,
            sweep: row.cloud.map(|_| &*self.sweep),
            detections: row.found.map(|_| &*self.detections),
            tracks: row.table.map(|_| (&*self.table, &self.paths)),
        };
        cloud::encode(known, most_points).map_err(ViewError::Write)
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
                            (Some(Kind::Sweep), Some(row)) => read_sweep(&data, spot, &mut self.sweep, row)
                                .map(|()| self.paths.note_turn(header.sequence, &self.sweep.header)),
                            (Some(Kind::Detections), Some(row)) => read_found(&data, spot, &mut self.detections, row)
                                .map(|()| self.paths.note_turn(header.sequence, &self.detections.header)),
                            (Some(Kind::Tracks), Some(row)) => {
                                let read = read_tracks(&data, spot, &mut self.table, row);
                                if read.is_ok() && row.table.is_some() {
                                    self.paths.note(header.sequence, &self.table);
                                }
                                read
                            }
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
        self.rows = rows.filter(|row| row.cloud.or(row.found).or(row.table).is_some()).collect();
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
            TRACKS => (Kind::Tracks, TrackTable::TYPE),
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
