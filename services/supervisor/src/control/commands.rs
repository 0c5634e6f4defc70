//! What commands do to a chain.

use events::{CHAIN, EventId};

use crate::SupervisorError;
use crate::control::{Answer, Asked, Command, CommandsReport, Word};
use crate::modes::{By, Wish};
use crate::watch::Watch;

/// Between two events about commands that were refused [ns].
const REFUSED_NS: u64 = 1_000_000_000;

/// Commands that were refused and not told of.
#[derive(Default)]
pub(crate) struct Refusals {
    told: u64,
    told_ns: u64,
    last: String,
}

impl Refusals {
    /// So many were told of by a supervisor before.
    pub(crate) fn take_over(&mut self, told: u64) {
        self.told = told;
    }
}

impl Watch<'_> {
    /// Carries a command out, and answers it.
    ///
    /// # Errors
    /// A process cannot be started.
    pub(crate) fn carry_out(&mut self, asked: &Asked) -> Result<(), SupervisorError> {
        let Command { command, stage, tables } = &asked.command;
        let answer = match (command, stage, tables) {
            _ if self.stop_asked => Answer::no("the chain is ending"),
            (Word::Restart, Some(stage), None) => self.restart_by_command(stage)?,
            (Word::Restart, None, _) => Answer::no("restart needs a stage; restart-chain restarts all"),
            (Word::Reload, None, Some(tables)) => self.reload(tables),
            (Word::Reload, _, None) => Answer::no("reload needs tables"),
            (word, Some(_), _) => Answer::no(format!("{} takes no stage", word.name())),
            (word, None, Some(_)) => Answer::no(format!("{} takes no tables", word.name())),
            (Word::Pause, None, None) => {
                let was_paused = self.modes.is_paused();
                self.wish(Wish::Pause);
                Answer::yes(if was_paused { "paused already" } else { "paused after the sweep under way" })
            }
            (Word::Safe, None, None) => {
                self.enter_safe(By::Command, "by command");
                let from = if self.modes.is_paused() { "once the pause is over" } else { "from the next sweep on" };
                Answer::yes(format!("safe {from}; resume leads out"))
            }
            (Word::Degrade, None, None) => self.degrade_by_command(),
            (Word::Resume, None, None) => self.resume()?,
            (Word::RestartChain, None, None) => {
                self.restart_chain(By::Command, "by command")?;
                Answer::yes("all stages are started again")
            }
        };
        if answer.accepted {
            let text = [Some(command.name()), stage.as_deref()].into_iter().flatten().collect::<Vec<_>>().join(" ");
            self.say(EventId::CommandAccepted, CHAIN, &format!("{text}: {}", answer.text));
        } else {
            self.refusals.last.clone_from(&answer.text);
        }
        asked.answer(answer);
        Ok(())
    }

    fn restart_by_command(&mut self, stage: &str) -> Result<Answer, SupervisorError> {
        let Some(position) = self.stages.iter().position(|watched| watched.name == stage) else {
            let known: Vec<_> = self.stages.iter().map(|watched| watched.name.as_str()).collect();
            return Ok(Answer::no(format!("no stage {stage:?}; there are {}", known.join(", "))));
        };
        self.restart_stage(position, By::Command, "by command")?;
        Ok(Answer::yes(format!("{stage} is started again, as configured")))
    }

    fn degrade_by_command(&mut self) -> Answer {
        let Some(step) = self.next_step() else {
            let step = self.modes.step().name();
            return Answer::no(format!("chain.toml names no step of the ladder beyond {step}"));
        };
        self.wish(Wish::Degrade(step));
        Answer::yes(format!("{} from the next sweep on; resume leads out", step.name()))
    }

    fn resume(&mut self) -> Result<Answer, SupervisorError> {
        let was_paused = self.modes.is_paused();
        self.wish(Wish::Resume);
        let mode = self.mode_in_words();
        if was_paused {
            let more = if self.modes.is_held_down() { "; resume again leads out of that" } else { "" };
            return Ok(Answer::yes(format!("{mode}{more}")));
        }
        let restarted = self.renew_all()?;
        let more = if restarted == 0 { String::new() } else { format!("; stages started again: {restarted}") };
        Ok(Answer::yes(format!("{mode}{more}")))
    }

    /// Tells of the commands that were refused, once a second at most.
    pub(crate) fn tell_of_refusals(&mut self, now_ns: u64) {
        let refused = self.page.commands_refused.get();
        let count = refused - self.refusals.told;
        if count == 0 || now_ns.saturating_sub(self.refusals.told_ns) < REFUSED_NS {
            return;
        }
        let why = std::mem::take(&mut self.refusals.last);
        let why = if why.is_empty() { "wrong, of another user, or too many" } else { &why };
        let text = format!("{count} refused; {why}");
        (self.refusals.told, self.refusals.told_ns) = (refused, now_ns);
        self.say(EventId::CommandRefused, CHAIN, &text);
    }

    pub(crate) fn commands_report(&self) -> CommandsReport {
        CommandsReport { accepted: self.page.commands_accepted.get(), refused: self.page.commands_refused.get() }
    }
}
