//! Records of one file in order, those of its chunks among them.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use ::mcap::records::op;

use super::MAGIC;
use super::chunk::Unpacker;
use crate::error::Place;
use crate::faults::{Fault, Faults};

/// Opcode and length of a record [bytes].
pub(super) const HEAD_BYTES: usize = 9;
/// Longest record that is read, and most that a chunk may unpack to [bytes]. A sweep has at most 3 MB.
pub(super) const MAX_BYTES: u64 = 1 << 28;

/// Opcode of the record that `bytes` begin with, and where its data lie; none if it is not whole.
pub(super) fn split(bytes: &[u8]) -> Option<(u8, Range<usize>)> {
    let (head, rest) = bytes.split_first_chunk::<HEAD_BYTES>()?;
    let (opcode, length) = read_head(*head);
    let length = usize::try_from(length).ok().filter(|&length| length <= rest.len())?;
    Some((opcode, HEAD_BYTES..HEAD_BYTES + length))
}

fn read_head([opcode, length @ ..]: [u8; HEAD_BYTES]) -> (u8, u64) {
    (opcode, u64::from_le_bytes(length))
}

/// A record, by where it lies: [`Records::data`] gives its bytes until the next one is read.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) opcode: u8,
    range: Range<usize>,
    is_unpacked: bool,
    /// Offset in the file of the record, or of the chunk that it is in [bytes].
    pub(super) offset: u64,
}

pub(super) struct Records {
    file: BufReader<File>,
    /// Bytes of the file.
    length: u64,
    /// Where the file's next record begins [bytes].
    offset: u64,
    /// The file's record at hand, with opcode and length.
    record: Vec<u8>,
    unpacker: Unpacker,
    /// Records of the chunk at hand, and what is left of them.
    unpacked: Vec<u8>,
    left: Range<usize>,
    /// Where that chunk begins [bytes].
    chunk: u64,
    is_end: bool,
}

impl Records {
    /// The records of the data section.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut magic = Vec::new();
        let mut file = BufReader::with_capacity(1 << 16, file);
        file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic)?;
        if magic != MAGIC {
            let what = "the file does not begin with the mark of MCAP, version 0";
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(Self::from(file, length, MAGIC.len() as u64))
    }

    /// The records of the summary, where the file is whole and has one.
    pub(super) fn summary(path: &Path) -> Option<Self> {
        const FOOTER: usize = HEAD_BYTES + 20;
        let mut file = File::open(path).ok()?;
        let length = file.metadata().ok()?.len();
        let mut end = [0; FOOTER + MAGIC.len()];
        file.seek(SeekFrom::Start(length.checked_sub(end.len() as u64)?)).ok()?;
        file.read_exact(&mut end).ok()?;
        let (footer, magic) = end.split_at(FOOTER);
        let (opcode, range) = split(footer)?;
        let start = u64::from_le_bytes(footer.get(range)?.get(..8)?.try_into().ok()?);
        let is_summary = opcode == op::FOOTER && magic == MAGIC && (MAGIC.len() as u64..length).contains(&start);
        file.seek(SeekFrom::Start(start)).ok()?;
        is_summary.then(|| Self::from(BufReader::new(file), length, start))
    }

    fn from(file: BufReader<File>, length: u64, offset: u64) -> Self {
        Self {
            file,
            length,
            offset,
            record: Vec::new(),
            unpacker: Unpacker::default(),
            unpacked: Vec::new(),
            left: 0..0,
            chunk: 0,
            is_end: false,
        }
    }

    /// The bytes of the record last found.
    pub(super) fn data(&self, found: &Found) -> &[u8] {
        let bytes = if found.is_unpacked { &self.unpacked } else { &self.record };
        bytes.get(found.range.clone()).unwrap_or_default()
    }

    /// The next schema, channel or message; none at the end or at a tear, which is named.
    pub(super) fn next(&mut self, path: &Path, faults: &mut Faults) -> Option<Found> {
        loop {
            if let Some(rest) = self.unpacked.get(self.left.clone()).filter(|rest| !rest.is_empty()) {
                let Some((opcode, range)) = split(rest) else {
                    self.left = 0..0;
                    continue;
                };
                let range = self.left.start + range.start..self.left.start + range.end;
                self.left.start = range.end;
                return Some(Found { opcode, range, is_unpacked: true, offset: self.chunk });
            }
            if self.is_end {
                return None;
            }
            match self.next_of_file(path, faults) {
                Ok(Some(found)) => return Some(found),
                Ok(None) => {}
                Err(what) => {
                    self.is_end = true;
                    let what = format!("{what}; the file has {} bytes", self.length);
                    faults.note(Fault::TornMcap, 1, path, Place::Byte(self.offset), what);
                }
            }
        }
    }

    /// Takes the file's next record: gives it, or opens a chunk, or passes over it. What is said otherwise is a tear.
    fn next_of_file(&mut self, path: &Path, faults: &mut Faults) -> Result<Option<Found>, String> {
        let at = self.offset;
        let mut head = [0; HEAD_BYTES];
        self.file
            .read_exact(&mut head)
            .map_err(|_| "the file ends without the record that ends its data".to_owned())?;
        let (opcode, length) = read_head(head);
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            self.is_end = true;
            return Ok(None);
        }
        let here = at + HEAD_BYTES as u64;
        let is_cut = length > self.length.saturating_sub(here);
        let is_read = matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK | op::METADATA);
        let cut = || format!("the file ends inside a record of {length} bytes");
        if !is_read || length > MAX_BYTES {
            if is_cut {
                return Err(cut());
            }
            if is_read {
                let what = format!("a record of {length} bytes, must have at most {MAX_BYTES}");
                faults.note(Fault::BadChunk, 1, path, Place::Byte(at), what);
            }
            self.file.seek_relative(length as i64).map_err(|error| error.to_string())?;
            self.offset = here + length;
            return Ok(None);
        }
        self.record.clear();
        self.record.extend_from_slice(&head);
        let got = (&mut self.file).take(length).read_to_end(&mut self.record).map_err(|error| error.to_string())?;
        // The file may have been cut off since it was opened.
        let is_cut = is_cut || (got as u64) < length;
        if opcode == op::CHUNK {
            if let Err(what) = self.unpacker.unpack(&self.record, is_cut, &mut self.unpacked) {
                faults.note(Fault::BadChunk, 1, path, Place::Byte(at), what);
            }
            (self.left, self.chunk) = (0..self.unpacked.len(), at);
        }
        if is_cut {
            return Err(cut());
        }
        self.offset = here + length;
        let range = HEAD_BYTES..self.record.len();
        Ok((opcode != op::CHUNK).then_some(Found { opcode, range, is_unpacked: false, offset: at }))
    }
}
