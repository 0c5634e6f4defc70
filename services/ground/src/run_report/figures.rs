//! The figures of a run, as a report names them, read leniently: what an older report lacks is none or empty here, what
//! a newer one has beyond is passed over.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Everything that the page shows.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct RunFigures {
    /// Version of the program.
    pub encke: String,
    /// The machine: cores and kernel.
    pub machine: String,
    /// Where sweeps came from.
    pub source: String,
    /// Sweeps published.
    pub sweeps: u64,
    /// Sectors that a sweep travelled as.
    pub sectors: u64,
    /// `realtime` or `fast`.
    pub pace: String,
    /// Range d of the clusterer [m].
    pub cluster_range_m: Option<f64>,
    /// Duration of a turn [ms].
    pub period_ms: Option<f64>,
    /// Length of the run [s].
    pub duration_s: Option<f64>,
    /// Where every part went.
    pub ledger: Option<Ledger>,
    /// Where the time went.
    pub latency_ms: Latency,
    /// Of obstacles.
    pub obstacle_latency_ms: Option<Percentiles>,
    /// Of obstacles on the seam.
    pub seam_latency_ms: Option<Percentiles>,
    /// Misses and what caused them.
    pub deadline: Option<Deadline>,
    /// What was left out.
    pub overload: Overload,
    /// The sweeps that took longest.
    pub worst_sweeps: Option<Vec<WorstSweep>>,
    /// Answered sweeps by step of degradation.
    pub steps: BTreeMap<String, u64>,
    /// The processes.
    pub processes: Option<Vec<Process>>,
    /// How often what happened, by name; `unsaid` and `unwritten` beside.
    pub events: BTreeMap<String, u64>,
    /// Who had the cores.
    pub machine_load: MachineLoad,
    /// How late a thread wakes.
    pub noise_ms: Option<Percentiles>,
    /// Settings that were refused.
    pub realtime_refused: Vec<String>,
    /// Detections by class.
    pub detections: Option<BTreeMap<String, u64>>,
    /// Accepted returns.
    pub returns: Option<u64>,
    /// Refused returns by reason.
    pub refused: BTreeMap<String, u64>,
    /// Sweeps seen from wrap to wrap.
    pub complete_sweeps: Option<u64>,
    /// Why the run stopped before its end.
    pub stopped: Option<String>,
    /// How the command ended.
    pub verdict: Option<Verdict>,
    /// The distributions.
    pub latency_histogram_ms: Option<Histograms>,
    /// How all this went over time.
    pub timeline: Option<Timeline>,
    /// What the run recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<Recorded>,
    /// Only of figures that are worked out from a recording: what is said of the file itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_from: Option<Recording>,
}

/// See `supervisor::RecordingReport`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Recorded {
    /// The first file.
    pub file: String,
    /// Messages by topic.
    pub topics: Vec<RecordedTopic>,
    /// Files that were begun.
    pub files: u64,
    /// Bytes of all files.
    pub bytes: u64,
}

/// Messages of a topic.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct RecordedTopic {
    /// Its name.
    pub topic: String,
    /// Messages that are there.
    pub messages: u64,
    /// Messages that are not.
    pub lost: u64,
}

/// See `supervisor::LedgerReport`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Ledger {
    /// Whether every part has its place.
    pub closed: bool,
    /// In flow order.
    pub hops: Vec<Hop>,
    /// Missing parts by name.
    pub gaps: Vec<Gap>,
}

/// One hop of the ledger [parts].
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Hop {
    /// The reading stage.
    pub stage: String,
    /// Sent to it.
    pub published: u64,
    /// Came.
    pub received: u64,
    /// Used.
    pub processed: u64,
    /// Not used, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Never came, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// Died with a process.
    pub lost: u64,
    /// On their way.
    pub in_flight: u64,
    /// In no category, or in two.
    pub open: u64,
}

