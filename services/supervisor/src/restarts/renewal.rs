//! Shared memory made anew under a chain that goes on: every process leaves in order, each with its input drained through what
//! it still has mapped, and comes back with files of another generation. Numbers, ledger and log are not in shared memory.

use chain::SUPERVISOR;
use events::{CHAIN, EventId};
use runtime::realtime::AsBefore;
use runtime::{Pace, clock};
use transport::Node;

use crate::SupervisorError;
use crate::house::services::Services;
use crate::processes::child::Watched;
use crate::restarts::shared_memory::SharedMemory;
use crate::watch::Watch;

/// How long the source may take to stand still, and all that it has sent to come through [ns].
const STILL_NS: u64 = 2_000_000_000;

impl Watch<'_> {
    /// Files of the chain in shared memory were deleted: all processes are to be restarted with new ones, within the chain's
    /// budget. Where that is spent, or somebody else starts the stages and could not know when, the chain is stopped.
    pub(crate) fn lose_shared_memory(&mut self, files: usize) {
        let text = format!("{files} files of the chain in shared memory were deleted by somebody else");
        self.say(EventId::SharedMemoryGone, CHAIN, &text);
        let budget = self.plan.executive.chain_budget;
        if self.spawn && self.chain_budget.allow(clock::now_ns()) {
            self.shared_memory.is_to_be_renewed = true;
        } else if self.spawn {
            let (restarts, window_s) = (budget.restarts, budget.window_s);
            let spent = format!("may be restarted {restarts} times within {window_s} s, and was");
            self.failed = Some(format!("{text}: the chain {spent}; it was stopped"));
        } else {
            self.failed = Some(format!("{text}: the chain was stopped"));
        }
    }

    /// Whether a process that is started now could not join, because the services' files were deleted. The first to find that
    /// sees to it.
    pub(crate) fn has_lost_services(&mut self) -> bool {
        let missing = if self.begun { self.shared_memory.missing_services(&self.instance.shared_memory()) } else { 0 };
        if missing > 0 && !self.shared_memory.is_to_be_renewed && !self.renewing && !self.is_ending() {
            self.lose_shared_memory(missing);
        }
        missing > 0
    }

    /// Makes the shared memory anew where that is to be.
    ///
    /// # Errors
    /// A process does not come back, or the services cannot be created.
    pub(crate) fn renew_shared_memory_if_lost(&mut self) -> Result<(), SupervisorError> {
        if !std::mem::take(&mut self.shared_memory.is_to_be_renewed) || self.is_ending() {
            return Ok(());
        }
        self.say(EventId::ChainRestarted, CHAIN, "in order, with new shared memory");
        self.renewing = true;
        let renewed = self.renew_shared_memory();
        self.renewing = false;
        // Nothing could move meanwhile.
        self.moved_ns = clock::now_ns();
        renewed
    }

    fn is_ending(&self) -> bool {
        self.stop_asked || self.failed.is_some()
    }

    fn renew_shared_memory(&mut self) -> Result<(), SupervisorError> {
        self.stand_still()?;
        self.stop_in_order()?;
        if self.is_ending() {
            return Ok(());
        }
        let of_before = self.instance.shared_memory();
        self.house.begin_generation()?;
        let node = Node::join_anew(self.instance, SUPERVISOR, self.plan.chain.queue_parts())?;
        self.services = Services::create(&node, &self.plan)?;
        self.node = node;
        self.instance.remove_from_shared_memory(&of_before)?;
        self.shared_memory = SharedMemory::default();
        self.start_all_again()
    }

    /// Lets the source stand still between two sweeps, and what it has sent come through, so that no sweep is torn. Where a stage
    /// is gone that does not come, and nobody waits for it.
    fn stand_still(&mut self) -> Result<(), SupervisorError> {
        self.stages[0].page.pause.set(1);
        let end_ns = clock::now_ns() + STILL_NS;
        while !self.is_ending() && clock::now_ns() < end_ns && self.stages.iter().all(Watched::is_up) {
            let is_still = self.stages[0].page.paused.get() > 0;
            if is_still && (1..self.stages.len()).all(|position| self.is_drained(position)) && !self.is_torn() {
                break;
            }
            self.look_once()?;
        }
        Ok(())
    }

    /// Whether sweeps that were sent would be sent again. A sink that left in order would write what it has of them.
    pub(crate) fn is_torn(&self) -> bool {
        self.plan.pace == Pace::Fast && !(self.is_answered() && self.is_on_tape())
    }

    /// As at the start: readers before writers, the source when all others are connected. Who was given up stays away.
    fn start_all_again(&mut self) -> Result<(), SupervisorError> {
        if let Some(tape) = self.tape.as_mut().filter(|tape| tape.stopped.is_none()) {
            tape.process.told = false;
            let _for_the_child = self.as_before.as_ref().map(AsBefore::for_a_moment);
            tape.process.start()?;
        }
        for position in (1..self.stages.len()).rev() {
            if !self.lives[position].is_given_up() {
                self.start_again(position)?;
            }
        }
        self.await_up(1)?;
        if self.is_ending() {
            return Ok(());
        }
        self.stages[0].page.pause.set(u64::from(self.modes.is_paused()));
        self.start_again(0)?;
        self.await_up(0)
    }
}
