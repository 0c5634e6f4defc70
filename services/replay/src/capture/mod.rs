//! Where data packets come from: captures and MCAP files, one after the other, or a live sensor.

mod frame;
pub(crate) mod mcap;
mod records;
mod scan;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::live::Intake;
use crate::velodyne::{PACKET_BYTES, Packet};
use frame::Frame;
use mcap::Scans;
pub(crate) use records::is_capture;
use records::{Record, Records, Torn};

/// When and where a packet was recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    /// Host time [ns] since 1970, as far as the capture knows it.
    pub(crate) host_ns: u64,
    /// Its record in its file, or its number.
    pub(crate) place: Place,
}

/// What a capture gave.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Got {
    /// A datagram that is as long as a data packet.
    Packet(Arrival),
    /// Nothing yet: a live sensor is silent for now.
    Nothing,
    /// The end of the last file.
    End,
}

/// A source of data packets.
pub(crate) enum Capture {
    Files(Files),
    Live(Box<Intake>),
}

impl Capture {
    /// Packet captures that continue one another. Nothing is read before the first [`Capture::next`].
    pub(crate) fn pcap(files: Vec<PathBuf>) -> Self {
        Self::Files(Files { files, file: 0, is_mcap: false, reader: None })
    }

    /// MCAP files with packets that continue one another.
    pub(crate) fn mcap(files: Vec<PathBuf>) -> Self {
        Self::Files(Files { files, file: 0, is_mcap: true, reader: None })
    }

    /// Starts again with the first file. A live sensor knows no first packet.
    pub(crate) fn rewind(&mut self) {
        if let Self::Files(files) = self {
            files.file = 0;
            files.reader = None;
        }
    }

    /// The file being read, or the live sensor's address.
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Files(files) => files.path(),
            Self::Live(intake) => intake.path(),
        }
    }

    /// The next data packet, into `packet`.
    pub(crate) fn next(&mut self, packet: &mut Packet, faults: &mut Faults) -> Result<Got, ReplayError> {
        match self {
            Self::Files(files) => Ok(files.next(packet, faults)?.map_or(Got::End, Got::Packet)),
            Self::Live(intake) => Ok(intake.next(packet).map_or(Got::Nothing, Got::Packet)),
        }
    }
}

/// Files that continue one another.
pub(crate) struct Files {
    files: Vec<PathBuf>,
    /// Index of the file being read.
    file: usize,
    is_mcap: bool,
    reader: Option<Reader>,
}

enum Reader {
    Pcap(Box<Records<BufReader<File>>>),
    Mcap(Box<Scans>),
}

impl Files {
    fn path(&self) -> &Path {
        self.files.get(self.file).or(self.files.last()).map_or(Path::new(""), PathBuf::as_path)
    }

    fn next(&mut self, packet: &mut Packet, faults: &mut Faults) -> Result<Option<Arrival>, ReplayError> {
        while self.file < self.files.len() {
            if self.reader.is_none() && !self.open(faults)? {
                self.file += 1;
                continue;
            }
            let path = &self.files[self.file];
            let found = match &mut self.reader {
                Some(Reader::Pcap(records)) => next_record(records, path, packet, faults),
                Some(Reader::Mcap(scans)) => scans.next(path, packet, faults),
                None => None,
            };
            if found.is_some() {
                return Ok(found);
            }
            self.reader = None;
            self.file += 1;
        }
        Ok(None)
    }

    /// Opens the file at hand. A file that is no capture is an error when it is alone, else passed over.
    fn open(&mut self, faults: &mut Faults) -> Result<bool, ReplayError> {
        let path = &self.files[self.file];
        let opened = if self.is_mcap {
            Scans::open(path).map(|scans| Reader::Mcap(Box::new(scans)))
        } else {
            Records::open(path).map(|records| Reader::Pcap(Box::new(records)))
        };
        match opened {
            Ok(reader) => self.reader = Some(reader),
            Err(torn) if self.files.len() > 1 => {
                faults.note(Fault::BadFile, 1, path, Place::Byte(0), torn);
                return Ok(false);
            }
            Err(Torn::Io(source)) => return Err(ReplayError::Io { path: path.clone(), source }),
            Err(torn) => {
                let kinds = if self.is_mcap { "an .mcap" } else { "a .pcap or .pcapng" };
                let what = format!("{torn}; give {kinds} file");
                return Err(ReplayError::Malformed { path: path.clone(), place: Place::Byte(0), what });
            }
        }
        Ok(true)
    }
}

/// The next datagram of a packet capture that is as long as a data packet.
fn next_record(
    records: &mut Records<BufReader<File>>,
    path: &Path,
    packet: &mut Packet,
    faults: &mut Faults,
) -> Option<Arrival> {
    loop {
        let place = Place::Byte(records.offset());
        match records.next() {
            Ok(None) => return None,
            Ok(Some(Record::Other)) => {}
            Ok(Some(Record::Unknown)) => {
                faults.note(Fault::BadFrame, 1, path, place, "a packet of an interface that is not described");
            }
            Ok(Some(Record::Frame(link, host_ns, data))) => match frame::parse(link, data) {
                Frame::Udp(payload) if payload.len() == PACKET_BYTES => {
                    packet.bytes.copy_from_slice(payload);
                    return Some(Arrival { host_ns, place });
                }
                // Position packets and other traffic.
                Frame::Udp(_) | Frame::Other => {}
                Frame::Bad => {
                    let what = "the frame is cut off or cannot be taken apart";
                    faults.note(Fault::BadFrame, 1, path, place, what);
                }
            },
            Err(torn) => {
                faults.note(Fault::TornCapture, 1, path, place, torn);
                return None;
            }
        }
    }
}
