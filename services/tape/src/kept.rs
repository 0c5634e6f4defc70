//! The files of a run that are no longer written: what is in them, and which is to go for the quota.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};

use crate::counts::{Tally, add};
use crate::names::{is_ours, numbered, present};

/// A file that is no longer written.
struct Kept {
    path: PathBuf,
    bytes: u64,
    messages: Tally,
}

/// Files of a run, the oldest first; those of earlier lives of the process too, whose messages are not known.
#[derive(Default)]
pub(crate) struct KeptFiles {
    files: VecDeque<Kept>,
    /// Messages of this life in files that are there.
    pub(crate) written: Tally,
    /// Messages of this life in files that were removed.
    pub(crate) removed: Tally,
    pub(crate) removed_files: u64,
}

impl KeptFiles {
    /// Finds the files of earlier lives to go on after, or clears an earlier run's out of the way. Gives the number of
    /// the file to begin with, or else the path of a stranger's that is in the way; then nothing was changed.
    pub(crate) fn look(&mut self, path: &Path, resume: bool) -> io::Result<Result<u64, PathBuf>> {
        let numbers = present(path)?;
        for &number in &numbers {
            let other = numbered(path, number);
            if number > 0 && !is_ours(&other)? {
                return Ok(Err(other));
            }
        }
        let mut next = 0;
        for number in numbers {
            let path = numbered(path, number);
            if resume {
                let bytes = path.metadata()?.len();
                self.files.push_back(Kept { path, bytes, messages: Tally::default() });
                next = number + 1;
            } else if number > 0 {
                std::fs::remove_file(path)?;
            }
        }
        Ok(Ok(next))
    }

    /// Adds a file.
    pub(crate) fn keep(&mut self, path: PathBuf, bytes: u64, messages: Tally) {
        add(&mut self.written, &messages);
        self.files.push_back(Kept { path, bytes, messages });
    }

    /// Bytes of all files.
    pub(crate) fn bytes(&self) -> u64 {
        self.files.iter().map(|kept| kept.bytes).sum()
    }

    /// Removes the oldest file; false where there is none. One that cannot be removed is told and counted as removed.
    pub(crate) fn remove_oldest(&mut self) -> bool {
        let Some(Kept { path, messages, .. }) = self.files.pop_front() else { return false };
        match std::fs::remove_file(&path) {
            Ok(()) => tracing::info!(file = %path.display(), "oldest recording removed for the quota"),
            Err(error) => tracing::warn!(file = %path.display(), %error, "cannot remove the oldest recording"),
        }
        self.removed_files += 1;
        add(&mut self.removed, &messages);
        for (written, removed) in self.written.iter_mut().zip(&messages) {
            *written = written.saturating_sub(*removed);
        }
        true
    }
}
