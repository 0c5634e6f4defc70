//! Where the supervisor's loop looks after the health of its processes.

use chain::executive::Condition;
use events::{CHAIN, EventId};
use runtime::page::Page;
use runtime::{Pace, TAPE, clock};

use super::limits::{LimitChange, LimitState};
use super::signs::{Signs, source_is_idle};
use super::values::Sources;
use super::{Finding, Flow, Order, word};
use crate::watch::Watch;

impl Watch<'_> {
    /// Looks at all processes and watched values, says what has changed, and gives what is to be done about it, in order.
    pub(crate) fn watch_health(&mut self) -> Vec<Order> {
        let now_ns = clock::now_ns();
        let flow = self.flow();
        self.gather(now_ns, flow);
        let findings = self.executive.look(now_ns, &self.signs, flow);
        for (place, stage) in self.stages.iter().enumerate() {
            let condition = self.executive.condition(place);
            stage.page.condition.set(condition.map_or(0, |condition| condition as u64 + 1));
        }
        let mut orders = Vec::new();
        for finding in findings {
            self.say_finding(&finding);
            match finding {
                Finding::Do(order) => orders.push(order),
                Finding::Limit(change) => orders.extend(self.executive.order_of(&change)),
                Finding::Began(..) | Finding::Ended(..) => {}
            }
        }
        orders
    }

    fn flow(&self) -> Flow {
        let tape = self.tape.as_ref().map(|tape| &tape.process);
        let source: Option<&Page> = self.stages.first().map(|source| &*source.page);
        Flow {
            period_ns: source.map_or(0, |source| source.period_ns.get()),
            paced: self.plan.pace == Pace::Realtime,
            flows: self.begun && !source_is_idle(&self.plan, &self.stages, tape),
        }
    }

    /// Gathers the signs of all processes, and the values that have come.
    fn gather(&mut self, now_ns: u64, flow: Flow) {
        let asked_ns = self.executive.times(flow).asked_ns;
        let tape = self.tape.as_ref().map(|tape| &tape.process);
        self.signs.clear();
        for (place, stage) in self.stages.iter().enumerate() {
            let before = place.checked_sub(1).map(|before| &self.stages[before]);
            let signs = Signs::of(stage, before, now_ns, asked_ns);
            self.signs.push(Signs { idle: place == 0 && !flow.flows, ..signs });
        }
        // The tape has no part that it owes to anybody: it can be hung, spinning or dead.
        self.signs.extend(tape.map(|tape| Signs { idle: true, ..Signs::of(tape, None, now_ns, asked_ns) }));
        if let Some(sink) = self.stages.last() {
            self.executive.take_sweep(now_ns, &self.plan, &sink.page);
        }
        if self.begun && self.sampled_ns != self.next_sample_ns {
            self.sampled_ns = self.next_sample_ns;
            let Self { instance, plan, stages, .. } = self;
            let sources = Sources { instance, plan, stages, tape: self.tape.as_ref().map(|tape| &tape.process) };
            self.executive.take_second(now_ns, &sources, flow.flows);
        }
    }

    /// The name of the process at a place of the signs.
    pub(crate) fn name_at(&self, place: usize) -> String {
        self.stages.get(place).map_or_else(|| TAPE.to_owned(), |stage| stage.name.clone())
    }

    fn say_finding(&mut self, finding: &Finding) {
        match finding {
            // A death is said with how it came, by whoever settles it.
            Finding::Began(_, Condition::Dead, _) => {}
            Finding::Began(place, condition, evidence) => {
                let id = event_of(*condition);
                self.say(id, &self.name_at(*place), &evidence.to_string());
            }
            Finding::Ended(place, condition, for_ns) => {
                let text = format!("was {} for {} ms", word(*condition), for_ns / 1_000_000);
                self.say(EventId::StageWell, &self.name_at(*place), &text);
            }
            Finding::Limit(change) => self.say_limit(change),
            // Said by whoever does it.
            Finding::Do(_) => {}
        }
    }

    fn say_limit(&mut self, change: &LimitChange) {
        let id = match change.state {
            LimitState::Within => EventId::LimitRestored,
            LimitState::Violated => EventId::LimitViolated,
            LimitState::Stale => EventId::LimitStale,
            LimitState::NoNumber => EventId::LimitNoNumber,
        };
        let name = change.process.map_or_else(|| CHAIN.to_owned(), |place| self.name_at(place));
        let text = self.executive.limit_in_words(change);
        self.say(id, &name, &text);
    }
}

fn event_of(condition: Condition) -> EventId {
    match condition {
        Condition::Dead => EventId::StageDied,
        Condition::Hung => EventId::StageHung,
        Condition::Spinning => EventId::StageSpinning,
        Condition::Slow => EventId::StageSlow,
        Condition::Silent => EventId::StageSilent,
        Condition::Flooding => EventId::StageFlooding,
    }
}
