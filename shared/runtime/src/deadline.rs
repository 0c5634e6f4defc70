//! Whether a stage keeps its times: overruns of its budget, slips, sweeps that left it after the deadline.

use events::EventId;
use messages::{Hop, Trace};

use crate::page::{Page, Said};
use crate::{Pace, Plan};

const NS_PER_MS: f64 = 1e6;

/// What a stage's time is held against, and what it has used of it for the sweep at hand.
pub(crate) struct Deadline {
    paced: bool,
    budget_ns: u64,
    deadline_ns: u64,
    allowed_age_ns: u64,
    /// Sweep whose busy time is being added up.
    sweep: u64,
    busy_ns: u64,
}

impl Deadline {
    /// Of the stage `name`; one without a budget may take as long as the deadline.
    pub(crate) fn of(plan: &Plan, name: &str) -> Self {
        let ns = |ms: f64| (ms * NS_PER_MS) as u64;
        let budget_ms = plan.chain.stages.iter().find(|stage| stage.name == name).and_then(|stage| stage.budget_ms);
        Self {
            paced: plan.pace == Pace::Realtime,
            budget_ns: ns(budget_ms.unwrap_or(plan.chain.deadline_ms)),
            deadline_ns: ns(plan.chain.deadline_ms),
            allowed_age_ns: ns(plan.chain.allowed_age_ms),
            sweep: 0,
            busy_ns: 0,
        }
    }

    /// Whether a part is so old that nobody may act on it any more. Never at [`Pace::Fast`], which has no sensor's time.
    pub(crate) fn is_stale(&self, trace: &Trace, now_ns: u64) -> bool {
        self.paced && now_ns.saturating_sub(trace.due_ns) > self.allowed_age_ns
    }

    /// Judges a part that the stage has finished, as its hop says; a sweep is judged with its last part.
    pub(crate) fn judge(&mut self, page: &Page, trace: &Trace, hop: &Hop) {
        let sent_ns = trace.hops().last().map_or(0, |sent| sent.finished_ns);
        if sent_ns < hop.free_ns {
            page.slips.add(1);
        }
        if trace.part.sweep != self.sweep {
            (self.sweep, self.busy_ns) = (trace.part.sweep, 0);
        }
        self.busy_ns += hop.finished_ns.saturating_sub(hop.started_ns);
        if !self.paced || !trace.part.is_last() {
            return;
        }
        if hop.finished_ns.saturating_sub(trace.due_ns) > self.deadline_ns {
            page.late.add(1);
        }
        if self.busy_ns > self.budget_ns {
            page.overruns.add(1);
            let (a, b) = (self.busy_ns / 1_000, self.budget_ns / 1_000);
            page.say(Said { id: EventId::BudgetOverrun, time_ns: hop.finished_ns, sweep: trace.part.sweep, a, b });
        }
    }
}

#[cfg(test)]
mod tests {
    use messages::Part;

    use super::*;
    use crate::page::{Heard, PageMap};

    fn sut() -> Deadline {
        Deadline { paced: true, budget_ns: 10, deadline_ns: 50, allowed_age_ns: 500, sweep: 0, busy_ns: 0 }
    }

    fn trace(sweep: u64, sector: u32, due_ns: u64, sent_ns: u64) -> Trace {
        let part = Part { sweep, sector, sectors: 2, ..Part::default() };
        let mut trace = Trace { part, due_ns, ..Trace::default() };
        trace.push(Hop { finished_ns: sent_ns, ..Hop::default() });
        trace
    }

    fn hop(free_ns: u64, started_ns: u64, finished_ns: u64) -> Hop {
        Hop { free_ns, started_ns, finished_ns, ..Hop::default() }
    }

    #[test]
    fn a_budget_is_of_the_whole_sweep_and_each_sweep_has_its_own() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let mut sut = sut();
        sut.judge(&page, &trace(0, 0, 100, 100), &hop(0, 100, 106));
        sut.judge(&page, &trace(0, 1, 110, 110), &hop(106, 110, 114));
        assert_eq!(page.overruns.get(), 0, "6 + 4 of 10");
        sut.judge(&page, &trace(1, 0, 200, 200), &hop(114, 200, 206));
        sut.judge(&page, &trace(1, 1, 210, 210), &hop(206, 210, 215));
        assert_eq!(page.overruns.get(), 1, "6 + 5 of 10");
        let mut said = Vec::new();
        page.hear(&mut Heard::default(), |event| said.push((event.id, event.sweep)));
        assert_eq!(said, [(EventId::BudgetOverrun, 1)]);
    }

    #[test]
    fn a_slip_is_an_input_that_waited_and_a_late_sweep_left_after_the_deadline() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let mut sut = sut();
        sut.judge(&page, &trace(0, 1, 100, 120), &hop(119, 121, 150));
        assert_eq!((page.slips.get(), page.late.get()), (0, 0));
        sut.judge(&page, &trace(1, 1, 100, 120), &hop(150, 150, 151));
        assert_eq!((page.slips.get(), page.late.get()), (1, 1));
        sut.judge(&page, &trace(2, 0, 100, 120), &hop(10, 120, 170));
        assert_eq!(page.late.get(), 1, "only the last part of a sweep can be late");
    }

    #[test]
    fn parts_are_stale_beyond_the_allowed_age_at_the_sensors_pace_alone() {
        let mut sut = sut();
        assert!(!sut.is_stale(&trace(0, 0, 100, 0), 600));
        assert!(sut.is_stale(&trace(0, 0, 100, 0), 601));
        sut.paced = false;
        assert!(!sut.is_stale(&trace(0, 0, 100, 0), 601));
    }
}
