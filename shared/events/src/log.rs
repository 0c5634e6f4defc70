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

    /// Goes on with the log at `path` where its writer died, with the number after the last event. A line that it did not
    /// finish is cut off.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn resume(path: &Path) -> Result<Self, LogError> {
        let failed = |cause| LogError { path: path.to_owned(), cause };
        let mut log = Self::create(path)?;
        let text = std::fs::read(path).map_err(failed)?;
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        log.file.set_len(whole as u64).map_err(failed)?;
        let mut lines = text[..whole].rsplit(|&byte| byte == b'\n');
        let last = lines.find_map(|line| serde_json::from_slice::<Event>(line).ok());
        log.next = last.map_or(0, |event| event.number + 1);
        Ok(log)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CHAIN;

    #[test]
    fn a_successor_goes_on_with_the_next_number_and_drops_a_torn_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("events.jsonl");
        let mut log = Log::create(&path).unwrap();
        for sweep in 0..3 {
            log.say((0, 0), EventId::RunBegan, CHAIN, sweep, "");
        }
        log.file.write_all(b"{\"number\":3,\"time").unwrap();
        let mut sut = Log::resume(&path).unwrap();
        sut.say((0, 0), EventId::SupervisorAdopted, CHAIN, 9, "");
        let text = std::fs::read_to_string(&path).unwrap();
        let numbers: Vec<u64> = text.lines().map(|line| serde_json::from_str::<Event>(line).unwrap().number).collect();
        assert_eq!(numbers, [0, 1, 2, 3]);
    }
}
