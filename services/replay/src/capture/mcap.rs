//! Data packets in MCAP files: messages `velodyne_msgs/msg/VelodyneScan`.
//!
//! The file's own records are stepped over one by one, so that a chunk that is torn costs no more than itself and can be
//! named by its offset; what is in a chunk is taken out by the `mcap` crate. Memory is bounded whatever lengths claim.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use super::Arrival;
use super::records::Torn;
use super::scan::{Encoding, Scan};
use crate::error::Place;
use crate::faults::{Fault, Faults};
use crate::velodyne::Packet;

/// Longest record, and longest chunk before and after compression, that is read [bytes].
const MAX_BYTES: usize = 64 << 20;
/// Opcode and length of a record [bytes].
const RECORD_HEAD: u64 = 9;
/// Channel, sequence and two times of a message [bytes].
const MESSAGE_HEAD: usize = 22;
/// Chunks that are looked into for topics where the file has no summary.
const PROBED_CHUNKS: usize = 16;

const SCANS: [&str; 2] = ["velodyne_msgs/msg/VelodyneScan", "velodyne_msgs/VelodyneScan"];
const CLOUDS: [&str; 3] = ["sensor_msgs/msg/PointCloud2", "sensor_msgs/PointCloud2", "foxglove.PointCloud"];

/// Whether a file that begins with `head` is an MCAP file.
pub(crate) fn is_mcap(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Whether an MCAP file holds Velodyne packets and no point clouds, which would be ready to use.
///
/// By its summary, or where it has none (a torn file) by its first chunks.
///
/// # Errors
/// The file cannot be read.
pub(crate) fn has_packets(path: &Path) -> io::Result<bool> {
    for chunks in [0, PROBED_CHUNKS] {
        let mut scans = match Scans::open(path) {
            Ok(scans) => scans,
            Err(Torn::Io(error)) => return Err(error),
            Err(_) => return Ok(false),
        };
        scans.look_for_topics(chunks);
        if scans.topics.channel.is_some() || scans.topics.has_clouds {
            return Ok(scans.topics.channel.is_some() && !scans.topics.has_clouds);
        }
    }
    Ok(false)
}

/// What the file's schemas and channels say.
#[derive(Debug, Default)]
struct Topics {
    /// Schemas of scans, and of clouds.
    scans: Vec<u16>,
    clouds: Vec<u16>,
    has_clouds: bool,
    /// The first channel with scans: the one that is read.
    channel: Option<(u16, Encoding)>,
    /// Another one was found, and named.
    has_second: bool,
}

impl Topics {
    /// Takes note of a schema or channel.
    fn note(&mut self, opcode: u8, body: &[u8]) {
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header, .. }) => {
                let list = if SCANS.contains(&header.name.as_str()) {
                    &mut self.scans
                } else if CLOUDS.contains(&header.name.as_str()) {
                    &mut self.clouds
                } else {
                    return;
                };
                if !list.contains(&header.id) {
                    list.push(header.id);
                }
            }
            Ok(Record::Channel(channel)) => {
                self.has_clouds |= self.clouds.contains(&channel.schema_id);
                if !self.scans.contains(&channel.schema_id) {
                    return;
                }
                let encoding = match channel.message_encoding.as_str() {
                    "cdr" => Encoding::Cdr,
                    "ros1" => Encoding::Ros1,
                    _ => return,
                };
                let (first, _) = *self.channel.get_or_insert((channel.id, encoding));
                if first != channel.id && !self.has_second {
                    self.has_second = true;
                    let topic = channel.topic;
                    tracing::warn!(topic, "another sensor's packets in the same file; the first topic is read");
                }
            }
            _ => {}
        }
    }
}

/// A chunk that is being read.
struct Chunk {
    reader: LinearReader,
    /// Offset of its record [bytes].
    offset: u64,
    /// Bytes of it that are not handed to `reader` yet.
    left: u64,
    /// The file ends inside it.
    is_torn: bool,
}

/// Data packets of one MCAP file.
pub(crate) struct Scans {
    file: BufReader<File>,
    /// Length of the file [bytes].
    length: u64,
    /// Where `file` stands [bytes].
    at: u64,
    /// Offset of the next record of the file [bytes].
    next: u64,
    chunk: Option<Chunk>,
    body: Vec<u8>,
    topics: Topics,
    scan: Scan,
    /// Log time [ns] and place of the message at hand.
    scan_ns: u64,
    scan_place: Place,
    is_done: bool,
}

