use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use lidar::ObstacleClass;
use messages::Verdict;
use serde::{Deserialize, Serialize};

use crate::answers::{self, Answered};
use crate::latency::LatencySnapshot;
use crate::stage_stats::Verdicts;
use crate::timeline::TimelineSnapshot;
use crate::worst::{WorstSweep, merge};

/// What is written at a time [bytes].
const BUFFER_BYTES: usize = 1 << 16;

/// Version of the file's layout.
pub const VERSION: u32 = 5;

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
    /// Parts between the first and the last that did not come.
    pub missing_parts: u64,
    /// Ordinal of the first part.
    pub first_ordinal: Option<u64>,
    /// Largest ordinal of a part.
    pub last_ordinal: Option<u64>,
    /// Sweeps that were answered (every part came and was used) by the step of degradation at which they were processed.
    pub steps: BTreeMap<String, u64>,
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
    /// From a sweep's last return to its last detection sent, of every sweep that was answered.
    pub end_to_end: LatencySnapshot,
    /// The same, and of each sweep without an answer between two that have one the time from its last return to the next
    /// sweep's last detection sent; paced sources only.
    pub end_to_end_corrected: LatencySnapshot,
    /// The ends of the row of sweeps that were answered; paced sources only.
    pub answered: Option<Answered>,
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
    /// How all this went over time.
    pub timeline: TimelineSnapshot,
    /// The stages in chain order, the source first.
    pub stages: Vec<StageSnapshot>,
    /// What became of the trace file's events; none where no such file is written.
    pub trace: Option<TraceCounts>,
    /// What the tables of tracks held; none where none came.
    pub tracks: Option<TrackCounts>,
}

/// Tables of tracks in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackCounts {
    /// Most confirmed tracks in one table, coasting ones included.
    pub confirmed_max: u64,
    /// Confirmed tracks in the last table, coasting ones included.
    pub confirmed_last: u64,
    /// Alerts that began. One that outlasts a restart of the recorder begins anew with it.
    pub alerts: u64,
}

impl TrackCounts {
    /// Adds what later tables held.
    pub(crate) fn merge(&mut self, later: &Self) {
        self.confirmed_max = self.confirmed_max.max(later.confirmed_max);
        self.confirmed_last = later.confirmed_last;
        self.alerts += later.alerts;
    }
}

/// A trace file in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TraceCounts {
    /// Events written, names of processes and threads included.
    pub events: u64,
    /// Parts that came and of which there are no events: the writer was behind, or the file had failed.
    pub lost: u64,
    /// Whether the file had failed.
    pub failed: bool,
}

/// Sweeps that were accepted and not written because the file had failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LostSweeps {
    /// Of the detections' file.
    pub detections: u64,
    /// Of the tracks' file.
    pub tracks: u64,
    /// Of the labels' file.
    pub labels: u64,
}

/// Sweeps that were answered after the deadline, or not at all although every part of them came: rejected, and not on
/// purpose. Those of which parts are missing are the ledger's to name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deadline {
    /// The deadline [ms].
    pub deadline_ms: f64,
    /// Sweeps that missed it.
    pub misses: u64,
    /// Misses by cause, one each: a stage and `late` (the source), `wake-up`, `queueing`, `compute`, `cpu taken`,
    /// `restart`, or the verdict by which it rejected the sweep.
    pub causes: BTreeMap<String, u64>,
}

/// One stage's share of the time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageSnapshot {
    /// Its name.
    pub stage: String,
    /// From sent (and the stage free) until `process` began, once a part; empty for the source.
    pub transport: LatencySnapshot,
    /// Sent, and the stage still busy with a part before, once a part; empty for the source.
    pub queued: LatencySnapshot,
    /// In `process`, all parts of a sweep together, of every sweep that was answered.
    pub busy: LatencySnapshot,
    /// In `process`, once a part.
    pub busy_part: LatencySnapshot,
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
        let file = |source| SnapshotError::File { path: path.to_owned(), source };
        // Written as it is made: the text of a long run is megabytes, once a second.
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, File::create(&beside).map_err(file)?);
        serde_json::to_writer(&mut out, self).map_err(|source| file(source.into()))?;
        out.flush().map_err(file)?;
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
        let mut missing_between = 0;
        self.sweeps += later.sweeps;
        if let (Some(last), Some(first)) = (self.last_sweep, later.first_sweep) {
            self.sweeps -= u64::from(first == last);
            missing_between = first.saturating_sub(last.saturating_add(1));
            self.missing_sweeps += missing_between;
        }
        if let (Some(last), Some(first)) = (self.last_ordinal, later.first_ordinal) {
            self.missing_parts += first.saturating_sub(last.saturating_add(1));
        }
        self.missing_parts += later.missing_parts;
        self.first_ordinal = self.first_ordinal.or(later.first_ordinal);
        self.last_ordinal = self.last_ordinal.max(later.last_ordinal);
        add(&mut self.steps, &later.steps);
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
        self.lost_sweeps.tracks += later.lost_sweeps.tracks;
        self.lost_sweeps.labels += later.lost_sweeps.labels;
        self.end_to_end.merge(&later.end_to_end);
        answers::merge(
            (&mut self.end_to_end_corrected, &mut self.answered),
            (&later.end_to_end_corrected, later.answered),
        );
        self.source_late.merge(&later.source_late);
        self.obstacle.merge(&later.obstacle);
        self.seam.merge(&later.seam);
        merge(&mut self.worst, &later.worst);
        self.timeline.merge(&later.timeline, missing_between, self.stages.len());
        self.deadline.misses += later.deadline.misses;
        add(&mut self.deadline.causes, &later.deadline.causes);
        for (stage, later) in self.stages.iter_mut().zip(&later.stages) {
            stage.transport.merge(&later.transport);
            stage.queued.merge(&later.queued);
            stage.busy.merge(&later.busy);
            stage.busy_part.merge(&later.busy_part);
            add(&mut stage.verdicts, &later.verdicts);
        }
        if let Some(later) = later.trace {
            let trace = self.trace.get_or_insert_default();
            trace.events += later.events;
            trace.lost += later.lost;
            trace.failed |= later.failed;
        }
        if let Some(later) = &later.tracks {
            self.tracks.get_or_insert_default().merge(later);
        }
        Ok(())
    }

    /// Share of the deadline that 99.9 % of the sweeps leave free [%], those without an answer included; negative past
    /// it, none before the first answer and without pace.
    pub fn margin_p999_pct(&self) -> Option<f64> {
        let p999 = self.end_to_end_corrected.percentiles().p999?;
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

/// Verdicts other than `Complete`, which is every other part.
pub(crate) fn count_verdicts(names: &mut BTreeMap<String, u64>, verdicts: &Verdicts) {
    for verdict in Verdict::ALL.into_iter().filter(|&verdict| verdict != Verdict::Complete) {
        count(names, verdict.name(), verdicts[verdict as usize]);
    }
}

fn add<K: Ord + Clone>(sums: &mut BTreeMap<K, u64>, counts: &BTreeMap<K, u64>) {
    for (key, number) in counts {
        *sums.entry(key.clone()).or_default() += number;
    }
}
