use std::sync::atomic::{AtomicU64, Ordering};

use messages::Verdict;

use super::ring::Rings;

/// Told apart from any other file, and from pages of another layout.
pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"enckepg4");

/// Gaps whose ordinals are kept by name; older ones are overwritten, their counts stay.
pub(super) const MAX_GAPS: usize = 128;

/// Where a stage is in its life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum State {
    /// Never started, or between two lives.
    #[default]
    Absent = 0,
    /// Started, not connected yet.
    Starting = 1,
    /// Connected; parts are taken as they come.
    Running = 2,
    /// A source that has nothing more to send.
    Ended = 3,
    /// Left in order.
    Stopped = 4,
}

impl State {
    /// The state's word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Ended => "ended",
            Self::Stopped => "stopped",
        }
    }
}

/// Which build of a stage a process is: less trusted parts are left out one after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum Tier {
    /// As configured.
    #[default]
    Configured = 0,
    /// With the parameters and models that are built in.
    BuiltIn = 1,
    /// Nothing of the stage: every part passes empty, rejected as `down`.
    StandIn = 2,
}

impl Tier {
    /// The tier of a number; the last one for numbers beyond.
    pub fn from_number(number: u64) -> Self {
        match number {
            0 => Self::Configured,
            1 => Self::BuiltIn,
            _ => Self::StandIn,
        }
    }

    /// The tier's word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Configured => "configured",
            Self::BuiltIn => "built-in",
            Self::StandIn => "stand-in",
        }
    }
}

/// A word of a page. Values only ever grow or are replaced; no reader needs two words to agree except where
/// `ledger` says so.
#[derive(Default)]
#[repr(transparent)]
pub struct Word(AtomicU64);

impl Word {
    /// The value.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// Replaces the value.
    pub fn set(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }

    /// Adds to the value; saturates, never wraps. For the single writer only.
    pub fn add(&self, value: u64) {
        self.set(self.get().saturating_add(value));
    }

    /// Adds to a value that other processes change too; saturates, never wraps.
    pub fn give(&self, value: u64) {
        let add = |before: u64| Some(before.saturating_add(value));
        // Never refuses.
        let _ = self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, add);
    }

    /// Takes one from a value that is not 0 and that other processes change too.
    pub fn take_one(&self) -> bool {
        self.0.fetch_update(Ordering::AcqRel, Ordering::Acquire, |value| value.checked_sub(1)).is_ok()
    }
}

/// A gap in the parts of a hop, by name.
#[derive(Default)]
#[repr(C)]
pub(super) struct GapWords {
    pub(super) kind: Word,
    pub(super) first_ordinal: Word,
    pub(super) end_ordinal: Word,
    pub(super) parts: Word,
}

/// The page. Zero bytes are the page of a stage that never ran.
#[repr(C)]
pub struct Page {
    pub(super) magic: Word,

    // Written by the stage.
    /// Lives so far, this one included.
    pub incarnation: Word,
    /// Process of this life.
    pub pid: Word,
    /// A [`State`].
    pub(super) state: Word,
    /// Host time at which the working thread last turned its loop [ns].
    pub heartbeat_ns: Word,
    /// Parts taken from shared memory.
    pub received: Word,
    /// Sequence number expected next from the stage before.
    pub next_sequence: Word,
    /// One more than the last ordinal received.
    pub next_ordinal_in: Word,
    /// Parts processed, in full or in part.
    pub processed: Word,
    /// Parts rejected, by [`Verdict`].
    pub rejected: [Word; Verdict::ALL.len()],
    /// Parts that the stage before published and that overflowed the queue here.
    pub dropped: Word,
    /// Parts that the stage before published and that died with a process.
    pub lost: Word,
    /// Parts published, through all lives (a sink: accepted, to be settled later).
    pub published: Word,
    /// One more than the last ordinal published (a sink: settled).
    pub next_ordinal_out: Word,
    /// Source only: how often it went back to send parts again.
    pub attempt: Word,
    /// Source only: parts that it had sent and went back behind: `published` is `next_ordinal_out` and these.
    pub resent: Word,
    pub(super) back_to: Word,
    pub(super) back_resent: Word,
    /// Sink and tape only: the attempt that they need, because parts are missing; fulfilled once the source's is as high.
    pub wanted_attempt: Word,
    /// Source only: one more than the sensor time of the run's first sweep [ns]; 0 = none yet.
    pub began_sensor_ns: Word,
    /// One more than the ordinal in hand; 0 = none.
    pub in_hand: Word,
    pub(super) in_hand_sequence: Word,
    pub(super) in_hand_received: Word,
    pub(super) in_hand_published: Word,
    pub(super) in_hand_counted: Word,
    pub(super) in_hand_rejected: Word,
    pub(super) in_hand_verdict: Word,
    /// Sink only: parts accepted in earlier lives that died before they were settled.
    pub(super) lost_unsettled: Word,
    /// The stage before has been drained up to this of its lives.
    pub drained_incarnation: Word,
    /// Sweeps on which the stage was busy for longer than its budget.
    pub overruns: Word,
    /// Parts that were waiting already when the stage had finished the part before.
    pub slips: Word,
    /// Sweeps whose last part left the stage after the deadline.
    pub late: Word,
    /// Host time at which the last part was published (a sink: accepted) [ns].
    pub sent_ns: Word,
    /// Source only: host time from one sweep to the next [ns]; 0 before the first, and where nothing paces it.
    pub period_ns: Word,
    /// Source only: number of the step of degradation of the sweep under way.
    pub step_sent: Word,
    /// Source only: 1 while it stands still because it was told to.
    pub paused: Word,
    /// Sink only: host time at which the last sweep came to its end here [ns].
    pub answered_ns: Word,
    /// Sink only: of that sweep, from its last return to its last detection sent [ns].
    pub latency_ns: Word,
    /// Generation of the parameters in use.
    pub table_active: Word,
    /// Generation of the parameters that were refused last.
    pub table_refused: Word,
    pub(super) rings: Rings,
    /// Heap allocations inside `process` after warm-up.
    pub process_allocations: Word,
    /// Heap allocations of the shell round it after warm-up.
    pub shell_allocations: Word,
    /// Parts over which those were counted.
    pub counted_parts: Word,
    pub(super) gap_pending: Word,
    pub(super) gap_missing_before: Word,
    pub(super) gap_sequence: Word,
    /// What `lost_unsettled` is once the gap is counted.
    pub(super) gap_lost_unsettled: Word,
    /// 1 where the part in hand is one of the gap.
    pub(super) gap_in_hand: Word,
    pub(super) gap_count: Word,
    pub(super) gaps: [GapWords; MAX_GAPS],

