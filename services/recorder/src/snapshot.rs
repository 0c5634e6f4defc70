use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use lidar::ObstacleClass;
use serde::{Deserialize, Serialize};

use crate::latency::LatencySnapshot;
use crate::worst::{WorstSweep, merge};

/// Version of the file's layout.
pub const VERSION: u32 = 1;

/// The recorder's statistics at one moment: of one life of its process, or merged, of several.
///
/// The file is JSON. Maps hold only what occurred, save `detections`, which has every class.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Snapshot {
    /// [`VERSION`]; 0 in an empty snapshot.
    pub version: u32,
    /// Parts that came, rejected ones included.
    pub parts: u64,
    /// Sweeps of which a part came.
    pub sweeps: u64,
    /// Sweeps of which every part came and was used, and which saw the whole turn.
    pub complete_sweeps: u64,
    /// Sweeps between the first and the last of which no part came.
    pub missing_sweeps: u64,
    /// Number of the first sweep.
    pub first_sweep: Option<u64>,
    /// Number of the last sweep.
    pub last_sweep: Option<u64>,
    /// Duration of the last sweep's turn [ns].
    pub period_ns: Option<u64>,
    /// Accepted returns.
    pub returns: u64,
    /// Refused returns by reason.
    pub refused: BTreeMap<String, u64>,
    /// Clusters by class.
    pub detections: BTreeMap<ObstacleClass, u64>,
    /// Parts by the recorder's own verdict, other than complete.
    pub verdicts: BTreeMap<String, u64>,
    /// Sweeps that a failed file lacks.
    pub lost_sweeps: LostSweeps,
    /// From a sweep's last return to its last detection sent, once a sweep.
    pub end_to_end: LatencySnapshot,
    /// From a part's last return to its being sent by the source, once a part.
    pub source_late: LatencySnapshot,
    /// From a cluster's last return to its detection sent: at least 5 points, not at the seam, paced sources only.
    pub obstacle: LatencySnapshot,
    /// The same of clusters whose window touches the seam.
    pub seam: LatencySnapshot,
    /// The sweeps that took longest, longest first.
    pub worst: Vec<WorstSweep>,
    /// Deadline misses; paced sources only.
    pub deadline: Deadline,
    /// The stages in chain order, the source first.
    pub stages: Vec<StageSnapshot>,
}

/// Sweeps that were accepted and not written because the file had failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LostSweeps {
    /// Of the detections' file.
    pub detections: u64,
    /// Of the labels' file.
    pub labels: u64,
}

/// Sweeps whose end-to-end latency was over the deadline.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deadline {
    /// The deadline [ms].
    pub deadline_ms: f64,
    /// Sweeps that missed it.
    pub misses: u64,
    /// Misses by the longest segment of the sweep's way: `source late`, or a stage and `queued`, `transport`, `busy`.
    pub causes: BTreeMap<String, u64>,
}

/// One stage's share of the parts' time, once a part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageSnapshot {
    /// Its name.
    pub stage: String,
    /// From sent (and the stage free) until `process` began; empty for the source.
    pub transport: LatencySnapshot,
    /// Sent, and the stage still busy with a part before; empty for the source.
    pub queued: LatencySnapshot,
    /// In `process`.
    pub busy: LatencySnapshot,
    /// Parts by verdict, other than complete.
    pub verdicts: BTreeMap<String, u64>,
}

/// Why a snapshot cannot be written, read or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotError {
    /// The file or its directory cannot be written or read.
    #[error("cannot reach {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file holds something else.
    #[error("{} is no snapshot: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Where it fails to be one.
        source: serde_json::Error,
    },
    /// Written by another version of the program.
    #[error("{} has version {version}, must be {VERSION}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// As read.
        version: u32,
    },
    /// The two are of different chains.
    #[error("snapshots of the stages {0:?} and {1:?} cannot be merged")]
    Stages(Vec<String>, Vec<String>),
}

