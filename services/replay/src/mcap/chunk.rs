//! Records out of a chunk.

use ::mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::records::{HEAD_BYTES, MAX_BYTES, split};

/// Most that zstd can make of a byte: a block of 128 KiB of four.
const MAX_RATIO: u64 = 32_768;

/// Packed bytes that the reader is given at once [bytes]: what stays in the cache.
const PIECE_BYTES: usize = 1 << 16;

/// Unpacks chunks; the decompressors' memory is used again.
#[derive(Default)]
pub(super) struct Unpacker {
    reader: Option<LinearReader>,
}

/// What a chunk's record says of its contents.
struct Head {
    unpacked: u64,
    packed: u64,
    is_compressed: bool,
    /// Bytes of the record before the packed ones.
    bytes: usize,
}

impl Head {
    fn of(body: &[u8]) -> Option<Self> {
        let word = |at: usize| Some(u64::from_le_bytes(body.get(at..at + 8)?.try_into().ok()?));
        let name = u32::from_le_bytes(body.get(28..32)?.try_into().ok()?) as usize;
        let bytes = name.checked_add(40)?;
        Some(Self { unpacked: word(16)?, packed: word(bytes - 8)?, is_compressed: name > 0, bytes })
    }
}

impl Unpacker {
    /// Puts the records of a chunk into `out`, one after the other as they stand in a file. `record` is that of the
    /// chunk with its opcode and length; where the file is cut off inside it (`is_cut`), the records before the cut come
    /// out. What is wrong is said; records before it may have come out where the chunk has no checksum.
    pub(super) fn unpack(&mut self, record: &[u8], is_cut: bool, out: &mut Vec<u8>) -> Result<(), String> {
        out.clear();
        let body = record.get(HEAD_BYTES..).unwrap_or_default();
        let head = Head::of(body).ok_or("the chunk is shorter than its head")?;
        let packed = body.get(head.bytes..).unwrap_or_default();
        if !is_cut && head.packed > packed.len() as u64 {
            return Err(format!("the chunk claims {} packed bytes, has {}", head.packed, packed.len()));
        }
        if head.unpacked > MAX_BYTES || head.unpacked / MAX_RATIO > head.packed {
            return Err(format!("the chunk claims {} bytes in {} packed ones", head.unpacked, head.packed));
        }
        if !head.is_compressed {
            // The reader trusts lengths of records in chunks that are not compressed.
            let held = packed.len().min(usize::try_from(head.packed).unwrap_or(usize::MAX));
            let mut rest = &packed[..held];
            while let Some((_, range)) = split(rest) {
                rest = &rest[range.end..];
            }
            if !rest.is_empty() && !is_cut {
                return Err("a record goes beyond its chunk".to_owned());
            }
            let used = if is_cut { held - rest.len() } else { packed.len() };
            return self.read(&record[..HEAD_BYTES + head.bytes + used], is_cut, out);
        }
        self.read(record, is_cut, out)?;
        if !is_cut && (out.len() as u64) < head.unpacked {
            return Err(format!("the chunk claims {} bytes, has {}", head.unpacked, out.len()));
        }
        Ok(())
    }

    fn read(&mut self, record: &[u8], is_cut: bool, out: &mut Vec<u8>) -> Result<(), String> {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(!is_cut)
            .with_record_length_limit(MAX_BYTES as usize);
        // What is left in the reader after a fault or a cut belongs to that chunk.
        let mut reader = match self.reader.take() {
            Some(reader) if !is_cut => reader,
            _ => LinearReader::new_with_options(options),
        };
        let mut rest = record;
        loop {
            match reader.next_event() {
                Some(Ok(LinearReadEvent::ReadRequest(_))) if rest.is_empty() => break,
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let (piece, after) = rest.split_at(rest.len().min(wanted.max(PIECE_BYTES)));
                    reader.insert(piece.len())[..piece.len()].copy_from_slice(piece);
                    reader.notify_read(piece.len());
                    rest = after;
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    out.push(opcode);
                    out.extend_from_slice(&(data.len() as u64).to_le_bytes());
                    out.extend_from_slice(data);
                }
                // Nothing more can come of bytes that the file does not have.
                Some(Err(_)) if is_cut => break,
                Some(Err(error)) => return Err(error.to_string()),
                None => break,
            }
        }
        if !is_cut {
            self.reader = Some(reader);
        }
        Ok(())
    }
}
