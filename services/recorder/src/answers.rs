//! Latency corrected for coordinated omission: sweeps that had no answer count, too.
//!
//! Whoever looks at a sweep's data acts on the next answer there is. A sweep without one (dropped, lost, rejected)
//! between two that have one therefore counts with the time from when *its* last return was due until the answer of the
//! next: the next one's latency, and a period for each sweep that it came earlier. Known from the sweeps' numbers and
//! the period alone. Sweeps before the first answer and after the last one do not count.

use serde::{Deserialize, Serialize};

use crate::latency::{Latency, LatencySnapshot};

/// The ends of a row of answered sweeps: what joins one life's distribution to the next one's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answered {
    /// The first sweep that was answered.
    pub first_sweep: u64,
    /// From its last return to its last detection sent [ns].
    pub first_end_to_end_ns: u64,
    /// Duration of its turn [ns].
    pub first_period_ns: u64,
    /// The last sweep that was answered.
    pub last_sweep: u64,
}

/// The corrected distribution in the making.
pub(crate) struct Answers {
    latency: Latency,
    answered: Option<Answered>,
}

impl Answers {
    pub(crate) fn new() -> Result<Self, hdrhistogram::CreationError> {
        Ok(Self { latency: Latency::new()?, answered: None })
    }

    /// Adds an answered sweep, and those before it that had to wait for this answer.
    pub(crate) fn add(&mut self, sweep: u64, end_to_end_ns: u64, period_ns: u64) {
        let first = Answered {
            first_sweep: sweep,
            first_end_to_end_ns: end_to_end_ns,
            first_period_ns: period_ns,
            last_sweep: sweep,
        };
        let answered = self.answered.get_or_insert(first);
        let unanswered = sweep.saturating_sub(answered.last_sweep.saturating_add(1));
        answered.last_sweep = answered.last_sweep.max(sweep);
        record_unanswered(&mut self.latency, unanswered, end_to_end_ns, period_ns);
        self.latency.record(end_to_end_ns);
    }

    pub(crate) fn snapshot_into(&self, latency: &mut LatencySnapshot, answered: &mut Option<Answered>) {
        self.latency.snapshot_into(latency);
        *answered = self.answered;
    }
}

/// Joins a later life's distribution to an earlier one's.
pub(crate) fn merge(
    (latency, answered): (&mut LatencySnapshot, &mut Option<Answered>),
    (later, later_answered): (&LatencySnapshot, Option<Answered>),
) {
    latency.merge(later);
    let Some(after) = later_answered else { return };
    let Some(before) = answered else {
        *answered = Some(after);
        return;
    };
    let unanswered = after.first_sweep.saturating_sub(before.last_sweep.saturating_add(1));
    before.last_sweep = before.last_sweep.max(after.last_sweep);
    // The bounds are constants: this cannot fail.
    if let Ok(mut between) = Latency::new() {
        record_unanswered(&mut between, unanswered, after.first_end_to_end_ns, after.first_period_ns);
        let mut snapshot = LatencySnapshot::default();
        between.snapshot_into(&mut snapshot);
        latency.merge(&snapshot);
    }
}

/// Records the sweeps before one that was answered, the latest first.
fn record_unanswered(latency: &mut Latency, unanswered: u64, end_to_end_ns: u64, period_ns: u64) {
    let mut waited_ns = end_to_end_ns;
    for recorded in 0..unanswered {
        waited_ns = waited_ns.saturating_add(period_ns);
        if Latency::is_beyond(waited_ns) || period_ns == 0 {
            // All that are left waited for longer still, or nobody knows for how long.
            latency.record_n(waited_ns, unanswered - recorded);
            return;
        }
        latency.record(waited_ns);
    }
}
