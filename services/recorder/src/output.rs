//! One output file: appends whole blocks (a sweep's line or rows), or is closed by its first error.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{FileExt, FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use crate::settings::{RecorderError, is_stdout};

/// Where a block may be cut when the process dies in the middle of it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Commit {
    /// By its last byte: a line without its end is torn.
    LastByte,
    /// By its first byte, which is NUL until all others are written: a block of rows looks whole at every row's end.
    FirstByte,
}

/// Where the bytes go.
enum Target {
    Stdout,
    /// Opened at its first write, by the writer thread: opening waits for a reader.
    Fifo,
    /// A pipe, terminal or device.
    Stream(File),
    /// A regular file and its length in whole blocks.
    Regular(File, u64),
    /// Nothing more is written.
    Closed(io::Error),
}

/// An output and what became of it.
pub(crate) struct Output {
    path: PathBuf,
    commit: Commit,
    target: Target,
    lost_sweeps: u64,
}

/// What an output that failed leaves behind.
pub(crate) struct Failure {
    pub(crate) path: PathBuf,
    pub(crate) error: io::Error,
    /// How much of `what` it lacks.
    pub(crate) lost: u64,
    pub(crate) what: &'static str,
}

impl Output {
    /// Creates or empties the file.
    pub(crate) fn create(path: &Path, commit: Commit) -> Result<Self, RecorderError> {
        Self::open(path, commit, OpenOptions::new().create(true).truncate(true))
    }

    /// Opens the file to go on with, or creates it. `repair` gives the length up to which it is whole.
    pub(crate) fn resume(
        path: &Path,
        commit: Commit,
        repair: impl FnOnce(&File) -> Result<u64, RecorderError>,
    ) -> Result<Self, RecorderError> {
        let mut output = Self::open(path, commit, OpenOptions::new().create(true).truncate(false).read(true))?;
        if let Target::Regular(file, length) = &mut output.target {
            *length = repair(file)?;
            file.set_len(*length).map_err(|source| RecorderError::Resume { path: path.to_owned(), source })?;
        }
        Ok(output)
    }

    fn open(path: &Path, commit: Commit, options: &mut OpenOptions) -> Result<Self, RecorderError> {
        let target = if is_stdout(path) {
            Target::Stdout
        } else if std::fs::metadata(path).is_ok_and(|metadata| metadata.file_type().is_fifo()) {
            Target::Fifo
        } else {
            let create = |source| RecorderError::Create { path: path.to_owned(), source };
            let file = options.write(true).open(path).map_err(create)?;
            if file.metadata().map_err(create)?.is_file() { Target::Regular(file, 0) } else { Target::Stream(file) }
        };
        Ok(Self { path: path.to_owned(), commit, target, lost_sweeps: 0 })
    }

    /// Whether both are the same regular file, under whatever names.
    pub(crate) fn is_same_file(&self, other: &Self) -> bool {
        let place = |output: &Self| match &output.target {
            Target::Regular(file, _) => file.metadata().ok().map(|metadata| (metadata.dev(), metadata.ino())),
            _ => None,
        };
        place(self).is_some() && place(self) == place(other)
    }

    /// Whether the file is regular and holds something already.
    pub(crate) fn is_begun(&self) -> bool {
        matches!(self.target, Target::Regular(_, length) if length > 0)
    }

    /// Appends and flushes what precedes the first sweep.
    pub(crate) fn begin(&mut self, header: &[u8]) {
        if !matches!(self.target, Target::Closed(_))
            && let Err(error) = self.write(header)
        {
            self.close(error, None);
        }
    }

    /// Appends and flushes a sweep's block; false when it is lost. The first error is told and closes the file.
    pub(crate) fn append(&mut self, sweep: u64, block: &[u8]) -> bool {
        if !matches!(self.target, Target::Closed(_)) {
            match self.write(block) {
                Ok(()) => return true,
                Err(error) => self.close(error, Some(sweep)),
            }
        }
        self.lost_sweeps += 1;
        false
    }

    fn write(&mut self, block: &[u8]) -> io::Result<()> {
        match &mut self.target {
            Target::Stdout => {
                let mut stdout = io::stdout().lock();
                stdout.write_all(block)?;
                stdout.flush()
            }
            Target::Fifo => {
                let mut file = OpenOptions::new().write(true).open(&self.path)?;
                let written = file.write_all(block);
                self.target = Target::Stream(file);
                written
            }
            Target::Stream(file) => file.write_all(block),
            Target::Regular(file, length) => {
                write_at(file, *length, block, self.commit)?;
                *length += block.len() as u64;
                Ok(())
            }
            Target::Closed(_) => Ok(()),
        }
    }

    fn close(&mut self, error: io::Error, sweep: Option<u64>) {
        tracing::error!(file = %self.path.display(), sweep, %error, "output closed, what it should hold is lost from here on");
        if let Target::Regular(file, length) = &self.target {
            // The torn block; when even that fails, a reader finds it as after a crash.
            let _ = file.set_len(*length);
        }
        self.target = Target::Closed(error);
    }

    /// Closes the file; what it failed of, if it did.
    pub(crate) fn end(self) -> Option<Failure> {
        match self.target {
            Target::Closed(error) => Some(Failure { path: self.path, error, lost: self.lost_sweeps, what: "sweeps" }),
            _ => None,
        }
    }
}

fn write_at(file: &File, at: u64, block: &[u8], commit: Commit) -> io::Result<()> {
    match (commit, block.split_first()) {
        (Commit::FirstByte, Some((first, rest))) if !rest.is_empty() => {
            file.write_all_at(rest, at + 1)?;
            file.write_all_at(&[*first], at)
        }
        _ => file.write_all_at(block, at),
    }
}
