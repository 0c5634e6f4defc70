use serde::{Deserialize, Serialize};

/// `executive.toml` as written.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ExecutiveFile {
    /// How a stage that is well is told from one that is not.
    pub health: HealthFile,
    /// Restarts of all stages together.
    pub chain_budget: ChainBudgetFile,
    /// What becomes of the stages without their supervisor.
    pub supervisor: SupervisorFile,
    /// How much is said.
    pub events: EventsFile,
    /// What is done about a condition; the first that fits counts.
    #[serde(default, rename = "rule")]
    pub rules: Vec<RuleFile>,
    /// Values that are watched.
    #[serde(default, rename = "limit")]
    pub limits: Vec<LimitFile>,
}

/// How a stage that is well is told from one that is not.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HealthFile {
    /// No progress and no computing for so many sweeps: hung.
    pub hung_sweeps: f64,
    /// No progress for this long though it computes: spinning [ms].
    pub spinning_ms: f64,
    /// Input waits for so many sweeps and none is taken; the source: nothing is sent.
    pub silent_sweeps: f64,
    /// Sweeps over its budget, of the last ten: slow.
    pub slow_overruns: u32,
    /// A source that sends so many times as often as its sensor turns floods.
    pub flood_ratio: f64,
    /// A process that says so many events a second floods [1/s].
    pub flood_events_per_s: f64,
}

/// Restarts of all stages together within a sliding window.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ChainBudgetFile {
    /// Most restarts.
    pub restarts: u32,
    /// Within this time [s].
    pub window_s: f64,
}

/// What becomes of the stages without their supervisor.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SupervisorFile {
    /// How long they go on after its death [s].
    pub orphan_s: f64,
}

/// How much is said, of each kind of event of each process.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct EventsFile {
    /// So many at once.
    pub burst: u32,
    /// Then so many a second.
    pub per_s: f64,
    /// Size at which the log is cut to its latest half [MiB].
    pub log_mib: u64,
}

/// What can be the matter with a stage.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// Its process has ended.
    Dead,
    /// It neither computes nor makes progress.
    Hung,
    /// It computes and makes no progress.
    Spinning,
    /// It overruns its budget.
    Slow,
    /// Input waits and none is taken; the source: nothing is sent.
    Silent,
    /// It sends or says too much.
    Flooding,
}

/// What can be done.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Nothing but to say so.
    Event,
    /// One step down the ladder of overload.
    Degrade,
    /// The stage's process is ended, and started again.
    RestartStage,
    /// All stages are ended, and started again.
    RestartChain,
    /// Safe mode.
    Safe,
}

/// What is done when a stage has been in a condition for some time.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RuleFile {
    /// The condition.
    pub when: Condition,
    /// Of these stages; none: of all.
    #[serde(default)]
    pub stages: Vec<String>,
    /// For how long [ms].
    #[serde(default)]
    pub after_ms: f64,
    /// What is done.
    pub then: Action,
}

/// A value that can be watched.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Watch {
    /// Of the latest sweep, from its last return to its last detection [ms].
    LatencyMs,
    /// What of the deadline that left [%].
    MarginPct,
    /// Sweeps answered in the last second [Hz].
    RateHz,
    /// Parts dropped in the last second, of those sent.
    DropRatio,
    /// A process's resident memory [MiB].
    RssMib,
    /// A process's open files.
    OpenFiles,
    /// A process's threads.
    Threads,
    /// A process's share of a core in the last second [%].
    CpuPct,
    /// What the instance holds of shared memory [MiB].
    SharedMemoryMib,
    /// What is free where the run records, or in the instance's folder [MiB].
    DiskFreeMib,
}

impl Watch {
    /// Whether each process has its own.
    pub fn is_of_a_process(self) -> bool {
        matches!(self, Self::RssMib | Self::OpenFiles | Self::Threads | Self::CpuPct)
    }

    /// Whether it comes with each sweep, not with each second.
    pub fn is_of_a_sweep(self) -> bool {
        matches!(self, Self::LatencyMs | Self::MarginPct)
    }
}

/// A value that is watched.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LimitFile {
    /// Its name in events; each once.
    pub name: String,
    /// What is watched.
    pub watch: Watch,
    /// Of these processes; none: of each.
    #[serde(default)]
    pub stages: Vec<String>,
    /// Out of bounds above this.
    pub above: Option<f64>,
    /// Out of bounds below this.
    pub below: Option<f64>,
    /// Looks in a row before it counts, and before it is over.
    pub persist: u32,
    /// Time without a new value after which it is stale [s].
    pub stale_after_s: f64,
    /// What is done.
    pub then: Action,
}
