//! One MCAP file: schemas and channels, messages in chunks, a summary at its end.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};

use crate::Topic;
use crate::counts::{Tally, add};
use crate::names::PROFILE;
use crate::settings::{Compression, Settings};
use crate::sink::{Meter, Sink, Target};
use crate::topic::TOPICS;

/// Zstandard's level: twice the speed of the usual one, a tenth more bytes.
const ZSTD_LEVEL: u32 = 1;
/// Name of the metadata record that says of what run a file is.
const METADATA: &str = "encke.run";

/// What each file says of its run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// Of the executable.
    pub version: String,
    /// What the chain reads.
    pub source: String,
    /// Name of the sensor's model.
    pub sensor: String,
    /// Sectors that a sweep travels as.
    pub sectors: u32,
    /// `realtime` or `fast`.
    pub pace: String,
    /// Name of the chain's instance.
    pub instance: String,
    /// Longest allowed time from a sweep's last return to its detections [ms]; none where no clock paces the sweeps.
    pub deadline_ms: Option<f64>,
}

/// A file that is being written. Bytes leave with [`Reel::commit`]; after an error nothing more is written.
pub(crate) struct Reel {
    writer: Writer<Sink>,
    meter: Arc<Meter>,
    /// Channels by topic; those not asked for have none.
    channels: [Option<u16>; TOPICS],
    opened: bool,
    /// Of the open chunk.
    open: Tally,
    open_bytes: u64,
    committed: Tally,
}

impl Reel {
    /// Writes what stands before the first message. `number` is that of the file in its run.
    pub(crate) fn begin(
        target: Box<dyn Target>,
        settings: &Settings,
        about: &About,
        number: u64,
    ) -> Result<Self, io::Error> {
        let (compression, level) = match settings.compression {
            Compression::None => (None, 0),
            Compression::Lz4 => (Some(mcap::Compression::Lz4), 0),
            Compression::Zstd => (Some(mcap::Compression::Zstd), ZSTD_LEVEL),
        };
        let sink = Sink::new(target);
        let meter = sink.meter();
        // Chunks are made in memory and written whole, so that a tear is between or in records, never in their lengths.
        let options = WriteOptions::new()
            .profile(PROFILE)
            .library(format!("encke {}", about.version))
            .compression(compression)
            .compression_level(level)
            .compression_threads(0)
            .chunk_size(None)
            .disable_seeking(true);
        let mut writer = options.create(sink).map_err(unwrapped)?;
        writer.write_metadata(&metadata(about, number)).map_err(unwrapped)?;
        writer.flush().map_err(unwrapped)?;
        Ok(Self {
            writer,
            meter,
            channels: [None; TOPICS],
            opened: false,
            open: Tally::default(),
            open_bytes: 0,
            committed: Tally::default(),
        })
    }

    /// Adds a message to the open chunk; those of topics that were not asked for are left out.
    pub(crate) fn write(
        &mut self,
        settings: &Settings,
        topic: Topic,
        stamps: &Stamps,
        data: &[u8],
    ) -> Result<(), io::Error> {
        if !self.opened {
            // With the first message, in its chunk: one without messages would claim to be of the year 1970.
            self.open_channels(settings.topics()).map_err(unwrapped)?;
            self.opened = true;
        }
        let Some(channel_id) = self.channels[topic as usize] else { return Ok(()) };
        self.open[topic as usize] += 1;
        self.open_bytes += data.len() as u64;
        let header = MessageHeader {
            channel_id,
            sequence: stamps.sequence,
            log_time: stamps.log_time_ns,
            publish_time: stamps.utc_ns,
        };
        self.writer.write_to_known_channel(&header, data).map_err(unwrapped)
    }

    fn open_channels(&mut self, topics: &[Topic]) -> Result<(), McapError> {
        for &topic in topics {
            let schema = topic.schema();
            let schema = self.writer.add_schema(&schema.name, &schema.encoding, &schema.data)?;
            let (name, encoding) = (topic.name(), topic.message_encoding());
            let channel = self.writer.add_channel(schema, name, encoding, &BTreeMap::new())?;
            self.channels[topic as usize] = Some(channel);
        }
        Ok(())
    }

    /// Closes the open chunk and hands all bytes to the system.
    pub(crate) fn commit(&mut self) -> Result<(), io::Error> {
        if self.open == Tally::default() {
            return Ok(());
        }
        self.writer.flush().map_err(unwrapped)?;
        add(&mut self.committed, &self.open);
        (self.open, self.open_bytes) = (Tally::default(), 0);
        Ok(())
    }

    /// Commits and writes the summary. Gives what the file holds, and why it is not complete if it is not.
    pub(crate) fn finish(mut self) -> (Closed, Result<(), io::Error>) {
        let result = self.commit().and_then(|()| self.writer.finish().map(drop).map_err(unwrapped));
        self.close(result)
    }

    /// Leaves the file as it is after an error: whole up to the latest commit.
    pub(crate) fn give_up(self) -> Closed {
        self.close(Err(io::ErrorKind::Other.into())).0
    }

    fn close(self, result: Result<(), io::Error>) -> (Closed, Result<(), io::Error>) {
        let mut sink = self.writer.into_inner();
        let result = result.and_then(|()| io::Write::flush(&mut sink));
        (Closed { bytes: self.meter.committed(), messages: self.committed, lost: self.open }, result)
    }

    /// Messages that are in the system's hands.
    pub(crate) fn committed(&self) -> &Tally {
        &self.committed
    }

    /// Bytes of the open chunk's messages, before compression.
    pub(crate) fn open_bytes(&self) -> u64 {
        self.open_bytes
    }

    /// Bytes that are in the system's hands.
    pub(crate) fn bytes(&self) -> u64 {
        self.meter.committed()
    }
}

/// What a file holds that is no longer written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Closed {
    pub(crate) bytes: u64,
    pub(crate) messages: Tally,
    /// Messages of a chunk that could not be written.
    pub(crate) lost: Tally,
}

/// What stands beside a message.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stamps {
    /// Sensor time [ns].
    pub(crate) log_time_ns: u64,
    /// The host's UTC [ns].
    pub(crate) utc_ns: u64,
    /// The sweep, or the number among its kind.
    pub(crate) sequence: u32,
}

fn metadata(about: &About, number: u64) -> Metadata {
    let mut pairs = vec![
        ("version", about.version.clone()),
        ("source", about.source.clone()),
        ("sensor", about.sensor.clone()),
        ("sectors", about.sectors.to_string()),
        ("pace", about.pace.clone()),
        ("instance", about.instance.clone()),
        ("part", number.to_string()),
    ];
    pairs.extend(about.deadline_ms.map(|deadline_ms| ("deadline_ms", deadline_ms.to_string())));
    Metadata { name: METADATA.into(), metadata: pairs.into_iter().map(|(key, value)| (key.into(), value)).collect() }
}

fn unwrapped(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
