//! What a stage did with its latest parts, so that a part that had to queue can say for what.

use std::collections::VecDeque;

use messages::Hop;

use crate::cause::{Kind, Shares};
use crate::segments::HopSegments;

/// Parts that are remembered: more than a queue holds.
const KEPT: usize = 256;

/// A stretch of host time [ns]; empty where it ends before it begins.
type Stretch = (u64, u64);

/// The stage's time with one part.
#[derive(Clone, Copy)]
struct Span {
    /// Between the death of the life before and the time when this one was up; empty in the same life.
    down: Stretch,
    /// Sent and free, until `process` began; and what was taken of it.
    wait: Stretch,
    taken_before_ns: u64,
    /// In `process`; and what was taken of it.
    busy: Stretch,
    taken_busy_ns: u64,
    incarnation: u32,
}

/// The latest parts of one stage, oldest first. All memory is made with it.
pub(crate) struct History {
    spans: VecDeque<Span>,
}

impl History {
    pub(crate) fn new() -> Self {
        Self { spans: VecDeque::with_capacity(KEPT) }
    }

    pub(crate) fn note(&mut self, hop: &Hop, sent_ns: u64, segments: &HopSegments) {
        if self.spans.len() == KEPT {
            self.spans.pop_front();
        }
        self.spans.push_back(Span {
            down: self.down_before(hop),
            wait: (hop.free_ns.max(sent_ns), hop.started_ns),
            taken_before_ns: segments.taken_before_ns,
            busy: (hop.started_ns, hop.finished_ns),
            taken_busy_ns: segments.taken_busy_ns,
            incarnation: hop.incarnation,
        });
    }

    /// Charges the time that a part, not noted yet, had to queue: to the parts before, to a restart, and what neither
    /// explains to queueing itself.
    pub(crate) fn charge_queue(&self, hop: &Hop, sent_ns: u64) -> Shares {
        let queue = (sent_ns, hop.free_ns.min(hop.received_ns));
        let mut shares = Shares::default();
        shares[Kind::Restart as usize] = overlap_ns(queue, self.down_before(hop));
        for span in self.spans.iter().rev() {
            let (wait_ns, busy_ns) = (overlap_ns(queue, span.wait), overlap_ns(queue, span.busy));
            let (before_ns, within_ns) = (span.taken_before_ns.min(wait_ns), span.taken_busy_ns.min(busy_ns));
            shares[Kind::WakeUp as usize] += wait_ns - before_ns;
            shares[Kind::Compute as usize] += busy_ns - within_ns;
            shares[Kind::CpuTaken as usize] += before_ns + within_ns;
            shares[Kind::Restart as usize] += overlap_ns(queue, span.down);
            if span.busy.1 <= queue.0 {
                break;
            }
        }
        let explained = shares.iter().sum::<u64>();
        shares[Kind::Queueing as usize] = queue.1.saturating_sub(queue.0).saturating_sub(explained);
        shares
    }

    /// When nobody was there, if the part is the first of a new life.
    fn down_before(&self, hop: &Hop) -> Stretch {
        match self.spans.back() {
            Some(last) if last.incarnation < hop.incarnation => (last.busy.1, hop.free_ns),
            _ => (0, 0),
        }
    }
}

fn overlap_ns(one: Stretch, other: Stretch) -> u64 {
    one.1.min(other.1).saturating_sub(one.0.max(other.0))
}
