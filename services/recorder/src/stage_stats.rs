use hdrhistogram::CreationError;
use messages::Verdict;

use crate::cause::Kind;
use crate::latency::Latency;
use crate::segments::HopSegments;
use crate::snapshot::{StageSnapshot, count_verdicts};

/// Parts by verdict.
pub(crate) type Verdicts = [u64; Verdict::ALL.len()];

/// One stage's share of the time, and its misses.
pub(crate) struct StageStatistics {
    pub(crate) name: String,
    transport: Latency,
    queued: Latency,
    busy: Latency,
    busy_part: Latency,
    /// Work on the parts of the open sweep so far [ns].
    open_busy_ns: u64,
    verdicts: Verdicts,
    /// Misses of which it was the cause, by [`Kind`].
    pub(crate) misses: [u64; Kind::ALL.len()],
    /// Sweeps without an answer because it rejected a part, by verdict; those on purpose apart.
    pub(crate) rejected_sweeps: Verdicts,
}

impl StageStatistics {
    pub(crate) fn new(name: &str) -> Result<Self, CreationError> {
        Ok(Self {
            name: name.to_owned(),
            transport: Latency::new()?,
            queued: Latency::new()?,
            busy: Latency::new()?,
            busy_part: Latency::new()?,
            open_busy_ns: 0,
            verdicts: Verdicts::default(),
            misses: [0; Kind::ALL.len()],
            rejected_sweeps: Verdicts::default(),
        })
    }

    /// Adds a part; `begins` a sweep, or goes on with one.
    pub(crate) fn add(&mut self, segments: &HopSegments, verdict: Verdict, is_source: bool, begins: bool) {
        self.verdicts[verdict as usize] += 1;
        self.open_busy_ns = if begins { 0 } else { self.open_busy_ns } + segments.busy_ns;
        self.busy_part.record(segments.busy_ns);
        if !is_source {
            self.transport.record(segments.transport_ns);
            self.queued.record(segments.queued_ns);
        }
    }

    /// The open sweep was answered with its last part.
    pub(crate) fn answer(&mut self) {
        self.busy.record(self.open_busy_ns);
    }

    pub(crate) fn snapshot_into(&self, snapshot: &mut StageSnapshot) {
        snapshot.stage.clone_from(&self.name);
        self.transport.snapshot_into(&mut snapshot.transport);
        self.queued.snapshot_into(&mut snapshot.queued);
        self.busy.snapshot_into(&mut snapshot.busy);
        self.busy_part.snapshot_into(&mut snapshot.busy_part);
        count_verdicts(&mut snapshot.verdicts, &self.verdicts);
    }
}
