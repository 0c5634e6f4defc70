use std::io;
use std::path::{Path, PathBuf};

use messages::MAX_HOPS;

/// Most buffers that may stand between the chain and the writer.
pub const MAX_QUEUE_PARTS: usize = 2048;

/// What the recorder writes and how it judges, as the caller has decided it.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// File for one JSON line a sweep; `-` and `/dev/stdout` are standard output.
    pub detections: Option<PathBuf>,
    /// File for one JSON line of tracks a sweep; as above.
    pub tracks: Option<PathBuf>,
    /// File for one CSV row a recorded return; as above.
    pub labels: Option<PathBuf>,
    /// File for the way of every part in the Trace Event Format (a JSON array); as above.
    pub trace: Option<PathBuf>,
    /// File for the statistics of this life, renewed with every checkpoint.
    pub statistics: Option<PathBuf>,
    /// Go on with the files that an earlier life of this process left, instead of starting them anew.
    pub resume: bool,
    /// Parts that may wait for the writer, 1 to [`MAX_QUEUE_PARTS`]. Each reserves 9 MB of address space, of which
    /// only what parts have filled becomes memory (unless the process locks all of its memory).
    pub queue_parts: usize,
    /// Wait for the writer when all buffers are full (`--pace fast`) instead of rejecting the part.
    pub lossless: bool,
    /// Where the source sends again what was lost: the sweep to be answered next, as far as earlier lives have said (their
    /// files may know of later ones). Each sweep is then taken once, as a whole and in order; what does not follow is
    /// rejected as `double` or `ahead`. None: parts are taken as they come.
    pub in_order_from: Option<u64>,
    /// Whether a sensor's clock (or its simulation) paces the sweeps. Without it a return has no time at which it
    /// should have been there: obstacle latencies and deadline misses are then not counted.
    pub paced: bool,
    /// Seconds of sensor time in a second of host time, above 0: 1 where a sensor's own clock paces the sweeps.
    pub rate: f64,
    /// Longest allowed time from a sweep's last return to its detections [ms], positive.
    pub deadline_ms: f64,
    /// Names of the stages by position in the chain, the source first; 1 to [`MAX_HOPS`].
    pub stages: Vec<String>,
}

/// Why the recorder cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecorderError {
    /// A file cannot be created or opened: directory missing, no permission, a directory itself.
    #[error("cannot write {}: {source}; give a path in an existing directory that may be written", path.display())]
    Create {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file to go on with cannot be read or repaired.
    #[error("cannot go on with {}: {source}; move it away or give another path", path.display())]
    Resume {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file to go on with was not written by a recorder.
    #[error("cannot go on with {}: {found:?} is no line of {kind}; move it away or give another path", path.display())]
    Foreign {
        /// As given.
        path: PathBuf,
        /// What the file should hold: "detections", "tracks", "labels" or "a trace".
        kind: &'static str,
        /// Beginning of the line that does not fit.
        found: String,
    },
    /// Two outputs would overwrite each other.
    #[error("two of detections, tracks, labels and trace are {}, must be files of their own", .0.display())]
    SameFile(PathBuf),
    /// The number of buffers is out of range.
    #[error("queue_parts is {0}, must be 1 to {MAX_QUEUE_PARTS}")]
    QueueParts(usize),
    /// The number of stage names is out of range.
    #[error("the chain has {0} stages before the recorder, must be 1 to {MAX_HOPS}")]
    Stages(usize),
    /// The deadline is not a time.
    #[error("deadline_ms is {0}, must be above 0 and at most 3600000")]
    Deadline(f64),
    /// The histograms' bounds were refused; they are constants, so this is a defect.
    #[error("cannot make the histograms: {0}")]
    Histogram(#[from] hdrhistogram::CreationError),
    /// The system gave no thread for the writer.
    #[error("cannot start the writer thread: {0}; raise the limit of processes")]
    Thread(#[source] io::Error),
}

impl Settings {
    /// Refuses values out of range.
    pub(crate) fn check(&self) -> Result<(), RecorderError> {
        if !(1..=MAX_QUEUE_PARTS).contains(&self.queue_parts) {
            return Err(RecorderError::QueueParts(self.queue_parts));
        }
        if !(1..=MAX_HOPS).contains(&self.stages.len()) {
            return Err(RecorderError::Stages(self.stages.len()));
        }
        if !(self.deadline_ms > 0.0 && self.deadline_ms <= 3_600_000.0) {
            return Err(RecorderError::Deadline(self.deadline_ms));
        }
        let outputs = [&self.detections, &self.tracks, &self.labels, &self.trace];
        for (place, one) in outputs.iter().enumerate() {
            for (one, other) in outputs[..place].iter().filter_map(|other| one.as_ref().zip(other.as_ref())) {
                if one == other && !is_null(one) || is_stdout(one) && is_stdout(other) {
                    return Err(RecorderError::SameFile(one.clone()));
                }
            }
        }
        Ok(())
    }
}

/// Whether a path means standard output. `/dev/stdout` is not opened as a file: that would truncate a redirection.
pub(crate) fn is_stdout(path: &Path) -> bool {
    path == Path::new("-") || path == Path::new("/dev/stdout")
}

fn is_null(path: &Path) -> bool {
    path == Path::new("/dev/null")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sut() -> Settings {
        Settings {
            detections: Some("a".into()),
            tracks: None,
            labels: Some("b".into()),
            trace: Some("c".into()),
            statistics: None,
            resume: false,
            queue_parts: 1,
            lossless: false,
            in_order_from: None,
            paced: true,
            rate: 1.0,
            deadline_ms: 100.0,
            stages: vec!["simulator".into()],
        }
    }

    #[test]
    fn values_at_the_bounds_pass_and_those_beyond_are_named() {
        assert!(sut().check().is_ok());
        assert!(Settings { queue_parts: MAX_QUEUE_PARTS, ..sut() }.check().is_ok());
        let error = |settings: Settings| settings.check().unwrap_err().to_string();
        assert_eq!(error(Settings { queue_parts: 0, ..sut() }), "queue_parts is 0, must be 1 to 2048");
        assert_eq!(error(Settings { queue_parts: 2049, ..sut() }), "queue_parts is 2049, must be 1 to 2048");
        assert_eq!(
            error(Settings { stages: vec![], ..sut() }),
            "the chain has 0 stages before the recorder, must be 1 to 8"
        );
        assert!(error(Settings { deadline_ms: f64::NAN, ..sut() }).starts_with("deadline_ms is NaN"));
        assert!(error(Settings { deadline_ms: 0.0, ..sut() }).starts_with("deadline_ms is 0"));
    }

    #[test]
    fn two_outputs_to_one_place_are_refused() {
        assert!(matches!(Settings { labels: Some("a".into()), ..sut() }.check(), Err(RecorderError::SameFile(_))));
        assert!(matches!(Settings { trace: Some("b".into()), ..sut() }.check(), Err(RecorderError::SameFile(_))));
        let both = Settings { detections: Some("-".into()), labels: Some("/dev/stdout".into()), ..sut() };
        assert!(matches!(both.check(), Err(RecorderError::SameFile(_))));
        let both = Settings { detections: Some("-".into()), tracks: Some("-".into()), ..sut() };
        assert!(matches!(both.check(), Err(RecorderError::SameFile(_))));
        let null = || Some("/dev/null".into());
        let nowhere = Settings { detections: null(), labels: null(), trace: null(), ..sut() };
        assert!(nowhere.check().is_ok());
    }
}
