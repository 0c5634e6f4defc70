//! After a death, and deaths on order: who is started again, how, and how often.

pub(crate) mod budget;
pub(crate) mod lives;
mod renewal;
pub(crate) mod settle;
pub(crate) mod shared_memory;

use chain::executive::Action;
use events::{CHAIN, EventId};
use runtime::page::Tier;
use runtime::realtime::AsBefore;
use runtime::{TAPE, clock};

use crate::SupervisorError;
use crate::executive::Order;
use crate::modes::By;
use crate::processes::child::Ended;
use crate::restarts::lives::{After, LOWER_LIVES};
use crate::restarts::settle::settle;
use crate::watch::{CANNOT_START, Watch};

/// How long processes may take to be gone after a kill [ns].
const KILL_PATIENCE_NS: u64 = 1_000_000_000;

impl Watch<'_> {
    /// Does what the executive's table asks for.
    ///
    /// # Errors
    /// A process cannot be started.
    pub(crate) fn obey(&mut self, order: &Order) -> Result<(), SupervisorError> {
        let reason = order.reason.as_str();
        match (order.action, order.stage) {
            (Action::Event, _) | (Action::RestartStage, None) => Ok(()),
            (Action::Degrade, _) => {
                self.step_down(reason);
                Ok(())
            }
            (Action::RestartStage, Some(position)) if position >= self.stages.len() => {
                self.restart_tape(reason);
                Ok(())
            }
            (Action::RestartStage, Some(position)) => self.restart_stage(position, By::Executive, reason),
            (Action::RestartChain, _) => self.restart_chain(By::Executive, reason),
            (Action::Safe, _) => {
                self.enter_safe(By::Executive, reason);
                Ok(())
            }
        }
    }

    /// Ends a stage's process; [`Watch::recover_all`] starts the next. By command it is a whole new chance.
    pub(crate) fn restart_stage(&mut self, position: usize, by: By, reason: &str) -> Result<(), SupervisorError> {
        if self.stop_asked || (self.stages[position].told && !self.lives[position].is_given_up()) {
            return Ok(());
        }
        let was_given_up = self.lives[position].is_given_up();
        let is_alive = self.stages[position].is_alive();
        if by == By::Command {
            self.renew(position);
            if is_alive {
                self.lives[position].excuse();
            }
        }
        if is_alive {
            let name = self.stages[position].name.clone();
            self.say(EventId::StageKilled, &name, reason);
            self.stages[position].kill();
        } else if by == By::Command && was_given_up {
            return self.start_again(position);
        }
        Ok(())
    }

    /// Ends the tape's process; whoever looks after it starts the next within its budget.
    fn restart_tape(&mut self, reason: &str) {
        let Some(tape) = self.tape.as_ref().filter(|tape| tape.process.is_alive() && !tape.process.told) else {
            return;
        };
        tape.process.kill();
        tracing::warn!(stage = TAPE, reason, "killed, to be started anew");
        self.say(EventId::StageKilled, TAPE, reason);
    }

    /// Ends all processes of the chain and starts them again, within the budget where the table asks for it.
    pub(crate) fn restart_chain(&mut self, by: By, reason: &str) -> Result<(), SupervisorError> {
        if self.stop_asked {
            return Ok(());
        }
        if by == By::Executive && !self.chain_budget.allow(clock::now_ns()) {
            let budget = self.plan.executive.chain_budget;
            let reason =
                format!("the chain was restarted {} times within {} s: {reason}", budget.restarts, budget.window_s);
            self.enter_safe(By::Executive, &reason);
            return Ok(());
        }
        self.say(EventId::ChainRestarted, CHAIN, reason);
        let mut ended = vec![None; self.stages.len()];
        for position in 0..self.stages.len() {
            if by == By::Command {
                self.renew(position);
            }
            if self.stages[position].is_alive() {
                self.lives[position].excuse();
                self.stages[position].kill();
            }
        }
        // All are gone before the first is settled, so that nobody is waited for in vain.
        let stages = &mut self.stages;
        clock::wait_for(KILL_PATIENCE_NS, || {
            for (stage, ended) in stages.iter_mut().zip(&mut ended) {
                *ended = ended.or_else(|| stage.look());
            }
            stages.iter().all(|stage| !stage.is_alive())
        });
        self.recover_all(&ended)?;
        for position in (0..self.stages.len()).rev() {
            if self.lives_again(position) {
                self.start_again(position)?;
            }
        }
        Ok(())
    }

    /// Whether a stage that had been given up was given another chance just now.
    fn lives_again(&self, position: usize) -> bool {
        let stage = &self.stages[position];
        stage.told && !self.lives[position].is_given_up() && !stage.is_alive()
    }

    /// Gives every stage that is not as configured another chance, and all of them a fresh budget. How many were restarted.
    pub(crate) fn renew_all(&mut self) -> Result<usize, SupervisorError> {
        self.chain_budget.forget();
        let mut restarted = 0;
        for position in 0..self.stages.len() {
            if self.lives[position].tier() == Tier::Configured && !self.lives[position].is_given_up() {
                self.stages[position].restarts.forget();
            } else {
                self.restart_stage(position, By::Command, "another chance, as configured")?;
                restarted += 1;
            }
        }
        Ok(restarted)
    }

    fn renew(&mut self, position: usize) {
        self.lives[position].renew();
        self.stages[position].restarts.forget();
    }

    /// Settles the accounts of all stages whose processes have ended, the last first: whoever asks a reader finds it settled.
    /// Then starts their successors, readers before writers.
    ///
    /// # Errors
    /// A process cannot be started, or refused to before the chain had begun.
    pub(crate) fn recover_all(&mut self, ended: &[Option<Ended>]) -> Result<(), SupervisorError> {
        if ended.iter().all(Option::is_none) {
            return Ok(());
        }
        let mut to_start = vec![false; ended.len()];
        for (position, ended) in ended.iter().enumerate().rev() {
            if let Some(ended) = *ended {
                to_start[position] = self.recover(position, ended)?;
            }
        }
        for position in (0..to_start.len()).rev().filter(|&position| to_start[position]) {
            self.start_again(position)?;
        }
        Ok(())
    }

    /// A stage's process has ended: its account is settled. Whether it is to have a successor.
    fn recover(&mut self, position: usize, ended: Ended) -> Result<bool, SupervisorError> {
        let lost_before = self.tell_death(position, ended);
        if let Some(tape) = self.tape.as_ref().filter(|_| position == 0 || self.is_sink(position + 1)) {
            tape.drain();
        }
        settle(&self.node, &self.services, &mut self.stages, position, ended);
        self.tell_losses(position, lost_before);
        if self.stages[position].told {
            return Ok(false);
        }
        if self.has_lost_services() {
            // It comes back with all others, when there is something to join.
            return Ok(false);
        }
        let stage = &self.stages[position];
        let name = stage.name.clone();
        let is_refused = ended == Ended::Code(CANNOT_START);
        if is_refused && !self.begun {
            return Err(SupervisorError::Refused(name));
        }
        let before = self.lives[position].tier();
        let after = self.lives[position].died(&mut self.stages[position].restarts, clock::now_ns(), is_refused);
        if after != After::Again {
            self.fall(position, before, is_refused, after);
        }
        if after == After::GivenUp {
            return Ok(false);
        }
        self.timeline.restarted(clock::now_ns(), &name, ended);
        Ok(true)
    }

    /// A stage could not be kept running as it was: the chain goes on in safe mode, with less of the stage.
    fn fall(&mut self, position: usize, before: Tier, is_refused: bool, after: After) {
        let name = self.stages[position].name.clone();
        let budget = self.plan.chain.restart_budget;
        let reason = match before {
            _ if is_refused => format!("stage {name:?} could not start again"),
            Tier::Configured => {
                format!("stage {name:?} died more than {} times within {} s", budget.restarts, budget.window_s)
            }
            tier => format!("stage {name:?} died {LOWER_LIVES} times more, {}", tier.name()),
        };
        if !is_refused {
            self.say(EventId::BudgetSpent, &name, &reason);
        }
        self.enter_safe(By::Executive, &reason);
        match after {
            After::Down(Tier::StandIn) => self.say(EventId::StandIn, &name, "parts pass through it empty"),
            After::GivenUp => {
                self.say(EventId::StageGivenUp, &name, &reason);
                self.stages[position].told = true;
                if position == 0 {
                    self.failed.get_or_insert(format!("{reason}: the chain was stopped"));
                }
            }
            After::Again | After::Down(_) => {}
        }
    }

    /// Starts the next life of a stage, at the tier that it has come to.
    pub(crate) fn start_again(&mut self, position: usize) -> Result<(), SupervisorError> {
        let tier = self.lives[position].tier();
        let stage = &mut self.stages[position];
        (stage.told, stage.recovering) = (false, true);
        stage.page.tier.set(tier as u64);
        // A child inherits the seat of the one who starts it.
        let _for_the_child = self.as_before.as_ref().map(AsBefore::for_a_moment);
        stage.start()
    }

    /// A successor is connected: what was published before that and did not reach it is lost. It says so itself, once
    /// it has looked; nobody waits for what will never come.
    pub(crate) fn name_losses(&mut self, position: usize) {
        if !self.stages[position].recovering || !self.stages[position].is_up() {
            return;
        }
        self.stages[position].recovering = false;
        if position > 0 {
            let published = self.stages[position - 1].page.published.get();
            self.stages[position].page.lose_below.set(published);
            self.services.wake_readers_of(position - 1);
        }
        let name = self.stages[position].name.clone();
        let (pid, tier) = (self.stages[position].page.pid.get(), self.lives[position].tier());
        self.say(EventId::StageRestarted, &name, &format!("process {pid}, {}", tier.name()));
    }
}
