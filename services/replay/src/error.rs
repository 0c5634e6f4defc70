use std::io;
use std::path::PathBuf;

use crate::format::Format;

/// Why a recording cannot be opened: one line that names file, place and remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The path does not exist or may not be read.
    #[error("{}: cannot be read ({source}); give a file or folder that exists and may be read", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is in no known format.
    #[error("{}: {found}; known by their content are {}; name another with --format", path.display(), Format::list())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// What its first bytes are.
        found: String,
    },
    /// The pattern of file names is none, or nothing matches it.
    #[error("{}: {what}; give a file, a folder, or a pattern such as 'folder/*.pcd', in quotes", path.display())]
    Pattern {
        /// The pattern.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The folder holds no file in a known format.
    #[error("{}: holds no recording among its {files} files; known by their content are {}", path.display(), Format::list())]
    NoRecording {
        /// The folder.
        path: PathBuf,
        /// Number of files in it.
        files: usize,
    },
    /// The folder holds files of several formats.
    #[error("{}: holds {first} ({}) and {second} ({}); choose one with --format or give one file",
        path.display(), first_file.display(), second_file.display())]
    MixedFormats {
        /// The folder.
        path: PathBuf,
        /// A format in it.
        first: Format,
        /// A file in that format.
        first_file: PathBuf,
        /// Another format in it.
        second: Format,
        /// A file in that one.
        second_file: PathBuf,
    },
    /// The sensor model is not known.
    #[error("sensor {name}: {source}; choose another with --sensor")]
    Sensor {
        /// Its name.
        name: String,
        /// What the look-up said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The sensor's packets do not have 32 channels a block.
    #[error(
        "sensor {name}: has {lasers} lasers in {cycles} firing cycles a block, must be 32 channels together; choose a sensor of such packets with --sensor"
    )]
    NotABlock {
        /// Its name.
        name: String,
        /// Its lasers.
        lasers: usize,
        /// Its firing cycles in a block.
        cycles: u32,
    },
    /// The packets come at another rate than the sensor sends them.
    #[error("{}: its data packets are {found_us} us apart, those of {sensor} {expected_us} us; name the right sensor with --sensor",
        path.display())]
    OtherSensor {
        /// The capture, or the live sensor's address.
        path: PathBuf,
        /// The sensor supposed.
        sensor: String,
        /// Usual time between packets [µs].
        found_us: u64,
        /// What the sensor model says [µs].
        expected_us: u64,
    },
    /// The packets say that they are another sensor's.
    #[error("{}: its data packets are of {found}, read as {sensor}; name the right sensor with --sensor", path.display())]
    OtherProduct {
        /// The live sensor's address.
        path: PathBuf,
        /// The sensor supposed.
        sensor: String,
        /// What their factory byte says.
        found: String,
    },
    /// The file has the format but nothing to replay.
    #[error("{}: {what}; give a recording that holds at least one return", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: String,
    },
    /// The file contradicts its format.
    #[error("{}, {place}: {what}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where.
        place: Place,
        /// What is found, what must be, and what to do.
        what: String,
    },
    /// It is not clear which topic of an MCAP file to read, or it has none that holds sweeps.
    #[error("{}: {what}", path.display())]
    Topic {
        /// The file.
        path: PathBuf,
        /// What is found, what must be, and what to do.
        what: String,
    },
    /// The range limits contradict each other.
    #[error(
        "range limits are {near_m} to {far_m} m, must be 0 or more, finite and rising; change --min-range or --max-range"
    )]
    Limits {
        /// Nearest accepted range [m].
        near_m: f64,
        /// Farthest accepted range [m].
        far_m: f64,
    },
    /// A live sensor's socket cannot be had.
    #[error("{address}: cannot be listened to ({source}); give an address of this machine and a port that is free")]
    Socket {
        /// As in `--from`.
        address: String,
        /// What the system said.
        source: io::Error,
    },
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Offset from the file's start [bytes].
    Byte(u64),
    /// Line, from 1.
    Line(u64),
    /// Packet of a live sensor, from 1.
    Packet(u64),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Packet(number) => write!(f, "packet {number}"),
        }
    }
}