impl Snapshot {
    /// Writes the file beside its place, then puts it there: a reader sees the old or the new one, never half of it.
    ///
    /// # Errors
    /// [`SnapshotError::File`].
    pub fn write(&self, path: &Path) -> Result<(), SnapshotError> {
        let mut beside = path.as_os_str().to_owned();
        beside.push(".new");
        let json =
            serde_json::to_vec(self).map_err(|source| SnapshotError::Content { path: path.to_owned(), source })?;
        let file = |source| SnapshotError::File { path: path.to_owned(), source };
        fs::write(&beside, json).map_err(file)?;
        fs::rename(&beside, path).map_err(file)
    }

    /// Reads a file of [`Snapshot::write`].
    ///
    /// # Errors
    /// The file is missing, holds something else, or is of another version.
    pub fn read(path: &Path) -> Result<Self, SnapshotError> {
        let bytes = fs::read(path).map_err(|source| SnapshotError::File { path: path.to_owned(), source })?;
        let snapshot: Self = serde_json::from_slice(&bytes)
            .map_err(|source| SnapshotError::Content { path: path.to_owned(), source })?;
        match snapshot.version {
            VERSION => Ok(snapshot),
            version => Err(SnapshotError::Version { path: path.to_owned(), version }),
        }
    }

    /// Adds a later life of the same recorder. A life that ended at a sweep's end and the next one together give what
    /// one life would have given; a sweep cut in two by the restart counts once, and as incomplete.
    ///
    /// # Errors
    /// [`SnapshotError::Stages`] when the stages differ; nothing is added then.
    pub fn merge(&mut self, later: &Self) -> Result<(), SnapshotError> {
        if later.version == 0 {
            return Ok(());
        }
        if self.version == 0 {
            self.clone_from(later);
            return Ok(());
        }
        let names = |snapshot: &Self| snapshot.stages.iter().map(|stage| stage.stage.clone()).collect::<Vec<_>>();
        if names(self) != names(later) {
            return Err(SnapshotError::Stages(names(self), names(later)));
        }
        self.parts += later.parts;
        self.sweeps += later.sweeps;
        if let (Some(last), Some(first)) = (self.last_sweep, later.first_sweep) {
            self.sweeps -= u64::from(first == last);
            self.missing_sweeps += first.saturating_sub(last.saturating_add(1));
        }
        self.complete_sweeps += later.complete_sweeps;
        self.missing_sweeps += later.missing_sweeps;
        self.first_sweep = self.first_sweep.or(later.first_sweep);
        self.last_sweep = self.last_sweep.max(later.last_sweep);
        self.period_ns = later.period_ns.or(self.period_ns);
        self.returns += later.returns;
        add(&mut self.refused, &later.refused);
        add(&mut self.detections, &later.detections);
        add(&mut self.verdicts, &later.verdicts);
        self.lost_sweeps.detections += later.lost_sweeps.detections;
        self.lost_sweeps.labels += later.lost_sweeps.labels;
        self.end_to_end.merge(&later.end_to_end);
        self.source_late.merge(&later.source_late);
        self.obstacle.merge(&later.obstacle);
        self.seam.merge(&later.seam);
        merge(&mut self.worst, &later.worst);
        self.deadline.misses += later.deadline.misses;
        add(&mut self.deadline.causes, &later.deadline.causes);
        for (stage, later) in self.stages.iter_mut().zip(&later.stages) {
            stage.transport.merge(&later.transport);
            stage.queued.merge(&later.queued);
            stage.busy.merge(&later.busy);
            add(&mut stage.verdicts, &later.verdicts);
        }
        Ok(())
    }

    /// Share of the deadline that 99.9 % of the sweeps leave free [%]; negative past it, none before the first sweep.
    pub fn margin_p999_pct(&self) -> Option<f64> {
        let p999 = self.end_to_end.percentiles().p999?;
        Some((self.deadline.deadline_ms - p999) / self.deadline.deadline_ms * 100.0)
    }
}

/// Sets a count by name; one of zero is left out.
pub(crate) fn count(names: &mut BTreeMap<String, u64>, name: &str, number: u64) {
    match names.get_mut(name) {
        Some(count) => *count = number,
        None if number > 0 => drop(names.insert(name.to_owned(), number)),
        None => {}
    }
}

fn add<K: Ord + Clone>(sums: &mut BTreeMap<K, u64>, counts: &BTreeMap<K, u64>) {
    for (key, number) in counts {
        *sums.entry(key.clone()).or_default() += number;
    }
}
