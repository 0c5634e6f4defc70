//! The end of a chain: in order where it can be, at once where it must.

use std::time::Duration;

use events::EventId;
use runtime::clock;
use runtime::page::State;

use crate::SupervisorError;
use crate::processes::child::Watched;
use crate::watch::Watch;

/// How long a stage may take to drain its input, and then to leave [ns].
const LEAVE_PATIENCE_NS: u64 = 5_000_000_000;

impl Watch<'_> {
    /// Ends the stages in flow order, each when it has drained what the one before sent.
    pub(crate) fn stop_in_order(&mut self) -> Result<(), SupervisorError> {
        self.sample();
        for position in 0..self.stages.len() {
            let end_ns = clock::now_ns() + LEAVE_PATIENCE_NS;
            let mut drained = position == 0;
            // Who is not there cannot drain, and has no successor before all have left.
            let renewing = self.renewing;
            let can_drain = |stage: &Watched| !stage.told && (!renewing || stage.is_up());
            while !drained && clock::now_ns() < end_ns && can_drain(&self.stages[position]) {
                self.look_once()?;
                drained = self.is_drained(position);
            }
            if !drained && can_drain(&self.stages[position]) {
                tracing::error!(stage = self.stages[position].name, "did not drain its input within 5 s");
            }
            self.leave(position)?;
            // A stage that left in order has counted everything itself.
            if position > 0 && self.stages[position].page.state() != State::Stopped {
                let published = self.stages[position - 1].page.published.get();
                let lost = self.stages[position].page.lose_below(published);
                if lost > 0 {
                    let name = self.stages[position].name.clone();
                    self.say(EventId::PartsLost, &name, &format!("{lost} parts that waited for it"));
                }
            }
        }
        self.end_tape()
    }

    /// Tells a stage to leave and waits for it; one that does not is killed.
    fn leave(&mut self, position: usize) -> Result<(), SupervisorError> {
        if !self.stages[position].is_alive() {
            return Ok(());
        }
        let torn = self.renewing && self.is_sink(position) && self.is_torn();
        self.stages[position].tell();
        if torn {
            self.stages[position].kill();
        }
        let end_ns = clock::now_ns() + LEAVE_PATIENCE_NS;
        while self.stages[position].is_alive() {
            if clock::now_ns() > end_ns {
                tracing::error!(stage = self.stages[position].name, "did not leave within 5 s: killed");
                self.stages[position].kill();
            }
            self.look_once()?;
        }
        Ok(())
    }

    /// Kills every stage, when the chain cannot go on.
    pub(crate) fn kill_all(&mut self) {
        for process in self.stages.iter_mut().chain(self.tape.as_mut().map(|tape| &mut tape.process)) {
            process.told = true;
            process.kill();
        }
        clock::wait_for(LEAVE_PATIENCE_NS, || {
            let beside = self.tape.as_mut().map(|tape| &mut tape.process);
            // Each is looked at, whatever the others are.
            let alive = self.stages.iter_mut().chain(beside).filter_map(|process| {
                process.look();
                process.is_alive().then_some(())
            });
            alive.count() == 0
        });
        self.node.clean_dead(Duration::from_millis(100));
    }
}
