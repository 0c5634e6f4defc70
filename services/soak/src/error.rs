use std::path::{Path, PathBuf};

/// Why a soak cannot begin, or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SoakError {
    /// A table does not hold.
    #[error("{file}: {cause}")]
    Table {
        /// The file.
        file: String,
        /// What is wrong, both sides.
        cause: String,
    },
    /// A file or folder cannot be written or read.
    #[error("{path}: {cause}")]
    File {
        /// The path.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The chain did not come up.
    #[error("the chain did not come up within {patience_s} s: {log} says why")]
    NotUp {
        /// How long was waited [s].
        patience_s: u64,
        /// What it wrote to stderr.
        log: PathBuf,
    },
    /// The chain cannot be looked at.
    #[error("{0}")]
    Chain(String),
}

impl SoakError {
    pub(crate) fn chain(cause: impl ToString) -> Self {
        Self::Chain(cause.to_string())
    }

    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |cause| Self::File { path, cause }
    }
}
