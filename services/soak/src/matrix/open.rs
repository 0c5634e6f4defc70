use std::process::Child;

use events::{CHAIN, Event, EventId};
use runtime::page::Counts;

use super::{Invariants, Row};
use crate::Injection;
use crate::look::{Observer, SharedMemory};
use crate::statistics::Answer;

/// Events that say that something was done.
const ACTIONS: [EventId; 17] = [
    EventId::SupervisorAdopted,
    EventId::StageRestarted,
    EventId::StageKilled,
    EventId::BudgetSpent,
    EventId::StandIn,
    EventId::StageGivenUp,
    EventId::ChainRestarted,
    EventId::TapeStopped,
    EventId::SentAgain,
    EventId::StaleRefused,
    EventId::StepTaken,
    EventId::SafeEntered,
    EventId::CommandRefused,
    EventId::TableRefused,
    EventId::FileFailed,
    EventId::EventsUnsaid,
    EventId::ClockStep,
];

/// File descriptors that a process may have more than before the first fault. Who tells another that something was sent opens the
/// way there when it does so for the first time, the supervisor after a death; so each process comes to have a few more, once.
const FIRST_TIME_FILES: u64 = 16;

/// What is left of a fault that is over.
const AFTERWARDS_NS: u64 = 1_000_000_000;

/// A fault that is under way, watched until the next one.
pub(crate) struct Open {
    pub(crate) injection: Injection,
    pub(crate) child: Option<Child>,
    at_ns: u64,
    /// Of the latest injection: it may be had twice.
    output_from_ns: u64,
    before: Before,
    detected: Option<(u64, &'static str)>,
    action: Vec<String>,
    last_whole_ns: Option<u64>,
    /// The longest time without a whole answer of those that began in its time, and its end [ns].
    gap: (u64, u64),
    pub(crate) refused: Option<String>,
}

/// What there was before the first of all faults.
pub(crate) struct Baseline {
    files: Vec<(String, u64, u64)>,
    shared: SharedMemory,
}

impl Baseline {
    /// Now.
    pub(crate) fn of(observer: &Observer<'_>) -> Self {
        Self { files: observer.files(), shared: observer.shared_memory() }
    }
}

/// What there was before.
struct Before {
    account: [u64; 3],
    restarts: u64,
    fell: u64,
    over_budget: u64,
    stale: u64,
    missed: u64,
    pids: Vec<(String, u64)>,
    life: Option<u64>,
    settled: Option<u64>,
    files: Vec<(String, u64, u64)>,
    shared: SharedMemory,
}

fn missed(observer: &Observer<'_>) -> u64 {
    let tally = observer.availability.overall;
    tally.due - tally.in_time
}

fn pids(observer: &Observer<'_>) -> Vec<(String, u64)> {
    observer.pages.all().map(|(name, counts)| (name.to_owned(), counts.pid)).collect()
}

impl Open {
    /// The fault is injected at `now_ns`; `last_whole_ns` is the time of the last whole answer, `first` what there was before the
    /// first fault.
    pub(crate) fn new(
        injection: Injection,
        child: Option<Child>,
        now_ns: u64,
        last_whole_ns: Option<u64>,
        first: &Baseline,
        observer: &Observer<'_>,
    ) -> Self {
        let hit = injection.stage.as_deref().and_then(|stage| observer.pages.of(stage));
        let before = Before {
            account: observer.account(),
            restarts: observer.restarts,
            fell: observer.pages.fell,
            over_budget: observer.over_budget,
            stale: observer.stale,
            missed: missed(observer),
            pids: pids(observer),
            life: hit.map(|counts| counts.incarnation),
            settled: hit.map(|counts| counts.settled_incarnation),
            files: first.files.clone(),
            shared: first.shared,
        };
        Self {
            injection,
            child,
            at_ns: now_ns,
            output_from_ns: now_ns,
            before,
            detected: None,
            action: Vec::new(),
            last_whole_ns,
            gap: (0, 0),
            refused: None,
        }
    }

    /// It was injected once more.
    pub(crate) fn again(&mut self, now_ns: u64) {
        self.output_from_ns = now_ns;
        self.gap = (0, 0);
    }

    /// What was seen since the last look.
    pub(crate) fn note(&mut self, answers: &[Answer], events: &[Event], observer: &Observer<'_>, now_ns: u64) {
        for answer in answers.iter().filter(|answer| answer.whole) {
            if let Some(last) = self.last_whole_ns.replace(answer.answered_ns) {
                let length = answer.answered_ns.saturating_sub(last);
                if length > self.gap.0 && self.is_in_time(last) {
                    self.gap = (length, answer.answered_ns);
                }
            }
        }
        for event in events.iter().filter(|event| event.time_ns >= self.at_ns && event.name != "fault_injected") {
            if self.injection.is_sign(event) {
                self.detected.get_or_insert((event.time_ns, "event"));
            }
            let about = self.injection.stage.as_ref().is_none_or(|stage| *stage == event.stage || event.stage == CHAIN);
            let is_action = event.event_id().is_some_and(|id| ACTIONS.contains(&id));
            if about && is_action && !self.action.contains(&event.name) {
                self.action.push(event.name.clone());
            }
        }
        let hit = self.injection.stage.as_deref().and_then(|stage| observer.pages.of(stage));
        if self.detected.is_none() && hit.is_some_and(|counts| self.is_known(counts)) {
            self.detected = Some((now_ns, "page"));
        }
    }

