//! MCAP files: sweeps of Encke's own recordings, and clouds of others.
//!
//! Only the summary is looked for at the end; everything else is read from the start on, record by record, so that a
//! torn file serves up to its tear and memory holds a chunk, not the file.

mod cdr;
mod chunk;
mod clouds;
mod foxglove;
mod messages;
mod pointcloud2;
mod raw;
mod records;
mod topics;

pub(crate) use clouds::MessageClouds;
pub(crate) use messages::Messages;
pub(crate) use raw::RawSweeps;
pub(crate) use topics::Kind;

/// Bytes with which a file begins: the mark, and version 0.
const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Whether a file begins as an MCAP file does, of whatever version.
pub(crate) fn is_mcap(head: &[u8]) -> bool {
    head.starts_with(&MAGIC[..5])
}