/// Missing parts by name.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Gap {
    /// The stage that did not get them.
    pub stage: String,
    /// `dropped` or `lost`.
    pub kind: String,
    /// First sweep.
    pub first_sweep: u64,
    /// Last sweep.
    pub last_sweep: u64,
    /// Parts missing.
    pub parts: u64,
}

/// A distribution in few numbers [ms].
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Percentiles {
    /// Number of values.
    pub count: u64,
    /// Median.
    pub p50: Option<f64>,
    /// As its name says.
    pub p99: Option<f64>,
    /// As its name says.
    pub p999: Option<f64>,
    /// As its name says.
    pub max: Option<f64>,
}

/// Latencies of sweeps.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Latency {
    /// Of answered sweeps.
    pub end_to_end: Percentiles,
    /// With those that were not.
    pub end_to_end_corrected: Option<Percentiles>,
    /// By stage.
    pub stages: BTreeMap<String, StageLatency>,
}

/// One stage's share.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct StageLatency {
    /// Sent and free until started.
    pub transport: Percentiles,
    /// Sent, and the stage busy.
    pub queued: Percentiles,
    /// In `process`, all parts of a sweep.
    pub busy: Percentiles,
}

/// Misses.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Deadline {
    /// The deadline [ms].
    pub deadline_ms: f64,
    /// Sweeps that missed it.
    pub misses: u64,
    /// Share that 99.9 % of the sweeps leave free [%].
    pub margin_p999_pct: Option<f64>,
    /// Whether that is enough.
    pub margin_ok: Option<bool>,
    /// Misses by cause.
    pub causes: BTreeMap<String, u64>,
}

/// The ladder.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Overload {
    /// Sweeps over budget by stage.
    pub overruns: BTreeMap<String, u64>,
    /// Moves.
    pub moves: Vec<Move>,
    /// All moves.
    pub move_count: u64,
}

/// A move on the ladder.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Move {
    /// First sweep at the new step.
    pub sweep: u64,
    /// Before.
    pub from: String,
    /// After.
    pub to: String,
    /// Why.
    pub reason: String,
}

/// A slow sweep.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct WorstSweep {
    /// Its number.
    pub sweep: u64,
    /// Its latency [ms].
    pub end_to_end_ms: f64,
    /// The largest share.
    pub cause: String,
    /// Degradation.
    pub step: String,
    /// The way of its last part.
    pub hops: Vec<WorstHop>,
}

/// One hop of it [ms].
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct WorstHop {
    /// The stage.
    pub stage: String,
    /// Behind other parts.
    pub queued_ms: f64,
    /// Until it woke.
    pub wake_ms: f64,
    /// Others had the cores.
    pub taken_ms: f64,
    /// At work.
    pub busy_ms: f64,
    /// From when the last return was due.
    pub started_after_due_ms: f64,
    /// The same.
    pub finished_after_due_ms: f64,
}

/// One process.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Process {
    /// The stage.
    pub stage: String,
    /// Its last process.
    pub pid: u64,
    /// Restarts.
    pub restarts: u64,
    /// CPU time; 100 = one core.
    pub cpu_pct: f64,
    /// Most memory.
    pub rss_peak_kib: u64,
    /// Memory after start-up.
    pub rss_first_kib: u64,
    /// Memory at the end.
    pub rss_last_kib: u64,
    /// Ready to run, and another had the core [ms].
    pub run_delay_ms: Option<f64>,
    /// Gave up the core to wait.
    pub voluntary_switches: Option<u64>,
    /// Was made to.
    pub involuntary_switches: Option<u64>,
    /// Inside `process`.
    pub heap_allocations_per_sweep: Option<f64>,
    /// Round it.
    pub shell_heap_allocations_per_sweep: Option<f64>,
}

