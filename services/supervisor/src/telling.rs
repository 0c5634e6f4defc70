//! What happens is said in the log of the run: by the stages on their pages, and by the supervisor itself.

use std::path::Path;

use chain::executive::EventsFile;
use events::{Bounds, Danger, EventId, Happened, Log, LogError, Severity, Throttle};
use messages::Verdict;
use runtime::page::{Heard, Page, Said};
use runtime::{Plan, TAPE, clock};

use crate::processes::child::Ended;
use crate::watch::Watch;

/// Warnings of a kind that the terminal is told at once, and then in a second. The log has them all.
const TERMINAL: (u32, f64) = (3, 0.1);
/// Between two words about events that were overwritten before they were read [ns].
const UNREAD_NS: u64 = 1_000_000_000;

/// What the supervisor has heard of its processes.
pub(crate) struct Ears {
    /// The stages in flow order, then the tape.
    processes: Vec<Ear>,
    /// What was said by then has been heard by a supervisor before this one [ns].
    before_ns: u64,
    /// What waits to be worded: who said it, and what. Memory that is used again at each look.
    said: Vec<(usize, Said)>,
    terminal: Throttle,
    tape_stopped: bool,
}

#[derive(Default)]
struct Ear {
    heard: Heard,
    /// The last life of which it was said that it is up.
    up: u64,
    /// Of [`Heard::missed`], what was said, and when.
    unread: u64,
    unread_ns: u64,
}

impl Ears {
    /// For the processes of these pages. What an earlier supervisor has put into the log is not heard again.
    pub(crate) fn new<'a>(pages: impl Iterator<Item = &'a Page>, log: &Log) -> Self {
        let ear = |page: &Page| {
            let mut before = Heard::default();
            page.hear(&mut before, |_| ());
            Ear { up: page.incarnation.get(), unread: before.missed, ..Ear::default() }
        };
        Self {
            processes: pages.map(ear).collect(),
            before_ns: log.before_ns(),
            said: Vec::new(),
            terminal: Throttle::new(TERMINAL.0, TERMINAL.1),
            tape_stopped: false,
        }
    }
}

/// Begins the log of a run, or goes on with the one that is there.
pub(crate) fn open_log(plan: &Plan, path: &Path) -> Result<Log, LogError> {
    Log::create(path, bounds(plan), plan.outputs.events.as_deref())
}

/// How much the plan lets be said.
pub(crate) fn bounds(plan: &Plan) -> Bounds {
    let EventsFile { burst, per_s, log_mib } = plan.executive.events;
    Bounds { burst, per_s, log_bytes: log_mib << 20 }
}

