use serde::{Deserialize, Serialize};

use crate::{RealtimeFile, SeatFile};

/// `chain.toml` as written.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ChainFile {
    /// Sectors that a sweep travels as; 1 = whole sweeps.
    pub sectors: u32,
    /// Sweeps that wait for a slow reader before the oldest part is dropped.
    pub queue_sweeps: usize,
    /// From the last return of a sweep to its last detection [ms].
    pub deadline_ms: f64,
    /// Age of a part after its last return at which nobody may act on it any more [ms].
    pub allowed_age_ms: f64,
    /// Restarts that a stage may have within `restart_window_s`; one more and the chain stops.
    pub restarts: u32,
    /// Length of that window [s].
    pub restart_window_s: f64,
    /// What is left out under overload.
    pub overload: OverloadFile,
    /// What is asked of the kernel; without the table nothing is.
    pub realtime: Option<RealtimeFile>,
    /// Where sweeps come from when `--from` says nothing else.
    pub source: SourceFile,
    /// The stages in flow order; the last is the sink.
    #[serde(rename = "stage")]
    pub stages: Vec<StageFile>,
}

/// The default source.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SourceFile {
    /// A scene or a recording; its path is relative to chain.toml.
    pub from: String,
    /// Sweeps that a scene runs for when nobody asks for more or less.
    pub sweeps: u64,
    /// Where the source's process runs; without it wherever the kernel puts it.
    pub realtime: Option<SeatFile>,
}

/// One stage as written.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct StageFile {
    /// The stage's name, as in `encke stage NAME`.
    pub name: String,
    /// The message that it reads.
    pub reads: String,
    /// The message that it writes; none for the sink.
    pub writes: Option<String>,
    /// Its parameters, relative to chain.toml; none where it has none.
    pub parameters: Option<String>,
    /// Time that it may be busy with a sweep [ms]; none for the sink, which the chain does not wait for.
    pub budget_ms: Option<f64>,
    /// Where its process runs; without it wherever the kernel puts it.
    pub realtime: Option<SeatFile>,
}

/// The ladder of overload as written.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OverloadFile {
    /// Names of the steps that are taken, gentlest first; empty: overruns are only counted.
    pub steps: Vec<String>,
    /// Sweeps in trouble, of the last `within_sweeps`, after which a step is taken.
    pub troubled_sweeps: u32,
    /// Sweeps looked back on.
    pub within_sweeps: u32,
    /// Sweeps without trouble after which a step is taken back.
    pub recover_sweeps: u32,
}
