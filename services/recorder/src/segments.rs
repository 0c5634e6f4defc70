//! A part's trace, cut into the times that it spent: end to end = source late + Σ (queued + transport + busy).

use messages::{MAX_HOPS, Trace};

/// One stage's share of a part's time [ns].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HopSegments {
    /// From the moment that the part was sent and the stage free, until `process` began.
    pub(crate) transport_ns: u64,
    /// The part was sent, and the stage was still busy with one before.
    pub(crate) queued_ns: u64,
    /// In `process`.
    pub(crate) busy_ns: u64,
}

/// A part's whole way, source first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Segments {
    /// From the part's last return to the source's sending it.
    pub(crate) source_late_ns: u64,
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
            segment.busy_ns = hop.finished_ns.saturating_sub(hop.started_ns);
            if let Some(sent_ns) = sent_ns {
                segment.queued_ns = hop.free_ns.min(hop.received_ns).saturating_sub(sent_ns);
                segment.transport_ns = hop.received_ns.saturating_sub(hop.free_ns.max(sent_ns))
                    + hop.started_ns.saturating_sub(hop.received_ns);
            } else {
                segments.source_late_ns = hop.finished_ns.saturating_sub(trace.due_ns);
            }
            sent_ns = Some(hop.finished_ns);
        }
        segments.end_to_end_ns = sent_ns.unwrap_or_default().saturating_sub(trace.due_ns);
        segments
    }

    /// The longest one; of equals the first on the way.
    pub(crate) fn longest(&self) -> Segment {
        let mut longest = (self.source_late_ns, Segment::SourceLate);
        for (stage, hop) in self.hops.iter().enumerate().take(self.hop_count).skip(1) {
            for (kind, length_ns) in
                [(Kind::Queued, hop.queued_ns), (Kind::Transport, hop.transport_ns), (Kind::Busy, hop.busy_ns)]
            {
                if length_ns > longest.0 {
                    longest = (length_ns, Segment::Stage(stage, kind));
                }
            }
        }
        longest.1
    }
}

/// What a stage did with its share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Queued = 0,
    Transport = 1,
    Busy = 2,
}

impl Kind {
    pub(crate) const ALL: [Self; 3] = [Self::Queued, Self::Transport, Self::Busy];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Transport => "transport",
            Self::Busy => "busy",
        }
    }
}

/// A piece of a part's way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Segment {
    SourceLate,
    Stage(usize, Kind),
}

#[cfg(test)]
mod tests {
    use messages::Hop;
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
        assert_eq!(sut.hops[1], HopSegments { transport_ns: 55, queued_ns: 0, busy_ns: 200 });
        assert_eq!(sut.end_to_end_ns, 265);
    }

    #[test]
    fn a_stage_still_busy_when_the_part_was_sent_makes_it_queue() {
        let sut = Segments::of(&trace(1_000, &[hop(0, 0, 900, 1_000), hop(1_400, 1_450, 1_455, 1_500)]));
        assert_eq!(sut.hops[1], HopSegments { transport_ns: 55, queued_ns: 400, busy_ns: 45 });
        assert_eq!(sut.longest(), Segment::Stage(1, Kind::Queued));
    }

    #[test]
    fn a_trace_without_hops_is_all_zeros() {
        assert_eq!(Segments::of(&trace(1_000, &[])), Segments::default());
        assert_eq!(Segments::default().longest(), Segment::SourceLate);
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
                hops.push(hop(free, received, received + shell, received + shell + busy));
            }
            let sut = Segments::of(&trace(due_ns, &hops));
            let sum: u64 = sut.hops[1..].iter().map(|hop| hop.transport_ns + hop.queued_ns + hop.busy_ns).sum();
            prop_assert_eq!(sut.source_late_ns + sum, sut.end_to_end_ns);
        }
    }
}