/// What a step over the file found.
enum Found {
    /// A record that was taken in.
    Record,
    /// A message with packets.
    Scan,
    End,
}

impl Scans {
    pub(super) fn open(path: &Path) -> Result<Self, Torn> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut magic = [0; MAGIC.len()];
        if file.read_exact(&mut magic).is_err() || !is_mcap(&magic) {
            return Err(Torn::Header);
        }
        let at = MAGIC.len() as u64;
        Ok(Self {
            file,
            length,
            at,
            next: at,
            chunk: None,
            body: Vec::new(),
            topics: Topics::default(),
            scan: Scan::default(),
            scan_ns: 0,
            scan_place: Place::Byte(0),
            is_done: false,
        })
    }

    /// The next data packet; nothing at the end of the file.
    pub(super) fn next(&mut self, path: &Path, packet: &mut Packet, faults: &mut Faults) -> Option<Arrival> {
        loop {
            match self.scan.next(packet) {
                Some(Ok(stamp_ns)) => {
                    let host_ns = if stamp_ns == 0 { self.scan_ns } else { stamp_ns };
                    return Some(Arrival { host_ns, place: self.scan_place });
                }
                Some(Err(what)) => faults.note(Fault::BadFrame, 1, path, self.scan_place, what),
                None => {}
            }
            if let Found::End = self.step(path, faults) {
                return None;
            }
        }
    }

    /// Takes note of schemas and channels outside of chunks, and in the first `chunks`.
    fn look_for_topics(&mut self, mut chunks: usize) {
        let mut faults = Faults::muted();
        while !self.is_done {
            let is_in_chunk = self.chunk.is_some();
            if let Found::End = self.step(Path::new(""), &mut faults) {
                return;
            }
            if !is_in_chunk && self.chunk.is_some() {
                if chunks == 0 {
                    self.chunk = None;
                } else {
                    chunks -= 1;
                }
            }
        }
    }

    /// Steps over one record, of the chunk at hand or of the file.
    fn step(&mut self, path: &Path, faults: &mut Faults) -> Found {
        if self.chunk.is_some() {
            return self.step_in_chunk(path, faults);
        }
        if self.is_done {
            return Found::End;
        }
        let place = Place::Byte(self.next);
        match self.step_in_file() {
            Ok(found) => found,
            Err(Problem::Scan(what)) => {
                faults.note(Fault::BadFrame, 1, path, place, what);
                Found::Record
            }
            Err(Problem::Torn(torn)) => {
                self.is_done = true;
                faults.note(Fault::TornCapture, 1, path, place, torn);
                Found::End
            }
        }
    }

    fn step_in_file(&mut self) -> Result<Found, Problem> {
        let offset = self.next;
        self.go_to(offset)?;
        let mut head = [0; RECORD_HEAD as usize];
        if self.length.saturating_sub(offset) < RECORD_HEAD {
            return Err(Torn::Ends.into());
        }
        self.read(&mut head)?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        let left = self.length - self.at;
        let is_torn = length > left;
        match opcode {
            op::CHUNK => {
                let options = LinearReaderOptions::default()
                    .with_skip_start_magic(true)
                    .with_skip_end_magic(true)
                    .with_record_length_limit(MAX_BYTES)
                    // What is left of a torn chunk has no checksum.
                    .with_prevalidate_chunk_crcs(!is_torn);
                let mut reader = LinearReader::new_with_options(options);
                reader.insert(head.len()).copy_from_slice(&head);
                reader.notify_read(head.len());
                self.chunk = Some(Chunk { reader, offset, left: length.min(left), is_torn });
                self.next = self.at + length.min(left);
                self.is_done |= is_torn;
                Ok(Found::Record)
            }
            _ if is_torn => Err(Torn::Ends.into()),
            op::SCHEMA | op::CHANNEL | op::MESSAGE if length > MAX_BYTES as u64 => Err(Torn::Length(length).into()),
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                self.next = self.at + length;
                let mut body = std::mem::take(&mut self.body);
                body.resize(length as usize, 0);
                let read = self.read(&mut body);
                let found = read.and_then(|()| self.take(opcode, &body, offset));
                self.body = body;
                found
            }
            op::FOOTER => {
                self.is_done = true;
                Ok(Found::Record)
            }
            _ => {
                self.next = self.at + length;
                Ok(Found::Record)
            }
        }
    }

    fn step_in_chunk(&mut self, path: &Path, faults: &mut Faults) -> Found {
        let Some(mut chunk) = self.chunk.take() else { return Found::Record };
        let place = Place::Byte(chunk.offset);
        loop {
            let (wanted, problem) = match chunk.reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => (wanted, None),
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    let found = take(&mut self.topics, &mut self.scan, opcode, data);
                    match found {
                        Ok(Some(log_ns)) => (self.scan_ns, self.scan_place) = (log_ns, place),
                        Ok(None) => {}
                        Err(what) => faults.note(Fault::BadFrame, 1, path, place, what),
                    }
                    let is_scan = matches!(found, Ok(Some(_)));
                    self.chunk = Some(chunk);
                    return if is_scan { Found::Scan } else { Found::Record };
                }
                // The end of the chunk.
                None => return Found::Record,
                Some(Err(_)) if chunk.is_torn && chunk.left == 0 => {
                    (0, Some("the file ends inside a chunk".to_owned()))
                }
                Some(Err(error)) => (0, Some(describe(&error))),
            };
            if let Some(what) = problem {
                faults.note(Fault::TornCapture, 1, path, place, what);
                return Found::Record;
            }
            let count = (wanted as u64).min(chunk.left) as usize;
            if count > 0 && self.read(chunk.reader.insert(count)).is_err() {
                faults.note(Fault::TornCapture, 1, path, place, Torn::Ends);
                return Found::Record;
            }
            // Nothing left tells the reader that the chunk has ended.
            chunk.reader.notify_read(count);
            chunk.left -= count as u64;
        }
    }

    /// Takes in a record of the file.
    fn take(&mut self, opcode: u8, body: &[u8], offset: u64) -> Result<Found, Problem> {
        match take(&mut self.topics, &mut self.scan, opcode, body) {
            Ok(Some(log_ns)) => {
                (self.scan_ns, self.scan_place) = (log_ns, Place::Byte(offset));
                Ok(Found::Scan)
            }
            Ok(None) => Ok(Found::Record),
            Err(what) => Err(Problem::Scan(what)),
        }
    }

    fn go_to(&mut self, offset: u64) -> io::Result<()> {
        // Files are shorter than 2^63 bytes.
        self.file.seek_relative(offset as i64 - self.at as i64)?;
        self.at = offset;
        Ok(())
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<(), Problem> {
        self.file.read_exact(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

/// Why a record of the file is of no use.
enum Problem {
    /// The file cannot be read on.
    Torn(Torn),
    /// A message is not a scan.
    Scan(&'static str),
}

impl From<Torn> for Problem {
    fn from(torn: Torn) -> Self {
        Self::Torn(torn)
    }
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Torn(Torn::Io(error))
    }
}

/// Takes in a schema, a channel, or a message with packets, of which it gives the log time [ns].
fn take(topics: &mut Topics, scan: &mut Scan, opcode: u8, body: &[u8]) -> Result<Option<u64>, &'static str> {
    match opcode {
        op::SCHEMA | op::CHANNEL => topics.note(opcode, body),
        op::MESSAGE => {
            let Some((&[a, b, _, _, _, _, ref log @ ..], data)) = body.split_first_chunk::<MESSAGE_HEAD>() else {
                return Err("a message ends inside its header");
            };
            let channel = u16::from_le_bytes([a, b]);
            let Some((_, encoding)) = topics.channel.filter(|(id, _)| *id == channel) else { return Ok(None) };
            scan.take(encoding, data)?;
            return Ok(log.first_chunk().map(|log| u64::from_le_bytes(*log)));
        }
        _ => {}
    }
    Ok(None)
}

/// What is wrong with a chunk, in the words of a fault.
fn describe(error: &McapError) -> String {
    match error {
        McapError::BadChunkCrc { saved, calculated } => {
            format!("a chunk's checksum is {calculated:08x}, must be {saved:08x}: the chunk is left out")
        }
        McapError::ChunkTooLarge(bytes) => {
            format!("a chunk claims {bytes} bytes, more than {MAX_BYTES}: it is left out")
        }
        McapError::RecordTooLarge { len, .. } => {
            format!("a record in a chunk claims {len} bytes, more than {MAX_BYTES}: the rest of the chunk is left out")
        }
        McapError::UnsupportedCompression(name) => {
            format!("a chunk is compressed with {name}, must be zstd or lz4: it is left out")
        }
        error => format!("a chunk cannot be read on: {error}"),
    }
}
