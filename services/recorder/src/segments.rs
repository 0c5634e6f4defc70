//! A part's trace, cut into the times that it spent: end to end = source late + Σ (queued + transport + busy).

use messages::{Hop, MAX_HOPS, Trace};

/// One stage's share of a part's time [ns].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HopSegments {
    /// The part was sent, and the stage was still busy with one before.
    pub(crate) queued_ns: u64,
    /// From the moment that the part was sent and the stage free, until `process` began.
    pub(crate) transport_ns: u64,
    /// The share of `transport_ns` in which the stage was ready to run and other processes had the cores.
    pub(crate) taken_before_ns: u64,
    /// In `process`.
    pub(crate) busy_ns: u64,
    /// The same share of `busy_ns`.
    pub(crate) taken_busy_ns: u64,
}

impl HopSegments {
    /// Of a stage that reads; `sent_ns` is when the one before sent the part.
    pub(crate) fn of(hop: &Hop, sent_ns: u64) -> Self {
        let transport_ns =
            hop.received_ns.saturating_sub(hop.free_ns.max(sent_ns)) + hop.started_ns.saturating_sub(hop.received_ns);
        Self {
            queued_ns: hop.free_ns.min(hop.received_ns).saturating_sub(sent_ns),
            transport_ns,
            // A stage that was idle before may have waited for a core for other reasons.
            taken_before_ns: u64::from(hop.taken_before_ns).min(transport_ns),
            ..Self::of_source(hop)
        }
    }

    fn of_source(hop: &Hop) -> Self {
        let busy_ns = hop.finished_ns.saturating_sub(hop.started_ns);
        Self { busy_ns, taken_busy_ns: u64::from(hop.taken_busy_ns).min(busy_ns), ..Self::default() }
    }

    /// Free and sent, until `process` began, less what was taken [ns].
    pub(crate) fn wake_ns(&self) -> u64 {
        self.transport_ns - self.taken_before_ns
    }

    /// In `process`, less what was taken [ns].
    pub(crate) fn compute_ns(&self) -> u64 {
        self.busy_ns - self.taken_busy_ns
    }

    /// Ready to run, and without a core [ns].
    pub(crate) fn taken_ns(&self) -> u64 {
        self.taken_before_ns + self.taken_busy_ns
    }
}

/// A part's whole way, source first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Segments {
    /// From the part's last return to the source's sending it.
    pub(crate) source_late_ns: u64,
    /// The share of it in which the source had no core, at most.
    pub(crate) source_taken_ns: u64,
    /// From the part's last return to the last stage's sending it.
    pub(crate) end_to_end_ns: u64,
    pub(crate) hop_count: usize,
    pub(crate) hops: [HopSegments; MAX_HOPS],
}

impl Segments {
    /// Of a trace without hops: nothing but zeros.
    pub(crate) fn of(trace: &Trace) -> Self {
        let mut segments = Self { hop_count: trace.hops().len(), ..Self::default() };
        let mut sent_ns = None;
        for (hop, segment) in trace.hops().iter().zip(&mut segments.hops) {
            if let Some(sent_ns) = sent_ns {
                *segment = HopSegments::of(hop, sent_ns);
            } else {
                *segment = HopSegments::of_source(hop);
                let taken_ns = u64::from(hop.taken_before_ns) + u64::from(hop.taken_busy_ns);
                segments.source_late_ns = hop.finished_ns.saturating_sub(trace.due_ns);
                segments.source_taken_ns = taken_ns.min(segments.source_late_ns);
            }
            sent_ns = Some(hop.finished_ns);
        }
        segments.end_to_end_ns = sent_ns.unwrap_or_default().saturating_sub(trace.due_ns);
        segments
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn hop(free_ns: u64, received_ns: u64, started_ns: u64, finished_ns: u64) -> Hop {
        Hop { free_ns, received_ns, started_ns, finished_ns, ..Hop::default() }
    }

    fn trace(due_ns: u64, hops: &[Hop]) -> Trace {
        let mut trace = Trace { due_ns, ..Trace::default() };
        hops.iter().for_each(|&hop| trace.push(hop));
        trace
    }

    #[test]
    fn a_stage_that_was_waiting_spends_transport_and_busy_but_no_queueing() {
        let sut = Segments::of(&trace(1_000, &[hop(0, 0, 900, 1_010), hop(500, 1_060, 1_065, 1_265)]));
        assert_eq!(sut.source_late_ns, 10);
        assert_eq!(sut.hops[1], HopSegments { transport_ns: 55, busy_ns: 200, ..HopSegments::default() });
        assert_eq!(sut.end_to_end_ns, 265);
    }

    #[test]
    fn a_stage_still_busy_when_the_part_was_sent_makes_it_queue() {
        let sut = Segments::of(&trace(1_000, &[hop(0, 0, 900, 1_000), hop(1_400, 1_450, 1_455, 1_500)]));
        let expected = HopSegments { transport_ns: 55, queued_ns: 400, busy_ns: 45, ..HopSegments::default() };
        assert_eq!(sut.hops[1], expected);
    }

    #[test]
    fn what_was_taken_is_told_apart_and_never_more_than_there_was() {
        let mut hops = [hop(0, 0, 900, 1_010), hop(500, 1_060, 1_065, 1_265)];
        (hops[1].taken_before_ns, hops[1].taken_busy_ns) = (30, 150);
        let sut = Segments::of(&trace(1_000, &hops));
        assert_eq!((sut.hops[1].wake_ns(), sut.hops[1].compute_ns(), sut.hops[1].taken_ns()), (25, 50, 180));
        // Before the part was sent, the stage had been kept off its core, too.
        (hops[0].taken_busy_ns, hops[1].taken_before_ns, hops[1].taken_busy_ns) = (90, 400, 900);
        let sut = Segments::of(&trace(1_000, &hops));
        assert_eq!((sut.hops[1].wake_ns(), sut.hops[1].compute_ns(), sut.hops[1].taken_ns()), (0, 0, 255));
        assert_eq!((sut.source_late_ns, sut.source_taken_ns), (10, 10));
    }

    #[test]
    fn a_trace_without_hops_is_all_zeros() {
        assert_eq!(Segments::of(&trace(1_000, &[])), Segments::default());
    }

    proptest! {
        #[test]
        fn segments_add_up_to_the_whole_way(steps in prop::collection::vec((0_u64..9, 0_u64..9, 0_u64..9, -9_i64..9), 1..=MAX_HOPS), late in 0_u64..9) {
            let due_ns = 1_000;
            let mut hops = vec![hop(0, 0, 900, due_ns + late)];
            for &(transport, shell, busy, free) in &steps[1..] {
                let sent = hops.last().map_or(0, |hop| hop.finished_ns);
                let received = sent + transport;
                let free = sent.saturating_add_signed(free);
                let taken = |ns: u64| (ns / 2) as u32;
                let mut hop = hop(free, received, received + shell, received + shell + busy);
                (hop.taken_before_ns, hop.taken_busy_ns) = (taken(shell), taken(busy));
                hops.push(hop);
            }
            let sut = Segments::of(&trace(due_ns, &hops));
            let whole = |hop: &HopSegments| hop.queued_ns + hop.wake_ns() + hop.compute_ns() + hop.taken_ns();
            let sum: u64 = sut.hops[1..].iter().map(whole).sum();
            prop_assert_eq!(sut.source_late_ns + sum, sut.end_to_end_ns);
        }
    }
}
