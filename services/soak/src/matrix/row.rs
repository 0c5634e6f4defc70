use serde::{Deserialize, Serialize};

/// What became of one fault.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Row {
    /// When it was injected [s].
    pub t_s: f64,
    /// The fault.
    pub fault: String,
    /// Whom it hit.
    pub stage: Option<String>,
    /// The words after `encke inject`.
    pub words: String,
    /// Why it could not be injected; null where it was.
    pub refused: Option<String>,
    /// From the injection to the first sign that the chain knows [ms].
    pub detected_ms: Option<f64>,
    /// `event`, or `page` where the supervisor's account of the life was the first sign.
    pub detected_by: Option<String>,
    /// What was done, as events: in order, each once.
    pub action: Vec<String>,
    /// From the injection to the end of the longest gap between whole answers [ms]; 0 where there was none, null where it had no
    /// end before the next fault.
    pub output_again_ms: Option<f64>,
    /// Sweeps due that were late, broken or not answered until the next fault.
    pub missed_sweeps: u64,
    /// Parts lost on all hops.
    pub lost: u64,
    /// Parts dropped.
    pub dropped: u64,
    /// Parts rejected.
    pub rejected: u64,
    /// Processes started.
    pub restarts: u64,
    /// What must hold whatever happens.
    pub invariants: Invariants,
}

/// What must hold whatever happens; true where it did.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Invariants {
    /// No count of a page fell.
    pub sequence_rises: bool,
    /// No stage was started more often than its budget allows.
    pub within_budget: bool,
    /// Whom it did not hit kept its process.
    pub neighbours_kept: bool,
    /// No whole answer was older than allowed.
    pub none_stale: bool,
    /// As many file descriptors as before the first fault, and a few that are opened once.
    pub files_back: bool,
    /// As many objects in shared memory as before the first fault, and no longer ones.
    pub shared_memory_back: bool,
}

impl Invariants {
    /// Names of those that did not hold.
    pub fn broken(&self) -> Vec<&'static str> {
        let all = [
            ("sequence fell", self.sequence_rises),
            ("restart budget exceeded", self.within_budget),
            ("a neighbour died", self.neighbours_kept),
            ("a stale answer", self.none_stale),
            ("files not back", self.files_back),
            ("shared memory not back", self.shared_memory_back),
        ];
        all.into_iter().filter(|(_, holds)| !holds).map(|(name, _)| name).collect()
    }
}
