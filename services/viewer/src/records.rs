use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Opcode and length before a record's body [bytes].
const HEAD: usize = 9;

/// Longest record that is read, and longest chunk once decompressed [bytes]. The writer's chunks are far smaller; more is
/// not believed, for memory is asked for before anything can be checked.
const MAX_RECORD: u64 = 256 << 20;

/// What the top level of an MCAP file holds next.
pub(crate) enum Top {
    /// A record that may hold something of use is in [`Records::bytes`]; it begins at `offset` in the file.
    Record {
        /// Where it begins [bytes].
        offset: u64,
    },
    /// The file is over as it should be.
    End,
    /// The file breaks off, or goes on as nothing that could be read. In words, with the place.
    Torn(String),
}

/// The records of an MCAP file's top level, from start to end. Chunks are not opened; see [`inner`].
pub(crate) struct Records {
    file: BufReader<File>,
    at: u64,
    end: u64,
    bytes: Vec<u8>,
    opcode: u8,
}

impl Records {
    /// Looks at the beginning. `None` where it is not that of an MCAP file.
    pub(crate) fn open(file: File) -> io::Result<Option<Self>> {
        let end = file.metadata()?.len();
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut magic = [0; mcap::MAGIC.len()];
        match file.read_exact(&mut magic) {
            Err(cause) if cause.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            other => other?,
        }
        let at = magic.len() as u64;
        Ok((magic == mcap::MAGIC).then_some(Self { file, at, end, bytes: Vec::new(), opcode: 0 }))
    }

    /// The record that was read last: opcode, length, body.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Reads on to the next record of use.
    pub(crate) fn next(&mut self) -> io::Result<Top> {
        loop {
            let offset = self.at;
            let left = self.end - offset;
            if left < HEAD as u64 {
                return Ok(Top::Torn(format!("breaks off at byte {}", self.end)));
            }
            let length = self.head()?;
            if self.opcode == op::DATA_END || self.opcode == op::FOOTER {
                return Ok(Top::End);
            }
            if self.opcode == 0 {
                return Ok(Top::Torn(format!("goes on as no record at byte {offset}")));
            }
            if length > left - HEAD as u64 {
                return Ok(Top::Torn(format!("breaks off at byte {}, in a record that began at {offset}", self.end)));
            }
            self.at = offset + HEAD as u64 + length;
            let wanted = [op::CHUNK, op::SCHEMA, op::CHANNEL, op::MESSAGE, op::METADATA].contains(&self.opcode);
            if !wanted || length > MAX_RECORD {
                self.file.seek(SeekFrom::Start(self.at))?;
                continue;
            }
            self.body(length)?;
            return Ok(Top::Record { offset });
        }
    }

    /// Reads the record at `offset` once more.
    pub(crate) fn again(&mut self, offset: u64) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(offset))?;
        let length = self.head()?;
        if length > MAX_RECORD {
            return Err(ErrorKind::InvalidData.into());
        }
        self.body(length)
    }

    fn head(&mut self) -> io::Result<u64> {
        self.bytes.resize(HEAD, 0);
        self.file.read_exact(&mut self.bytes)?;
        self.opcode = self.bytes[0];
        let mut length = [0; 8];
        length.copy_from_slice(&self.bytes[1..]);
        Ok(u64::from_le_bytes(length))
    }

    fn body(&mut self, length: u64) -> io::Result<()> {
        self.bytes.resize(HEAD + length as usize, 0);
        self.file.read_exact(&mut self.bytes[HEAD..])
    }
}

/// Hands every record of one top-level record to `visit`: itself, or all that a chunk holds. A chunk whose sum is wrong
/// holds nothing.
///
/// # Errors
/// What cannot be read, in words.
pub(crate) fn inner(bytes: &[u8], mut visit: impl FnMut(Record)) -> Result<(), String> {
    let mut options = LinearReaderOptions::default();
    options = options.with_skip_start_magic(true).with_skip_end_magic(true);
    options = options.with_prevalidate_chunk_crcs(true).with_record_length_limit(MAX_RECORD as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = bytes;
    while let Some(event) = reader.next_event() {
        match event.map_err(|cause| cause.to_string())? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                if now.is_empty() {
                    return Ok(());
                }
                rest = later;
            }
            LinearReadEvent::Record { opcode, data } => {
                let wanted = [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::METADATA].contains(&opcode);
                if wanted {
                    visit(mcap::parse_record(opcode, data).map_err(|cause| cause.to_string())?);
                }
            }
        }
    }
    Ok(())
}
