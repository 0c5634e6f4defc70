//! The log of a run: JSON lines, appended by the supervisor alone.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use crate::{Event, EventId};

/// A log that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {cause}; free space there, or choose another folder")]
pub struct LogError {
    /// The file.
    pub path: PathBuf,
    /// What the system said.
    pub cause: std::io::Error,
}

/// The writing end of a run's log.
pub struct Log {
    file: File,
    next: u64,
}

impl Log {
    /// Begins the log at `path`, readable by this user alone.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let open = OpenOptions::new().create(true).append(true).mode(0o600).open(path);
        let file = open.map_err(|cause| LogError { path: path.to_owned(), cause })?;
        Ok(Self { file, next: 0 })
    }

    /// Says that something happened to `stage` while the source was at `sweep`.
    pub fn say(&mut self, (time_ns, utc_ns): (u64, u64), id: EventId, stage: &str, sweep: u64, text: &str) {
        let entry = id.entry();
        let event = Event {
            number: self.next,
            time_ns,
            utc_ns,
            id: id as u32,
            name: entry.name.to_owned(),
            severity: entry.severity,
            stage: stage.to_owned(),
            sweep,
            text: text.to_owned(),
            unsaid: 0,
        };
        self.next += 1;
        let mut line = serde_json::to_vec(&event).unwrap_or_default();
        line.push(b'\n');
        // A full disk costs the log, not the chain.
        let _ = self.file.write_all(&line);
    }
}
