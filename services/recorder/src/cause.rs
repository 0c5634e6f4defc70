//! Why a sweep was late: one stage, and one kind of delay.
//!
//! Every nanosecond from the last return's due time to the answer is charged to a stage and a [`Kind`], and the largest
//! charge is the cause. Where that is time in a queue, the cause is what the stage did most of that time with the parts
//! before.

use messages::{MAX_HOPS, Trace};

use crate::history::History;
use crate::segments::Segments;

/// A kind of delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The source sent after the last return was due.
    Late = 0,
    /// Sent, and the stage free, until its `process` began.
    WakeUp = 1,
    /// Sent, and the stage kept by something that is not known.
    Queueing = 2,
    /// In `process`.
    Compute = 3,
    /// Ready to run, and other processes had the cores.
    CpuTaken = 4,
    /// The stage had died, and its successor was not up.
    Restart = 5,
}

impl Kind {
    pub(crate) const ALL: [Self; 6] =
        [Self::Late, Self::WakeUp, Self::Queueing, Self::Compute, Self::CpuTaken, Self::Restart];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::WakeUp => "wake-up",
            Self::Queueing => "queueing",
            Self::Compute => "compute",
            Self::CpuTaken => "cpu taken",
            Self::Restart => "restart",
        }
    }
}

/// Time by [`Kind`] [ns].
pub(crate) type Shares = [u64; Kind::ALL.len()];

/// The largest share; of equals the first in the order of the kinds.
fn largest(shares: &Shares) -> (u64, Kind) {
    let mut largest = (0, Kind::Late);
    for (&share_ns, kind) in shares.iter().zip(Kind::ALL) {
        if share_ns > largest.0 {
            largest = (share_ns, kind);
        }
    }
    largest
}

/// The stage, by its position, and the kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cause {
    pub(crate) stage: usize,
    pub(crate) kind: Kind,
}

impl Cause {
    /// As reports say it; `stages` by position.
    pub(crate) fn name(self, stages: &[impl AsRef<str>]) -> String {
        let stage = stages.get(self.stage).map_or("a stage beyond the chain", AsRef::as_ref);
        format!("{stage} {}", self.kind.name())
    }
}

/// What must be remembered to find causes. All memory is made with it.
pub(crate) struct Judge {
    /// By position; that of the source stays empty.
    histories: [History; MAX_HOPS],
    /// Incarnations of the stages in the last sweep that was answered.
    incarnations: [Option<u32>; MAX_HOPS],
}

impl Judge {
    pub(crate) fn new() -> Self {
        Self { histories: std::array::from_fn(|_| History::new()), incarnations: [None; MAX_HOPS] }
    }

    /// The cause of the way of a sweep's last part, which is not noted yet; of equals the first on the way.
    ///
    /// A stage that was restarted since the last sweep that was answered is the cause, whatever else there was.
    pub(crate) fn cause(&self, trace: &Trace, segments: &Segments) -> Cause {
        let restarted =
            |(hop, before): (&messages::Hop, &Option<u32>)| before.is_some_and(|life| hop.incarnation > life);
        if let Some(stage) = trace.hops().iter().zip(&self.incarnations).position(restarted) {
            return Cause { stage, kind: Kind::Restart };
        }
        let mut longest = (0, Cause { stage: 0, kind: Kind::Late });
        let mut waits = None;
        let mut sent_ns = 0;
        for (stage, (hop, own)) in trace.hops().iter().zip(&segments.hops).enumerate() {
            let mut shares = Shares::default();
            if stage == 0 {
                shares[Kind::Late as usize] = segments.source_late_ns - segments.source_taken_ns;
                shares[Kind::CpuTaken as usize] = segments.source_taken_ns;
            } else {
                shares[Kind::Queueing as usize] = own.queued_ns;
                shares[Kind::WakeUp as usize] = own.wake_ns();
                shares[Kind::Compute as usize] = own.compute_ns();
                shares[Kind::CpuTaken as usize] = own.taken_ns();
            }
            let (share_ns, kind) = largest(&shares);
            if share_ns > longest.0 {
                longest = (share_ns, Cause { stage, kind });
                waits = (kind == Kind::Queueing).then_some((hop, sent_ns));
            }
            sent_ns = hop.finished_ns;
        }
        let (_, mut cause) = longest;
        if let Some((hop, sent_ns)) = waits {
            (_, cause.kind) = largest(&self.histories[cause.stage].charge_queue(hop, sent_ns));
        }
        cause
    }

    /// Remembers a part.
    pub(crate) fn note(&mut self, trace: &Trace, segments: &Segments) {
        let hops = trace.hops();
        for (stage, pair) in hops.windows(2).enumerate().map(|(before, pair)| (before + 1, pair)) {
            self.histories[stage].note(&pair[1], pair[0].finished_ns, &segments.hops[stage]);
        }
    }

    /// Remembers that a sweep was answered.
    pub(crate) fn note_answer(&mut self, trace: &Trace) {
        for (incarnation, hop) in self.incarnations.iter_mut().zip(trace.hops()) {
            *incarnation = Some(hop.incarnation);
        }
    }
}
