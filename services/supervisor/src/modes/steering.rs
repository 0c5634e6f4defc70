//! Steps of the ladder and modes on their way to the source, and what is said of them.

use chain::Mode;
use events::{CHAIN, EventId};
use messages::Step;
use runtime::page::Tier;
use runtime::{Pace, clock};
use serde::{Deserialize, Serialize};

use crate::modes::overload::{Move, Trouble};
use crate::modes::{By, Passed, Seen, Wish};
use crate::watch::Watch;

/// How the chain first came into safe mode.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct SafeReport {
    /// By whom.
    pub by: By,
    /// Why.
    pub reason: String,
    /// Sweep that the source was at.
    pub sweep: u64,
}

impl Watch<'_> {
    /// Takes a wish about the mode and tells the source.
    pub(crate) fn wish(&mut self, wish: Wish) {
        let seen = self.seen();
        if self.modes.wish(wish, seen) {
            self.page.mode_took_ns.set(0);
            self.page.mode_asked_ns.set(seen.now_ns);
            self.page.mode.set(self.modes.mode() as u64);
        }
        let source = &self.stages[0].page;
        source.step.set(self.modes.step() as u64);
        source.pause.set(u64::from(self.modes.is_paused() || self.renewing));
    }

    /// Goes on in the mode, and with the tiers, that the pages say, where one supervisor follows another. The step at which the
    /// ladder stands.
    pub(crate) fn take_over_modes(&mut self) -> Step {
        let (mode, step) = (Mode::from_number(self.page.mode.get()), self.stages[0].page.step.get());
        self.ladder_stood = self.modes.take_over(mode, Step::from_number(step as u32));
        // Whoever died while all was restarted had let the source stand still.
        self.stages[0].page.pause.set(u64::from(self.modes.is_paused()));
        self.modes.report.changes = self.page.mode_changes.get();
        self.modes.report.late = self.page.modes_late.get();
        self.refusals.take_over(self.page.commands_refused.get());
        for (lives, stage) in self.lives.iter_mut().zip(&self.stages) {
            lives.take_over(Tier::from_number(stage.page.tier.get()));
        }
        if let Some(stage) = self.stages.iter().find(|stage| stage.page.tier.get() > 0) {
            let reason = format!("stage {:?} could not be kept running under the supervisor before", stage.name);
            self.safe_entered = Some(SafeReport { by: By::Executive, reason, sweep: self.sweeps_sent() });
        }
        self.ladder_stood
    }

    fn seen(&self) -> Seen {
        let source = &self.stages[0].page;
        Seen {
            now_ns: clock::now_ns(),
            period_ns: source.period_ns.get(),
            published: source.published.get(),
            step_sent: Step::from_number(source.step_sent.get() as u32),
            paused: source.paused.get() > 0,
        }
    }

    /// Looks whether the mode that was asked for is in effect.
    pub(crate) fn look_at_mode(&mut self) {
        let Some(passed) = self.modes.look(self.seen()) else { return };
        match passed {
            Passed::Entered(mode, took_ns) => {
                self.page.mode_took_ns.set(took_ns.max(1));
                self.page.mode_changes.add(1);
                let text = format!("{}, after {:.1} ms", mode.name(), took_ns as f64 / 1e6);
                self.say(EventId::ModeEntered, CHAIN, &text);
            }
            Passed::Late(mode) => {
                self.page.modes_late.add(1);
                let text = format!("{} is not in effect after two sweeps", mode.name());
                self.say(EventId::ModeLate, CHAIN, &text);
            }
        }
    }

    /// Safe mode, whoever wishes it: only a command leads out.
    pub(crate) fn enter_safe(&mut self, by: By, reason: &str) {
        let is_new = !self.modes.is_safe();
        self.wish(Wish::Safe);
        if is_new {
            self.say(EventId::SafeEntered, CHAIN, reason);
        }
        let first_by_executive = self.safe_entered.as_ref().is_none_or(|safe| safe.by < by);
        if first_by_executive {
            let sweep = self.sweeps_sent();
            self.safe_entered = Some(SafeReport { by, reason: reason.to_owned(), sweep });
        }
    }

    /// Sweeps that the source has sent.
    pub(crate) fn sweeps_sent(&self) -> u64 {
        self.stages[0].page.next_ordinal_out.get() / u64::from(self.plan.chain.sectors.max(1))
    }

    /// Moves on the ladder of overload as the pages tell.
    pub(crate) fn climb(&mut self) {
        if self.plan.pace == Pace::Fast {
            return;
        }
        let sweeps = self.stages[0].page.published.get() / u64::from(self.plan.chain.sectors.max(1));
        let trouble = Trouble::of(self.stages.iter().map(|stage| &*stage.page));
        if let Some(step) = self.ladder.look(sweeps, trouble) {
            self.note_move(step);
        }
    }

    /// One step down the ladder, as a rule of the table asks. It is taken back like any other, so not at `--pace fast`, where
    /// there is no ladder.
    pub(crate) fn step_down(&mut self, reason: &str) {
        if self.plan.pace == Pace::Fast {
            return;
        }
        if let Some(step) = self.ladder.step_down(reason) {
            self.note_move(step);
        }
    }

    fn note_move(&mut self, step: Move) {
        let now = self.ladder.step();
        let id = if now > self.ladder_stood { EventId::StepTaken } else { EventId::StepReturned };
        self.ladder_stood = now;
        self.wish(Wish::Ladder(now));
        self.say(id, CHAIN, &format!("{} to {}: {}", step.from, step.to, step.reason));
        self.timeline.stepped(clock::now_ns(), &step);
        self.overload.note(step);
    }

    /// The step after the one in force, of those that chain.toml names; none where it names no further one.
    pub(crate) fn next_step(&self) -> Option<Step> {
        let steps = self.plan.chain.overload.steps.iter().map(|&number| Step::from_number(number));
        steps.into_iter().find(|step| *step > self.modes.step())
    }

    /// The mode in words, with the step where something is left out.
    pub(crate) fn mode_in_words(&self) -> String {
        match self.modes.mode() {
            Mode::Degraded => format!("degraded ({})", self.modes.step().name()),
            mode => mode.name().to_owned(),
        }
    }
}