impl Watch<'_> {
    /// Says that something happened to a process of the chain, or to [`events::CHAIN`].
    pub(crate) fn say(&mut self, id: EventId, stage: &str, text: &str) {
        let (time_ns, utc_ns, sweep) = (clock::now_ns(), clock::utc_ns(), self.sweep());
        self.put(&Happened { time_ns, utc_ns, id, stage, sweep, size: 0, text });
    }

    fn sweep(&self) -> u64 {
        let sectors = u64::from(self.plan.chain.sectors.max(1));
        self.stages.first().map_or(0, |source| source.page.next_ordinal_out.get() / sectors)
    }

    fn put(&mut self, happened: &Happened<'_>) {
        self.log.say(happened);
        let Happened { id, stage, sweep, size, text, time_ns, .. } = *happened;
        // Whoever has the file has named it on the terminal already. What is worse counts there when it is twice as bad.
        let doublings = u64::from(size.checked_ilog2().unwrap_or(0));
        let admitted =
            if id == EventId::FileFailed { None } else { self.ears.terminal.admit(time_ns, id, stage, doublings) };
        let Some(unsaid) = admitted else { return };
        let what = id.entry().name.replace('_', " ");
        match id.severity() {
            Severity::Info => tracing::info!(sweep, "{stage} {what}: {text}"),
            Severity::Warning if unsaid > 0 => tracing::warn!(sweep, unsaid, "{stage} {what}: {text}"),
            Severity::Warning => tracing::warn!(sweep, "{stage} {what}: {text}"),
            Severity::Error | Severity::Critical => tracing::error!(sweep, "{stage} {what}: {text}"),
        }
    }

    /// Hears what all processes have said since the last look, and puts it into the log in order of time; then who is up
    /// for the first time in its life, and what was left unsaid in storms that are over.
    pub(crate) fn listen(&mut self) {
        let (now_ns, utc_ns) = (clock::now_ns(), clock::utc_ns());
        let mut said = std::mem::take(&mut self.ears.said);
        let mut own: Vec<(EventId, usize, String)> = Vec::new();
        let beside = self.tape.iter().map(|tape| &tape.process);
        for (place, process) in self.stages.iter().chain(beside).enumerate() {
            let (Some(ear), page) = (self.ears.processes.get_mut(place), &process.page) else { continue };
            page.hear(&mut ear.heard, |event| said.push((place, event)));
            let unread = ear.heard.missed.saturating_sub(ear.unread);
            if unread > 0 && now_ns.saturating_sub(ear.unread_ns) >= UNREAD_NS {
                (ear.unread, ear.unread_ns) = (ear.heard.missed, now_ns);
                own.push((
                    EventId::EventsUnread,
                    place,
                    format!("{unread} events were overwritten before they were read"),
                ));
            }
            let life = page.incarnation.get();
            if life > ear.up && process.is_up() {
                ear.up = life;
                own.push((EventId::StageStarted, place, format!("process {}, life {life}", page.pid.get())));
            }
        }
        said.retain(|(_, event)| event.time_ns > self.ears.before_ns);
        said.sort_by_key(|(_, event)| event.time_ns);
        for (place, event) in said.drain(..) {
            let Said { id, time_ns, sweep, a, b } = event;
            let stage = self.name(place);
            let utc_ns = utc_ns.saturating_sub(now_ns.saturating_sub(time_ns));
            let text = words(&event);
            // What a process said comes no later than it is heard, whatever its page says.
            let time_ns = time_ns.min(now_ns);
            self.put(&Happened { time_ns, utc_ns, id, stage: &stage, sweep, size: size(id, a, b), text: &text });
        }
        self.ears.said = said;
        for (id, place, text) in own {
            let stage = self.name(place);
            self.say(id, &stage, &text);
        }
        if let Some(reason) = self.tape.as_ref().and_then(|tape| tape.stopped.clone())
            && !std::mem::replace(&mut self.ears.tape_stopped, true)
        {
            self.say(EventId::TapeStopped, TAPE, &reason);
        }
        let sweep = self.sweep();
        self.log.settle((now_ns, utc_ns), sweep, false);
    }

    /// Hears what there still is to hear, and says what was left unsaid.
    pub(crate) fn end_log(&mut self) {
        self.listen();
        let (times, sweep) = ((clock::now_ns(), clock::utc_ns()), self.sweep());
        self.log.settle(times, sweep, true);
    }

    fn name(&self, place: usize) -> String {
        self.stages.get(place).map_or(TAPE, |stage| &stage.name).to_owned()
    }

    /// Says that a stage's process ended that was not told to. Gives what its page counted as lost by then.
    pub(crate) fn tell_death(&mut self, position: usize, ended: Ended) -> u64 {
        let stage = &self.stages[position];
        let (name, pid, lost) = (stage.name.clone(), stage.last_pid(), stage.page.lost.get());
        if !stage.told {
            self.tell_end_of(&name, pid, ended);
        }
        lost
    }

    /// Says what the settlement of a dead stage's account found lost.
    pub(crate) fn tell_losses(&mut self, position: usize, lost_before: u64) {
        let (name, page) = (self.name(position), &self.stages[position].page);
        let lost = page.lost.get().saturating_sub(lost_before);
        if lost > 0 {
            self.say(EventId::PartsLost, &name, &format!("{lost} parts that it had in hand"));
        }
    }

    /// Says that a process ended that should not have, after all that it had said itself.
    pub(crate) fn tell_end_of(&mut self, stage: &str, pid: u64, ended: Ended) {
        self.listen();
        let how = match ended {
            Ended::Code(code) => format!("exit code {code}"),
            Ended::Signal(signal) => format!("signal {signal}"),
            Ended::Gone => "it is gone".to_owned(),
        };
        self.say(EventId::StageDied, stage, &format!("process {pid}: {how}"));
    }

    /// Says that a process was started in place of one that ended.
    pub(crate) fn tell_restart(&mut self, stage: &str, restarts: u64) {
        self.say(EventId::StageRestarted, stage, &format!("restart {restarts}"));
    }
}

/// What a stage said, in words.
fn words(said: &Said) -> String {
    let Said { id, a, b, .. } = *said;
    let reason = usize::try_from(b).ok().and_then(|number| Verdict::ALL.get(number).copied());
    match (id, reason) {
        (EventId::CollisionAlert, _) => format!("track {a}: {}", Danger::from_number(b)),
        (EventId::PartsRejected, Some(reason)) => format!("{a} parts: {}", reason.name()),
        // The supervisor's own events have no text; a stage that says one nevertheless is quoted.
        _ if id.entry().text.is_empty() => format!("{a}, {b}"),
        _ => id.text(a, b),
    }
}

/// How bad an event is among its kind, where one can be worse than another.
fn size(id: EventId, a: u64, b: u64) -> u64 {
    match id {
        EventId::PartsDropped
        | EventId::PartsRejected
        | EventId::StaleRefused
        | EventId::SinkBehind
        | EventId::BudgetOverrun
        | EventId::DeadlineMissed => a,
        EventId::ClockStep => a.max(b),
        EventId::CollisionAlert => b,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stages_say_is_worded_with_reasons_by_name() {
        let said = |id, a, b| Said { id, time_ns: 0, sweep: 0, a, b };
        let incomplete = Verdict::RejectedIncomplete as u64;
        assert_eq!(words(&said(EventId::PartsRejected, 3, incomplete)), "3 parts: incomplete");
        assert_eq!(words(&said(EventId::PartsRejected, 3, 99)), "3 parts, reason 99");
        assert_eq!(words(&said(EventId::BudgetOverrun, 25_000, 20_000)), "busy for 25000 µs of 20000");
        let danger = Danger::of(0.5, 2.0).to_number();
        assert_eq!(words(&said(EventId::CollisionAlert, 7, danger)), "track 7: met with a probability of 50 % in 2 s");
        assert_eq!(words(&said(EventId::RunBegan, 1, 2)), "1, 2");
    }

    #[test]
    fn of_what_can_be_worse_the_worst_is_known() {
        assert_eq!(size(EventId::DeadlineMissed, 140_000, 100_000), 140_000);
        assert_eq!(size(EventId::ClockStep, 0, 3_600_000), 3_600_000);
        assert_eq!(size(EventId::SentAgain, 7, 8), 0);
    }
}
