//! Traces → how long sweeps took, how long each stage worked on them, which were missed.

use std::collections::VecDeque;

use messages::{MAX_HOPS, Trace, Verdict};

use crate::attached::Facts;
use crate::top::view::{LatencyView, TapView};

/// Sweeps that the percentiles are of.
const WINDOW: usize = 100;
/// Sweeps that are remembered to be drawn.
const HISTORY: usize = 240;

/// What became of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ended {
    sweep: u64,
    /// From its last return to its last detection sent; none where it was not answered.
    latency_ns: Option<u64>,
    /// Work of each stage; none where not every part was seen.
    busy_ns: Option<[u64; MAX_HOPS]>,
}

/// A sweep of which parts are still to come.
#[derive(Clone, Copy, Default)]
struct Open {
    sweep: u64,
    parts: u32,
    rejected: bool,
    shed: bool,
    /// Parts passed unseen since the sweep before.
    unseen: bool,
    busy_ns: [u64; MAX_HOPS],
}

/// The last sweeps.
pub(super) struct Sweeps {
    deadline_ms: Option<f64>,
    tap: TapView,
    next_sequence: Option<u64>,
    open: Option<Open>,
    last_sweep: Option<u64>,
    recent: VecDeque<Ended>,
    missed: u64,
    busy_ns: [u64; MAX_HOPS],
}

impl Sweeps {
    pub(super) fn new(facts: &Facts) -> Self {
        Self {
            deadline_ms: facts.paced.then_some(facts.deadline_ms),
            tap: TapView::default(),
            next_sequence: None,
            open: None,
            last_sweep: None,
            recent: VecDeque::with_capacity(HISTORY + 1),
            missed: 0,
            busy_ns: [0; MAX_HOPS],
        }
    }

    /// Adds a part. Whether every part of its sweep up to this one was seen.
    pub(super) fn add(&mut self, trace: &Trace) -> bool {
        let hops = trace.hops();
        let sequence = hops.last().map_or(0, |hop| hop.sequence);
        let missed = self.next_sequence.map_or(0, |next| sequence.saturating_sub(next));
        // What passed before the first part passed unseen, too.
        let unseen = self.next_sequence.is_none() || missed > 0;
        self.next_sequence = Some(sequence + 1);
        self.tap.parts += 1;
        self.tap.missed += missed;

        if self.open.is_none_or(|open| open.sweep != trace.part.sweep) {
            self.end_unfinished(unseen);
            self.skip_to(trace.part.sweep, unseen);
            self.open = Some(Open { sweep: trace.part.sweep, ..Open::default() });
        }
        let Some(open) = &mut self.open else { return false };
        open.parts += 1;
        open.unseen |= unseen;
        for (place, hop) in hops.iter().enumerate() {
            // The source works from when it began to make the part until it waits for its time.
            let (from_ns, to_ns) =
                if place == 0 { (hop.received_ns, hop.started_ns) } else { (hop.started_ns, hop.finished_ns) };
            let busy_ns = to_ns.saturating_sub(from_ns);
            open.busy_ns[place] += busy_ns;
            self.busy_ns[place] += busy_ns;
            open.rejected |= hop.verdict.is_rejected();
            open.shed |= hop.verdict == Verdict::RejectedShed;
        }
        let whole = open.parts == trace.part.sector + 1;
        if trace.part.is_last() {
            let open = *open;
            self.open = None;
            self.end(&open, trace, whole);
        }
        whole
    }

    /// A sweep's last part has come.
    fn end(&mut self, open: &Open, trace: &Trace, whole: bool) {
        let answered = !open.rejected && (whole || open.unseen);
        let latency_ns = trace.hops().last().map(|hop| hop.finished_ns.saturating_sub(trace.due_ns));
        let busy_ns = whole.then_some(open.busy_ns);
        // What is shed on purpose is no miss.
        if answered || !open.shed {
            self.push(Ended { sweep: open.sweep, latency_ns: latency_ns.filter(|_| answered), busy_ns });
        }
        self.last_sweep = Some(open.sweep);
    }

    /// Another sweep begins: what is open never got its last part, unless that passed unseen.
    fn end_unfinished(&mut self, unseen: bool) {
        if let Some(open) = self.open.take() {
            if !unseen && !open.unseen && !open.shed {
                self.push(Ended { sweep: open.sweep, latency_ns: None, busy_ns: None });
            }
            self.last_sweep = Some(open.sweep);
        }
    }

    /// Sweeps of which no part came were not answered, unless they passed unseen.
    fn skip_to(&mut self, sweep: u64, unseen: bool) {
        let Some(last) = self.last_sweep.filter(|_| !unseen) else { return };
        for missing in (last + 1..sweep).take(HISTORY) {
            self.push(Ended { sweep: missing, latency_ns: None, busy_ns: None });
        }
    }

    fn push(&mut self, ended: Ended) {
        if self.is_miss(&ended) {
            self.missed += 1;
        }
        self.recent.push_back(ended);
        if self.recent.len() > HISTORY {
            self.recent.pop_front();
        }
    }

    fn is_miss(&self, ended: &Ended) -> bool {
        self.deadline_ms.is_some_and(|deadline_ms| ended.latency_ns.is_none_or(|ns| ns as f64 / 1e6 > deadline_ms))
    }

    fn window(&self) -> impl Iterator<Item = &Ended> {
        self.recent.iter().skip(self.recent.len().saturating_sub(WINDOW))
    }

    /// Work of each stage on all parts seen so far.
    pub(super) fn busy_ns(&self) -> &[u64] {
        &self.busy_ns
    }

    pub(super) fn tap(&self) -> TapView {
        self.tap
    }

    /// Work of a stage on one sweep: the 50th and the 99th percentile [ms].
    pub(super) fn busy_ms(&self, place: usize) -> (Option<f64>, Option<f64>) {
        let mut busy_ns: Vec<u64> =
            self.window().filter_map(|ended| ended.busy_ns?.get(place).copied()).filter(|&ns| ns > 0).collect();
        busy_ns.sort_unstable();
        (percentile_ms(&busy_ns, 50), percentile_ms(&busy_ns, 99))
    }

    pub(super) fn latency(&self) -> LatencyView {
        let mut ns: Vec<u64> = self.window().filter_map(|ended| ended.latency_ns).collect();
        ns.sort_unstable();
        LatencyView {
            deadline_ms: self.deadline_ms,
            sweeps: ns.len(),
            p50_ms: percentile_ms(&ns, 50),
            p99_ms: percentile_ms(&ns, 99),
            max_ms: percentile_ms(&ns, 100),
            missed: self.window().filter(|ended| self.is_miss(ended)).count(),
            missed_in_all: self.missed,
            recent_ms: self.recent.iter().map(|ended| ended.latency_ns.map(ms)).collect(),
        }
    }
}

/// The smallest of the sorted values that `percent` of them do not exceed; none of none.
fn percentile_ms(sorted_ns: &[u64], percent: usize) -> Option<f64> {
    let rank = (sorted_ns.len() * percent).div_ceil(100);
    sorted_ns.get(rank.max(1) - 1).copied().map(ms)
}

/// Milliseconds, to the microsecond.
fn ms(ns: u64) -> f64 {
    (ns as f64 / 1e3).round() / 1e3
}
