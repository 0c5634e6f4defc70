use std::io;
use std::path::{Path, PathBuf};

/// Why a recording cannot be shown: one line that names file, place and remedy.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// The file does not begin as an MCAP file does.
    #[error("{}: is no MCAP file; `encke run --record FILE.mcap` writes one", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// Nothing in the file is a sweep of Encke's.
    #[error("{}: holds no sweeps of Encke's, only {found}; `encke run --record FILE.mcap` writes them", path.display())]
    NoSweeps {
        /// The file.
        path: PathBuf,
        /// The topics that it holds, in words.
        found: String,
    },
    /// A topic is of a layout that this Encke does not know.
    #[error("{}: {topic} is {found}, must be {expected}; view it with the Encke that recorded it", path.display())]
    Layout {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Layout found.
        found: String,
        /// Layout known.
        expected: &'static str,
    },
    /// The selection leaves nothing to show.
    #[error("{}: none of its {sweeps} sweeps is selected; choose a smaller --first", path.display())]
    NothingSelected {
        /// The file.
        path: PathBuf,
        /// Sweeps in it.
        sweeps: usize,
    },
    /// What was there when the file was looked through is not there any more.
    #[error("{}: sweep {sweep} cannot be read again: {cause}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Number of the sweep.
        sweep: u32,
        /// What is wrong.
        cause: String,
    },
    /// The page cannot be written.
    #[error("the page cannot be written: {0}")]
    Write(io::Error),
    /// The address cannot be listened on.
    #[error("{address}: cannot be listened on: {cause}; choose another with --serve ADDR:PORT")]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// What the system says.
        cause: io::Error,
    },
    /// A file of the running instance is not there or not what it should be, or signals cannot be had.
    #[error(transparent)]
    Shell(#[from] runtime::ShellError),
    /// Shared memory failed, or all places for viewers are taken.
    #[error(transparent)]
    Transport(#[from] transport::TransportError),
    /// No memory for a message.
    #[error("no memory for a message")]
    NoMemory,
}

impl ViewError {
    pub(crate) fn read(path: &Path, cause: io::Error) -> Self {
        Self::Read { path: path.to_owned(), cause }
    }
}