    // Written by the supervisor.
    /// The life whose account is settled: its successor may start.
    pub settled_incarnation: Word,
    /// Asks the stage to drain the stage before up to this of its lives.
    pub drain_request: Word,
    /// Parts of the stage before with a sequence number below this that are not in the queue are lost: they were sent
    /// before this life was connected.
    pub lose_below: Word,
    /// Source only: 1 once all readers are connected.
    pub may_start: Word,
    /// Source only: number of the step of degradation at which the next sweep is to be processed.
    pub step: Word,
    /// Source only: 1 while it is to stand still between two sweeps.
    pub pause: Word,
    /// A [`Tier`]: which build of the stage the next life is.
    pub tier: Word,
    /// One more than the number of a `chain::executive::Condition`: what is the matter with the stage; 0 = nothing.
    pub condition: Word,
    /// Generation of the parameters in the plan; where it is higher than `table_active` the stage reads the plan again.
    pub table_wanted: Word,
    /// The first sweep that is to be processed with them.
    pub table_from_sweep: Word,

    // The supervisor's own page. Its `incarnation` counts the supervisors that the run has had.
    /// Host time at which the run began [ns].
    pub run_began_ns: Word,
    /// A [`chain::Mode`].
    pub mode: Word,
    /// Host time at which the mode was asked for [ns].
    pub mode_asked_ns: Word,
    /// Host time from then until it was in effect [ns]; 0 while it is not.
    pub mode_took_ns: Word,
    /// Changes of mode so far.
    pub mode_changes: Word,
    /// Changes that did not take effect within two sweeps.
    pub modes_late: Word,
    /// Commands carried out.
    pub commands_accepted: Word,
    /// Commands refused.
    pub commands_refused: Word,

    // Written by `encke ctl`.
    /// Source only: sweeps asked for, where each waits for that.
    pub steps: Word,

    // Written by `encke inject`.
    /// Parts still to swallow.
    pub swallow: Word,
    /// Time added to the work on each sweep [ns].
    pub slow_ns: Word,
    /// Number of a fault for the shell to have; 0 = none.
    pub fault: Word,
    /// What more there is to say about it.
    pub fault_argument: Word,
    /// How often it is still to be had; counts down.
    pub fault_left: Word,
}

impl Page {
    /// Where the stage is in its life.
    pub fn state(&self) -> State {
        match self.state.get() {
            1 => State::Starting,
            2 => State::Running,
            3 => State::Ended,
            4 => State::Stopped,
            _ => State::Absent,
        }
    }

    /// Sets where the stage is in its life.
    pub fn set_state(&self, state: State) {
        self.state.set(state as u64);
    }

    /// Shows that the working thread is alive at host time `now_ns`.
    pub fn beat(&self, now_ns: u64) {
        self.heartbeat_ns.set(now_ns);
    }

    /// Parts rejected for all reasons.
    pub fn rejected_total(&self) -> u64 {
        self.rejected.iter().map(Word::get).fold(0, u64::saturating_add)
    }

    /// Parts rejected, by reason, where there are any.
    pub fn rejected_by_reason(&self) -> impl Iterator<Item = (Verdict, u64)> + '_ {
        let reasons = Verdict::ALL.into_iter().filter(|verdict| verdict.is_rejected());
        reasons.map(|verdict| (verdict, self.rejected[verdict as usize].get())).filter(|(_, parts)| *parts > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::PageMap;

    #[test]
    fn a_word_that_is_full_stays_full() {
        let word = Word::default();
        word.set(u64::MAX - 1);
        word.add(5);
        assert_eq!(word.get(), u64::MAX);
        word.give(1);
        assert_eq!(word.get(), u64::MAX);
        assert!(word.take_one());
        word.give(u64::MAX);
        assert_eq!(word.get(), u64::MAX);
    }

    #[test]
    fn sums_of_full_words_are_full() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("page");
        let page = PageMap::create(&path).unwrap();
        page.rejected.iter().for_each(|word| word.set(u64::MAX));
        page.processed.set(u64::MAX);
        page.dropped.set(7);
        page.lost.set(u64::MAX);
        assert_eq!((page.rejected_total(), page.counted()), (u64::MAX, u64::MAX));
        assert_eq!(crate::page::PageView::open(&path).unwrap().counts().rejected_total(), u64::MAX);
    }
}
