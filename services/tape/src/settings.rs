//! What a recording shall hold, as the configuration has it and as it is used.

use std::io;
use std::path::PathBuf;

use serde::Deserialize;

use crate::Topic;

/// Largest chunk [KiB].
pub const MAX_CHUNK_KIB: u64 = 65_536;
/// Most sweeps that may wait for their detections.
pub const MAX_HOLD_SWEEPS: usize = 64;
/// Largest number of MiB, so that bytes can be counted.
const MAX_MIB: u64 = 1 << 40;

/// How chunks are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Not at all.
    None,
    /// LZ4, fastest.
    Lz4,
    /// Zstandard at its level 1.
    Zstd,
}

/// What happens when the files of a run are as large as the quota.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WhenFull {
    /// The oldest file of the run is removed: the newest is kept.
    RemoveOldest,
    /// Nothing more is written: the oldest is kept.
    Stop,
}

/// `config/tape.toml` as written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TapeFile {
    /// Topics by their names below `/encke/`.
    pub topics: Vec<Topic>,
    /// How chunks are compressed.
    pub compression: Compression,
    /// Size at which a chunk is closed, before compression [KiB], 1 to [`MAX_CHUNK_KIB`].
    pub chunk_kib: u64,
    /// Size at which the next file is begun [MiB]; 0 = never for its size.
    pub rotate_mib: u64,
    /// Age at which the next file is begun [s]; 0 = never for its age.
    pub rotate_s: f64,
    /// Most that all files of the run may have together [MiB]; 0 = no bound.
    pub quota_mib: u64,
    /// What happens at the quota.
    pub when_full: WhenFull,
    /// Time after a write error at which a new file is tried [s], twice as long after each further one; 0 = never.
    pub retry_s: f64,
    /// Sweeps that wait for their detections, and detections for their sweep, 1 to [`MAX_HOLD_SWEEPS`].
    pub hold_sweeps: usize,
}

/// A recording's settings, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub(crate) topics: Vec<Topic>,
    pub(crate) compression: Compression,
    pub(crate) chunk_bytes: u64,
    pub(crate) rotate_bytes: Option<u64>,
    pub(crate) rotate_ns: Option<u64>,
    pub(crate) quota_bytes: Option<u64>,
    pub(crate) when_full: WhenFull,
    pub(crate) retry_ns: Option<u64>,
    pub(crate) hold_sweeps: usize,
}

impl Settings {
    /// The topics that are written, by their number.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Whether a topic is written.
    pub fn has(&self, topic: Topic) -> bool {
        self.topics.contains(&topic)
    }
}

/// What cannot be set so.
#[derive(Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// Nothing would be recorded.
    #[error("topics is empty, must name at least one; without recording leave out --record")]
    NoTopics,
    /// A topic would be written twice.
    #[error("topics names {} twice", .0.name())]
    Twice(Topic),
    /// A number is out of range.
    #[error("{key} is {value}, must be {range}")]
    Range {
        /// Which.
        key: &'static str,
        /// As written.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// One file alone could reach the quota, so that nothing could be kept when it is removed.
    #[error(
        "quota_mib is {quota_mib} and rotate_mib {rotate_mib}: rotate_mib must be 1 to half of the quota, or the quota 0"
    )]
    Quota {
        /// As written.
        quota_mib: u64,
        /// As written.
        rotate_mib: u64,
    },
}

