use std::path::Path;

use messages::Verdict;

use super::map::PageMap;
use super::words::State;
use crate::ShellError;

/// A page that this process may only look at: mapped read-only, and nothing here writes.
pub struct PageView {
    page: PageMap,
}

/// What a page counts at one moment. Words are read one after the other while the stage goes on, so they may contradict
/// each other by the part that was in hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Lives so far.
    pub incarnation: u64,
    /// The life whose account is settled; less than `incarnation` while a process lives.
    pub settled_incarnation: u64,
    /// Process of the last life.
    pub pid: u64,
    /// Where the stage is in its life.
    pub state: State,
    /// Host time at which the working thread last turned its loop [ns].
    pub heartbeat_ns: u64,
    /// Parts taken from shared memory.
    pub received: u64,
    /// Sequence number expected next from the stage before.
    pub next_sequence: u64,
    /// Parts processed (a sink: settled).
    pub processed: u64,
    /// Parts rejected, by [`Verdict`].
    pub rejected: [u64; Verdict::ALL.len()],
    /// Parts that overflowed the queue here.
    pub dropped: u64,
    /// Parts that died with a process.
    pub lost: u64,
    /// Parts published (a sink: accepted).
    pub published: u64,
    /// Sweeps on which the stage was busy for longer than its budget.
    pub overruns: u64,
    /// Parts that were waiting already when the stage had finished the part before.
    pub slips: u64,
    /// Sweeps whose last part left the stage after the deadline.
    pub late: u64,
    /// Source only: number of the step of degradation for the next sweep.
    pub step: u64,
    /// Host time at which the last part was published (a sink: accepted) [ns].
    pub sent_ns: u64,
    /// Source only: host time from one sweep to the next [ns]; 0 where nothing paces it.
    pub period_ns: u64,
    /// Source only: 1 while it stands still because it was told to.
    pub paused: u64,
    /// Sink only: host time at which the last sweep came to its end [ns].
    pub answered_ns: u64,
    /// Sink only: of that sweep, from its last return to its last detection sent [ns].
    pub latency_ns: u64,
    /// A [`super::Tier`]: which build of the stage its process is.
    pub tier: u64,
    /// Generation of the parameters in use.
    pub table_active: u64,
    /// Generation of the parameters that were refused last.
    pub table_refused: u64,
    /// The supervisor's page: a [`chain::Mode`].
    pub mode: u64,
    /// The supervisor's page: changes of mode so far.
    pub mode_changes: u64,
    /// The supervisor's page: those that did not take effect within two sweeps.
    pub modes_late: u64,
    /// The supervisor's page: commands carried out.
    pub commands_accepted: u64,
    /// The supervisor's page: commands refused.
    pub commands_refused: u64,
}

impl Counts {
    /// Parts rejected for all reasons.
    pub fn rejected_total(&self) -> u64 {
        self.rejected.iter().fold(0, |sum, parts| sum.saturating_add(*parts))
    }
}

impl PageView {
    /// Maps the page of a running stage to look at it.
    ///
    /// # Errors
    /// There is no such file, or it is no page of this version.
    pub fn open(path: &Path) -> Result<Self, ShellError> {
        Ok(Self { page: PageMap::open_to_read(path)? })
    }

    /// What it counts now.
    pub fn counts(&self) -> Counts {
        let page = &self.page;
        Counts {
            incarnation: page.incarnation.get(),
            settled_incarnation: page.settled_incarnation.get(),
            pid: page.pid.get(),
            state: page.state(),
            heartbeat_ns: page.heartbeat_ns.get(),
            received: page.received.get(),
            next_sequence: page.next_sequence.get(),
            processed: page.processed.get(),
            rejected: std::array::from_fn(|verdict| page.rejected[verdict].get()),
            dropped: page.dropped.get(),
            lost: page.lost.get(),
            published: page.published.get(),
            overruns: page.overruns.get(),
            slips: page.slips.get(),
            late: page.late.get(),
            step: page.step.get(),
            sent_ns: page.sent_ns.get(),
            period_ns: page.period_ns.get(),
            paused: page.paused.get(),
            answered_ns: page.answered_ns.get(),
            latency_ns: page.latency_ns.get(),
            tier: page.tier.get(),
            table_active: page.table_active.get(),
            table_refused: page.table_refused.get(),
            mode: page.mode.get(),
            mode_changes: page.mode_changes.get(),
            modes_late: page.modes_late.get(),
            commands_accepted: page.commands_accepted.get(),
            commands_refused: page.commands_refused.get(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_sees_what_the_stage_counts_later() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("page");
        let page = PageMap::create(&path).unwrap();
        let view = PageView::open(&path).unwrap();
        assert_eq!(view.counts(), Counts::default());
        page.received.set(3);
        page.rejected[Verdict::RejectedStale as usize].set(2);
        page.set_state(State::Running);
        let counts = view.counts();
        assert_eq!((counts.received, counts.rejected_total(), counts.state), (3, 2, State::Running));
    }

    #[test]
    fn a_view_can_be_had_of_a_page_that_may_not_be_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("page");
        drop(PageMap::create(&path).unwrap());
        let mut permissions = std::fs::metadata(&path).unwrap().permissions();
        permissions.set_readonly(true);
        std::fs::set_permissions(&path, permissions).unwrap();
        assert_eq!(PageView::open(&path).unwrap().counts().pid, 0);
        assert!(PageView::open(&dir.path().join("none")).is_err());
    }
}
