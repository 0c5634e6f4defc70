use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use events::{Event, Reader};

/// Most that is kept of the log [bytes].
const MOST_COPIED: u64 = 256 << 20;

/// A log that is read while it grows, and kept.
pub(crate) struct Tail {
    log: Reader,
    copy: File,
    copied: u64,
    /// Events by name, those left unsaid included.
    pub(crate) counts: BTreeMap<String, u64>,
}

impl Tail {
    /// Of the log at `path`, which need not be there yet, into `copy`.
    pub(crate) fn new(path: &Path, copy: File) -> Self {
        Self { log: Reader::new(path, 0), copy, copied: 0, counts: BTreeMap::new() }
    }

    /// Numbers of the log that were skipped.
    pub(crate) fn skipped(&self) -> u64 {
        self.log.missed()
    }

    /// Everything new.
    pub(crate) fn read(&mut self) -> Vec<Event> {
        let mut new = Vec::new();
        self.log.read(|event| new.push(event));
        for event in &new {
            *self.counts.entry(event.name.clone()).or_default() += 1 + event.unsaid;
            if self.copied < MOST_COPIED {
                let mut line = serde_json::to_vec(event).unwrap_or_default();
                line.push(b'\n');
                self.copied += line.len() as u64;
                let _ = self.copy.write_all(&line); // a full disk costs the copy
            }
        }
        new
    }
}