impl TapeFile {
    /// Checks every value.
    pub fn checked(&self) -> Result<Settings, SettingsError> {
        let mut topics = self.topics.clone();
        topics.sort_unstable();
        if let Some(pair) = topics.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(SettingsError::Twice(pair[0]));
        }
        if topics.is_empty() {
            return Err(SettingsError::NoTopics);
        }
        let range = |key, value, fine: bool, range| {
            if fine { Ok(()) } else { Err(SettingsError::Range { key, value, range }) }
        };
        let chunk_fine = (1..=MAX_CHUNK_KIB).contains(&self.chunk_kib);
        range("chunk_kib", self.chunk_kib as f64, chunk_fine, "1 to 65536")?;
        let hold_fine = (1..=MAX_HOLD_SWEEPS).contains(&self.hold_sweeps);
        range("hold_sweeps", self.hold_sweeps as f64, hold_fine, "1 to 64")?;
        for (key, mib) in [("rotate_mib", self.rotate_mib), ("quota_mib", self.quota_mib)] {
            range(key, mib as f64, mib <= MAX_MIB, "0 to 1099511627776")?;
        }
        for (key, seconds) in [("rotate_s", self.rotate_s), ("retry_s", self.retry_s)] {
            range(key, seconds, (0.0..=1e9).contains(&seconds), "0 to 1e9")?;
        }
        let (quota_mib, rotate_mib) = (self.quota_mib, self.rotate_mib);
        let ring = quota_mib > 0 && self.when_full == WhenFull::RemoveOldest;
        if ring && !(1..=quota_mib / 2).contains(&rotate_mib) {
            return Err(SettingsError::Quota { quota_mib, rotate_mib });
        }
        let bytes = |mib: u64| (mib > 0).then_some(mib << 20);
        let span_ns = |seconds: f64| (seconds > 0.0).then_some((seconds * 1e9) as u64);
        Ok(Settings {
            topics,
            compression: self.compression,
            chunk_bytes: self.chunk_kib << 10,
            rotate_bytes: bytes(rotate_mib),
            rotate_ns: span_ns(self.rotate_s),
            quota_bytes: bytes(quota_mib),
            when_full: self.when_full,
            retry_ns: span_ns(self.retry_s),
            hold_sweeps: self.hold_sweeps,
        })
    }
}

/// Why a recording cannot start or was not written as a whole.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TapeError {
    /// The file cannot be created: directory missing, no permission, a directory itself.
    #[error("cannot write {}: {source}; give a path in an existing directory that may be written", path.display())]
    Create {
        /// As given, or that of a later file of the run.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Neither a file nor a device: opening would wait for a reader.
    #[error("cannot record to {}: it is a pipe or socket; give the path of a file", .0.display())]
    NoFile(PathBuf),
    /// A later file of the run would have the name of one that is no recording of Encke's.
    #[error("cannot record to {}: {} is in the way and no recording of Encke's; move it away or give another path",
        path.display(), other.display())]
    Foreign {
        /// As given.
        path: PathBuf,
        /// What is in the way.
        other: PathBuf,
    },
    /// There is no memory for a sweep.
    #[error("no memory for a sweep; free some or leave out --record")]
    Memory,
    /// Something was not written.
    #[error("the recording {} lacks {lost} messages: {failure}", path.display())]
    Incomplete {
        /// As given.
        path: PathBuf,
        /// The latest write error.
        failure: String,
        /// Messages that could not be written.
        lost: u64,
    },
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn shipped() -> TapeFile {
        toml::from_str(include_str!("../../../config/tape.toml")).unwrap()
    }

    #[test]
    fn what_is_shipped_is_fine_and_holds_what_replay_and_people_need() {
        let settings = shipped().checked().unwrap();
        for topic in Topic::ALL {
            let is_between = [Topic::RawClusters, Topic::RawDescriptors].contains(&topic);
            assert_eq!(settings.has(topic), !is_between, "{}", topic.name());
        }
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        type Spoil = fn(&mut TapeFile);
        let spoils: [(Spoil, &str); 9] = [
            (|file| file.topics.clear(), "topics is empty"),
            (|file| file.topics.push(Topic::Sweep), "topics names /encke/sweep twice"),
            (|file| file.chunk_kib = 0, "chunk_kib is 0, must be 1 to 65536"),
            (|file| file.chunk_kib = 65_537, "chunk_kib is 65537"),
            (|file| file.hold_sweeps = 65, "hold_sweeps is 65, must be 1 to 64"),
            (|file| file.rotate_s = f64::NAN, "rotate_s is NaN, must be 0 to 1e9"),
            (|file| file.retry_s = -1.0, "retry_s is -1"),
            (|file| file.quota_mib = u64::MAX, "quota_mib is"),
            (|file| (file.quota_mib, file.rotate_mib) = (100, 51), "quota_mib is 100 and rotate_mib 51"),
        ];
        for (spoil, says) in spoils {
            let mut file = shipped();
            spoil(&mut file);
            let error = file.checked().unwrap_err().to_string();
            assert!(error.starts_with(says), "{error}");
        }
        let stops = TapeFile { quota_mib: 100, rotate_mib: 0, when_full: WhenFull::Stop, ..shipped() };
        assert!(stops.checked().is_ok());
    }

    #[test]
    fn an_unknown_key_is_refused() {
        let text = format!("{}\nspeed = 1", include_str!("../../../config/tape.toml"));
        assert!(toml::from_str::<TapeFile>(&text).is_err());
    }
}
