//! Messages of one topic, in the order of the files.

use std::path::{Path, PathBuf};

use ::mcap::records::op;

use super::records::{Found, Records};
use super::topics::{Channels, Choice, Kind};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// Channel, sequence, time of logging and of publication [bytes].
const HEAD_BYTES: usize = 22;

/// A message as it was logged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Message<'a> {
    /// Time at which it was logged [ns].
    pub(crate) log_time_ns: u64,
    /// Number that its sender gave it.
    pub(crate) sequence: u32,
    /// Its file goes on with the run of one before it, whose last messages it may hold again.
    pub(crate) goes_on: bool,
    pub(crate) data: &'a [u8],
}

/// Messages of one topic of files that continue one another.
pub(crate) struct Messages {
    files: Vec<PathBuf>,
    /// File being read.
    file: usize,
    records: Option<Records>,
    channels: Channels,
    choice: Choice,
    /// Where the message last read stands in its file [bytes].
    offset: u64,
}

impl Messages {
    /// Looks which topics the first file has that can be read, and takes the `wanted` one or the one that holds sweeps.
    pub(crate) fn open(files: Vec<PathBuf>, wanted: Option<&str>) -> Result<Self, ReplayError> {
        let mut first_error = None;
        for path in &files {
            match channels(path, wanted).and_then(|channels| channels.choose(path, wanted)) {
                Ok(choice) => {
                    let channels = Channels::default();
                    return Ok(Self { files, file: 0, records: None, channels, choice, offset: 0 });
                }
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        let none = || ReplayError::Empty { path: PathBuf::new(), what: "no file".to_owned() };
        Err(first_error.unwrap_or_else(none))
    }

    /// What the messages are.
    pub(crate) fn kind(&self) -> Kind {
        self.choice.kind
    }

    /// The topic that is read.
    pub(crate) fn topic(&self) -> &str {
        &self.choice.topic
    }

    /// Starts again with the first file.
    pub(crate) fn rewind(&mut self) {
        self.file = 0;
        self.records = None;
    }

    /// File and place of the message last read; of one in a chunk, the chunk's.
    pub(crate) fn place(&self) -> (&Path, Place) {
        let path = self.files.get(self.file).or(self.files.last()).map_or(Path::new(""), PathBuf::as_path);
        (path, Place::Byte(self.offset))
    }

    /// The next message; none after the last. Files that cannot be read are passed over and counted.
    pub(crate) fn next(&mut self, faults: &mut Faults) -> Option<Message<'_>> {
        let found = loop {
            let path = self.files.get(self.file)?;
            if self.records.is_none() {
                self.channels = Channels::default();
                self.records = Records::open(path).inspect_err(|error| note(faults, path, error)).ok();
            }
            match self
                .records
                .as_mut()
                .and_then(|records| next(records, path, &mut self.channels, &self.choice, faults))
            {
                Some(found) => break found,
                None => {
                    self.records = None;
                    self.file += 1;
                }
            }
        };
        self.offset = found.offset;
        let data = self.records.as_ref()?.data(&found);
        let log_time_ns = u64::from_le_bytes(data.get(6..14)?.try_into().ok()?);
        let sequence = u32::from_le_bytes(data.get(2..6)?.try_into().ok()?);
        Some(Message { log_time_ns, sequence, goes_on: self.channels.goes_on(), data: data.get(HEAD_BYTES..)? })
    }
}

fn note(faults: &mut Faults, path: &Path, error: &std::io::Error) {
    faults.note(Fault::BadFile, 1, path, Place::Byte(0), error);
}

/// The next message of the topic in a file.
fn next(
    records: &mut Records,
    path: &Path,
    channels: &mut Channels,
    choice: &Choice,
    faults: &mut Faults,
) -> Option<Found> {
    loop {
        let found = records.next(path, faults)?;
        let data = records.data(&found);
        if found.opcode != op::MESSAGE {
            channels.learn(found.opcode, data);
            continue;
        }
        match data.first_chunk::<2>().filter(|_| data.len() >= HEAD_BYTES) {
            Some(&id) if channels.is(u16::from_le_bytes(id), choice) => return Some(found),
            Some(_) => {}
            None => {
                let what = format!("a message of {} bytes, must have at least {HEAD_BYTES}", data.len());
                faults.note(Fault::BadMessage, 1, path, Place::Byte(found.offset), what);
            }
        }
    }
}

/// The channels of a file: by its summary, else by its data.
fn channels(path: &Path, wanted: Option<&str>) -> Result<Channels, ReplayError> {
    let mut channels = Channels::default();
    let mut muted = Faults::muted();
    if let Some(mut records) = Records::summary(path) {
        while let Some(found) = records.next(path, &mut muted) {
            channels.learn(found.opcode, records.data(&found));
        }
        if channels.choose(path, wanted).is_ok() {
            return Ok(channels);
        }
    }
    let mut records = Records::open(path).map_err(|source| {
        if source.kind() == std::io::ErrorKind::InvalidData {
            let what = format!("{source}; give a .mcap file");
            return ReplayError::Malformed { path: path.to_owned(), place: Place::Byte(0), what };
        }
        ReplayError::Io { path: path.to_owned(), source }
    })?;
    while let Some(found) = records.next(path, &mut muted) {
        if channels.learn(found.opcode, records.data(&found)) && channels.is_clear(wanted) {
            break;
        }
    }
    Ok(channels)
}
