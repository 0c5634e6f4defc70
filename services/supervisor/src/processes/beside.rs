//! The tape: a process that reads along beside the chain. It may die, and the chain goes on.

use std::time::Duration;

use runtime::page::Page;
use runtime::{Pace, Plan, TAPE, clock};
use rustix::process::Pid;
use serde::{Deserialize, Serialize};
use tape::Counts;
use transport::Instance;

use crate::SupervisorError;
use crate::processes::child::{Ended, Watched};
use crate::restarts::settle::CLEAN_PATIENCE;
use crate::watch::{CANNOT_START, Watch};

/// How long the tape may take to drain what a dead stage had sent [ns]. What it does not is lost to it.
const DRAIN_PATIENCE_NS: u64 = 50_000_000;

/// What was recorded.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct RecordingReport {
    /// The first file of the recording.
    pub file: String,
    /// What its files hold and lack.
    #[serde(flatten)]
    pub counts: Counts,
    /// Restarts of the process that writes it.
    pub restarts: u64,
    /// Why it ended before the run did.
    pub stopped: Option<String>,
}

impl RecordingReport {
    /// Why the recording is not what was asked for; `strict` where nothing may be lost.
    pub(crate) fn failure(&self, strict: bool) -> Option<String> {
        let lost = self.counts.lost();
        match (&self.stopped, &self.counts.failure) {
            (Some(reason), _) => Some(reason.clone()),
            (None, Some(failure)) => Some(format!("a file failed: the recording lacks {lost} messages: {failure}")),
            (None, None) if lost > 0 && strict => Some(format!("the recording lacks {lost} messages")),
            (None, None) => None,
        }
    }
}

/// The tape's process, where something is recorded.
pub(crate) struct Tape {
    pub(crate) process: Watched,
    pub(crate) stopped: Option<String>,
}

impl Tape {
    pub(crate) fn new(instance: &Instance, plan: &Plan, spawn: bool) -> Result<Option<Self>, SupervisorError> {
        let tape = |name| Ok(Self { process: Watched::named(instance, plan, name, spawn)?, stopped: None });
        plan.tape().map(tape).transpose()
    }

    /// The tape of a chain whose supervisor died.
    pub(crate) fn adopt(
        instance: &Instance,
        plan: &Plan,
        spawn: bool,
        living: &[(String, Pid)],
    ) -> Result<Option<Self>, SupervisorError> {
        let tape = |name| Ok(Self { process: Watched::adopt(instance, plan, name, spawn, living)?, stopped: None });
        plan.tape().map(tape).transpose()
    }

    /// Whether its process is connected, or none is to come any more.
    pub(crate) fn is_up(&self) -> bool {
        self.stopped.is_some() || self.process.is_up()
    }

    /// Makes it drain what a dead stage had sent, before that is cleaned away.
    pub(crate) fn drain(&self) {
        if !self.process.is_up() {
            return;
        }
        let page: &Page = &self.process.page;
        let request = page.drain_request.get() + 1;
        page.drain_request.set(request);
        clock::wait_for(DRAIN_PATIENCE_NS, || page.drained_incarnation.get() >= request);
    }

    /// It stays away: nobody waits for it any more.
    fn give_up(&mut self, reason: String) {
        self.process.told = true;
        self.process.page.next_ordinal_out.set(u64::MAX);
        self.stopped = Some(reason);
    }

    pub(crate) fn report(&self, instance: &Instance, plan: &Plan) -> RecordingReport {
        let mut counts = Counts::default();
        for life in 1..=self.process.page.incarnation.get() {
            // A life that ended before its first second left none.
            let text = std::fs::read(Plan::counts_path(instance, life as u32)).unwrap_or_default();
            if let Ok(of_life) = serde_json::from_slice(&text) {
                counts.add(&of_life);
            }
        }
        let file = plan.outputs.record.as_deref().map_or(String::new(), |path| path.display().to_string());
        let restarts = self.process.page.incarnation.get().saturating_sub(1);
        RecordingReport { file, counts, restarts, stopped: self.stopped.clone() }
    }
}

impl Watch<'_> {
    /// Looks whether the tape has died, and starts it again.
    pub(crate) fn look_at_tape(&mut self) -> Result<(), SupervisorError> {
        let Some(tape) = &mut self.tape else { return Ok(()) };
        let Some(ended) = tape.process.look() else { return Ok(()) };
        let page = &tape.process.page;
        page.settled_incarnation.set(page.incarnation.get());
        self.node.clean_dead(CLEAN_PATIENCE);
        if tape.process.told {
            return Ok(());
        }
        if ended == Ended::Code(CANNOT_START) && !self.begun {
            return Err(SupervisorError::Refused(TAPE.to_owned()));
        }
        let pid = tape.process.last_pid();
        self.tell_end_of(TAPE, pid, ended);
        let Some(tape) = &mut self.tape else { return Ok(()) };
        if ended == Ended::Code(CANNOT_START) {
            tape.give_up("the tape could not start again".to_owned());
        } else if tape.process.restarts.allow(clock::now_ns()) {
            let for_the_child = self.as_before.as_ref().map(runtime::realtime::AsBefore::for_a_moment);
            tape.process.start()?;
            drop(for_the_child);
            let restarts = tape.process.restarts.total;
            self.tell_restart(TAPE, restarts);
        } else {
            let budget = self.plan.chain.restart_budget;
            tape.give_up(format!("the tape died more than {} times within {} s", budget.restarts, budget.window_s));
        }
        Ok(())
    }

    /// Tells the tape to leave, when nothing more will come, and waits until it has written what it has.
    pub(crate) fn end_tape(&mut self) -> Result<(), SupervisorError> {
        const LEAVE_PATIENCE: Duration = Duration::from_secs(10);
        let torn = self.renewing && self.is_torn();
        let Some(tape) = &mut self.tape else { return Ok(()) };
        tape.process.tell();
        if torn {
            tape.process.kill();
        }
        let end_ns = clock::now_ns() + LEAVE_PATIENCE.as_nanos() as u64;
        while self.tape.as_ref().is_some_and(|tape| tape.process.is_alive()) {
            if clock::now_ns() > end_ns {
                tracing::error!("the tape did not end its files within 10 s: killed");
                self.tape.iter().for_each(|tape| tape.process.kill());
            }
            self.look_once()?;
        }
        Ok(())
    }

    /// Whether all that was sent is on the tape; where losses are allowed nobody waits for it.
    pub(crate) fn is_on_tape(&self) -> bool {
        let Some(tape) = &self.tape else { return true };
        let sent = self.stages[0].page.next_ordinal_out.get();
        self.plan.pace == Pace::Realtime || tape.process.page.next_ordinal_out.get() >= sent
    }
}