    /// Whether a silence that began then may be this fault's: while it lasted, or in the second after it. Later ones are the
    /// machine's; they count as sweeps missed and against availability.
    fn is_in_time(&self, began_ns: u64) -> bool {
        is_in_time(began_ns, self.output_from_ns, self.injection.lasts_s)
    }

    /// Whether the supervisor has settled the account of the life that was hit, or begun another one.
    fn is_known(&self, hit: &Counts) -> bool {
        self.before.life.is_some_and(|life| hit.incarnation > life)
            || self.before.settled.is_some_and(|settled| hit.settled_incarnation > settled)
    }

    /// The time for this fault is over: what it was.
    pub(crate) fn close(self, observer: &Observer<'_>, now_ns: u64) -> Row {
        let before = &self.before;
        let [lost, dropped, rejected] = observer.account();
        let spared = |name: &str| !self.injection.hits_neighbours() && self.injection.stage.as_deref() != Some(name);
        let now = pids(observer);
        let neighbours_kept = before
            .pids
            .iter()
            .all(|(name, pid)| !spared(name) || now.iter().any(|(other, other_pid)| other == name && other_pid == pid));
        let files = observer.files();
        let files_back = before.files.iter().all(|(name, _, most)| {
            files.iter().all(|(other, _, now)| other != name || *now <= most + FIRST_TIME_FILES)
        });
        let (was, is) = (before.shared, observer.shared_memory());
        let since_ms = |ns: u64, from_ns: u64| ns.saturating_sub(from_ns) as f64 / 1e6;
        let period_ns = observer.availability.period_ns();
        Row {
            t_s: observer.t_s(self.at_ns),
            fault: self.injection.title(),
            stage: self.injection.stage.clone(),
            words: self.injection.words.join(" "),
            detected_ms: self.detected.map(|(ns, _)| since_ms(ns, self.at_ns)),
            detected_by: self.detected.map(|(_, by)| by.to_owned()),
            action: self.action,
            output_again_ms: output_again_ms(self.gap, self.output_from_ns, self.last_whole_ns, now_ns, period_ns),
            missed_sweeps: missed(observer).saturating_sub(before.missed),
            lost: lost.saturating_sub(before.account[0]),
            dropped: dropped.saturating_sub(before.account[1]),
            rejected: rejected.saturating_sub(before.account[2]),
            restarts: observer.restarts.saturating_sub(before.restarts),
            invariants: Invariants {
                sequence_rises: observer.pages.fell == before.fell,
                within_budget: observer.over_budget == before.over_budget,
                neighbours_kept,
                none_stale: observer.stale == before.stale,
                files_back,
                shared_memory_back: is.files <= was.files && is.length_kib <= was.length_kib,
            },
            refused: self.refused,
        }
    }
}

fn is_in_time(began_ns: u64, from_ns: u64, lasts_s: f64) -> bool {
    began_ns <= from_ns.saturating_add((lasts_s * 1e9) as u64).saturating_add(AFTERWARDS_NS)
}

/// From the injection to the end of the longest of its gaps between whole answers [ms]. 0 where none was longer than a period and a half;
/// none where the longest has not ended.
fn output_again_ms(
    (length, end_ns): (u64, u64),
    from_ns: u64,
    last_ns: Option<u64>,
    now_ns: u64,
    period_ns: u64,
) -> Option<f64> {
    let usual = period_ns + period_ns / 2;
    let silent = now_ns.saturating_sub(last_ns.unwrap_or(0));
    if silent > usual && silent > length {
        return None;
    }
    Some(if length > usual { end_ns.saturating_sub(from_ns) as f64 / 1e6 } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn output_is_back_at_the_end_of_the_longest_gap() {
        let again = |gap, last_ms, now_ms| output_again_ms(gap, 1_000 * MS, Some(last_ms * MS), now_ms * MS, 100 * MS);
        assert_eq!(again((100 * MS, 1_100 * MS), 4_000, 4_050), Some(0.0));
        assert_eq!(again((600 * MS, 1_550 * MS), 4_000, 4_050), Some(550.0));
        assert_eq!(again((600 * MS, 1_550 * MS), 2_000, 4_050), None);
    }

    #[test]
    fn a_silence_long_after_a_fault_is_not_its_own() {
        for (lasts_s, began_ms, own) in [(0.0, 900, true), (0.0, 2_000, true), (0.0, 2_001, false), (5.0, 7_000, true)]
        {
            assert_eq!(is_in_time(began_ms * MS, 1_000 * MS, lasts_s), own, "{lasts_s} {began_ms}");
        }
    }
}