/// Who had the cores; 100 = one core.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct MachineLoad {
    /// The hypervisor.
    pub steal_pct: Option<f64>,
    /// Other programs.
    pub foreign_cpu_pct: Option<f64>,
    /// This chain.
    pub own_cpu_pct: Option<f64>,
    /// The worst second's steal.
    pub steal_worst_pct: Option<f64>,
    /// The worst second's other programs.
    pub foreign_cpu_worst_pct: Option<f64>,
}

/// How the command ended; none is well.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Verdict {
    /// Why with exit code 1.
    pub failed: Option<String>,
    /// The same with `--strict`.
    pub failed_strict: Option<String>,
}

/// Latency [ms], and how many values are not beyond it.
pub(crate) type Points = Vec<(f64, u64)>;

/// Distributions in points.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Histograms {
    /// Of answered sweeps.
    pub end_to_end: Points,
    /// With those that were not.
    pub end_to_end_corrected: Points,
    /// Of obstacles.
    pub obstacle: Points,
    /// Of obstacles on the seam.
    pub seam: Points,
}

/// See `supervisor::TimelineReport`.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Timeline {
    /// Length of a bucket of sweeps [s].
    pub bucket_s: f64,
    /// By bucket.
    pub latency_ms: Vec<LatencyBucket>,
    /// By stage, for each bucket.
    pub spent_ms: Vec<Spent>,
    /// By class, for each bucket.
    pub detections: BTreeMap<String, Vec<u64>>,
    /// Length of a bucket of samples [s].
    pub sample_s: f64,
    /// Its begins.
    pub sample_t_s: Vec<f64>,
    /// By process, for each sample.
    pub processes: BTreeMap<String, ProcessTimeline>,
    /// For each sample.
    pub machine: MachineTimeline,
    /// What happened.
    pub events: Vec<Event>,
    /// All events.
    pub event_count: u64,
}

/// Sweeps of a bucket.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct LatencyBucket {
    /// Begin [s].
    pub t_s: f64,
    /// Answered.
    pub sweeps: u64,
    /// Median [ms].
    pub p50: Option<f64>,
    /// As its name says.
    pub p99: Option<f64>,
    /// As its name says.
    pub max: Option<f64>,
    /// Late or rejected.
    pub misses: u64,
    /// Never came.
    pub missing: u64,
}

/// One stage's share, means [ms].
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Spent {
    /// The stage.
    pub stage: String,
    /// Sent late.
    pub late: Vec<f64>,
    /// Sent and free until started.
    pub transport: Vec<f64>,
    /// Behind other parts.
    pub queued: Vec<f64>,
    /// At work.
    pub busy: Vec<f64>,
}

/// One process over time.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct ProcessTimeline {
    /// 100 = one core.
    pub cpu_pct: Vec<f64>,
    /// Resident.
    pub rss_kib: Vec<u64>,
}

/// The machine over time.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct MachineTimeline {
    /// This chain.
    pub own_cpu_pct: Vec<Option<f64>>,
    /// Other programs.
    pub foreign_cpu_pct: Vec<Option<f64>>,
    /// The hypervisor.
    pub steal_pct: Vec<Option<f64>>,
    /// How late a thread wakes.
    pub wake_late_max_ms: Vec<f64>,
}

/// Something that happened.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Event {
    /// When [s].
    pub t_s: f64,
    /// `restart` or `step`.
    pub kind: String,
    /// What.
    pub what: String,
}

/// What is said of a recording.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Recording {
    /// The file's name.
    pub file: String,
    /// UTC of the first and the last message.
    pub written_utc: Option<[String; 2]>,
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// Sweeps in the file that had no answer or could not be read.
    pub unread: u64,
    /// What is wrong with the file, where something is.
    pub torn: Option<String>,
    /// Parts received and published by stage, of the last status.
    pub stages: Vec<StageCount>,
}

/// A stage's counts.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct StageCount {
    /// The stage.
    pub stage: String,
    /// Restarts.
    pub restarts: u64,
    /// Parts received.
    pub received: u64,
    /// Parts published; the sink: accepted.
    pub published: u64,
}
