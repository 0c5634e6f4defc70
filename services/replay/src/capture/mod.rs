//! Packet captures, one file after the other: from records to data packets.

mod frame;
mod records;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::velodyne::{PACKET_BYTES, Packet};
use frame::Frame;
pub(crate) use records::is_capture;
use records::{Record, Records, Torn};

/// When and where a packet was recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    /// Host time [ns] since 1970, as far as the capture knows it.
    pub(crate) host_ns: u64,
    /// Offset of its record in its file [bytes].
    pub(crate) offset: u64,
}

/// Captures that continue one another.
pub(crate) struct Capture {
    files: Vec<PathBuf>,
    /// Index of the file being read.
    file: usize,
    records: Option<Records<BufReader<File>>>,
}

impl Capture {
    /// Nothing is read before the first [`Capture::next`].
    pub(crate) fn new(files: Vec<PathBuf>) -> Self {
        Self { files, file: 0, records: None }
    }

    /// Starts again with the first file.
    pub(crate) fn rewind(&mut self) {
        self.file = 0;
        self.records = None;
    }

    /// The file being read.
    pub(crate) fn path(&self) -> &Path {
        self.files.get(self.file).or(self.files.last()).map_or(Path::new(""), PathBuf::as_path)
    }

    /// The next datagram that is as long as a data packet, into `packet`; nothing after the last file.
    pub(crate) fn next(&mut self, packet: &mut Packet, faults: &mut Faults) -> Result<Option<Arrival>, ReplayError> {
        while self.file < self.files.len() {
            if self.records.is_none() && !self.open(faults)? {
                self.file += 1;
                continue;
            }
            if let Some(arrival) = self.next_of_file(packet, faults) {
                return Ok(Some(arrival));
            }
            self.records = None;
            self.file += 1;
        }
        Ok(None)
    }

    /// Opens the file at hand. A file that is no capture is an error when it is alone, else passed over.
    fn open(&mut self, faults: &mut Faults) -> Result<bool, ReplayError> {
        let path = &self.files[self.file];
        match Records::open(path) {
            Ok(records) => self.records = Some(records),
            Err(torn) if self.files.len() > 1 => {
                faults.note(Fault::BadFile, 1, path, Place::Byte(0), torn);
                return Ok(false);
            }
            Err(Torn::Io(source)) => return Err(ReplayError::Io { path: path.clone(), source }),
            Err(torn) => {
                let what = format!("{torn}; give a .pcap or .pcapng file");
                return Err(ReplayError::Malformed { path: path.clone(), place: Place::Byte(0), what });
            }
        }
        Ok(true)
    }

    fn next_of_file(&mut self, packet: &mut Packet, faults: &mut Faults) -> Option<Arrival> {
        let path = self.files.get(self.file)?;
        let records = self.records.as_mut()?;
        loop {
            let offset = records.offset();
            let place = Place::Byte(offset);
            match records.next() {
                Ok(None) => return None,
                Ok(Some(Record::Other)) => {}
                Ok(Some(Record::Unknown)) => {
                    faults.note(Fault::BadFrame, 1, path, place, "a packet of an interface that is not described");
                }
                Ok(Some(Record::Frame(link, host_ns, data))) => match frame::parse(link, data) {
                    Frame::Udp(payload) if payload.len() == PACKET_BYTES => {
                        packet.bytes.copy_from_slice(payload);
                        return Some(Arrival { host_ns, offset });
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
}
