//! A report from its file, whose format is found by content.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde_json::Value;

use super::{RunFigures, recording};

/// Why a file is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunReportError {
    /// Nothing is in it.
    #[error("is empty, must be a report of `encke run --report` or a recording of `encke run --record`")]
    Empty,
    /// It is something else.
    #[error("is {0}, must be a report of `encke run --report` or a recording of `encke run --record`")]
    Other(&'static str),
    /// JSON that breaks off or is none.
    #[error("is torn JSON: {cause} (byte {at} of {length})")]
    Torn {
        /// What is wrong and where.
        cause: serde_json::Error,
        /// Offset of the place [bytes].
        at: usize,
        /// Length of the file [bytes].
        length: usize,
    },
    /// A recording without a sweep's detections.
    #[error("is a recording (MCAP) without messages of {0} that can be read: record that topic")]
    NoSweeps(&'static str),
    /// The system gave nothing to read, or no memory.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// A report in which something has a type that it cannot have.
    #[error("is no report that can be shown: {0}")]
    Field(serde_json::Error),
}

/// What a recording begins with.
pub(crate) const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Files that somebody may take for a report, by their first bytes.
const KNOWN: [(&[u8], &str); 8] = [
    (b"\xd4\xc3\xb2\xa1", "a capture (pcap)"),
    (b"\xa1\xb2\xc3\xd4", "a capture (pcap)"),
    (b"\x0a\x0d\x0d\x0a", "a capture (pcapng)"),
    (b"<!DOCTYPE", "a web page"),
    (b"sweep,return,cluster", "a file of labels"),
    (b"# .PCD", "a point cloud (PCD)"),
    (b"ply", "a point cloud (PLY)"),
    (b"\x1f\x8b", "compressed (gzip)"),
];

impl RunFigures {
    /// The figures of a file: a report, or a recording, from which they are worked out; found by content.
    ///
    /// # Errors
    /// The file cannot be read, or is neither.
    pub fn read(path: &Path) -> Result<Self, RunReportError> {
        let mut file = BufReader::new(File::open(path)?);
        if file.fill_buf()?.starts_with(MCAP_MAGIC) {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            return recording::read(file, name);
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Self::from_json(&bytes)
    }

    /// The figures of the JSON of `encke run --report`, of this version or another one.
    ///
    /// # Errors
    /// The bytes are empty, torn, or something else.
    pub fn from_json(bytes: &[u8]) -> Result<Self, RunReportError> {
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(RunReportError::Empty);
        }
        if let Some((_, what)) = KNOWN.iter().find(|(magic, _)| bytes.starts_with(magic)) {
            return Err(RunReportError::Other(what));
        }
        let value: Value = serde_json::from_slice(bytes).map_err(|cause| not_json(bytes, cause))?;
        if let Some(what) = other(&value) {
            return Err(RunReportError::Other(what));
        }
        serde_json::from_slice(bytes).map_err(RunReportError::Field)
    }
}

fn not_json(bytes: &[u8], cause: serde_json::Error) -> RunReportError {
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    if !matches!(first, Some(b'{' | b'[')) {
        return RunReportError::Other(if std::str::from_utf8(bytes).is_ok() { "some other text" } else { "no text" });
    }
    // A whole object and more after it: lines of JSON.
    let mut lines = bytes.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    if let (Some(first), Some(_)) = (lines.next(), lines.next())
        && let Ok(value) = serde_json::from_slice::<Value>(first)
    {
        return RunReportError::Other(match value.get("detections").is_some() {
            true => "a file of detections (`encke run --detections`)",
            false => "a file of JSON lines",
        });
    }
    let before: usize =
        bytes.split_inclusive(|byte| *byte == b'\n').take(cause.line().saturating_sub(1)).map(<[u8]>::len).sum();
    RunReportError::Torn { at: (before + cause.column()).min(bytes.len()), length: bytes.len(), cause }
}

/// What whole JSON is, if no report.
fn other(value: &Value) -> Option<&'static str> {
    let Some(object) = value.as_object() else {
        let is_trace = value.get(0).is_some_and(|event| event.get("ph").is_some());
        return Some(if is_trace { "a trace (`encke run --trace`; open it in ui.perfetto.dev)" } else { "other JSON" });
    };
    let has = |name: &str| object.contains_key(name);
    if has("ledger") || has("latency_ms") {
        return None;
    }
    Some(match () {
        () if has("bars") || has("plan") => "an evaluation (`encke evaluate`), which has a page of its own",
        () if has("sweep") && has("detections") => "a file of detections (`encke run --detections`)",
        () if has("parts") && has("end_to_end") => "statistics of a recorder's life",
        () if has("checks") => "findings of `encke doctor`",
        () => "other JSON",
    })
}
