//! What is watched and what is done about it: from the signs of each process to findings and orders.
//!
//! Reading order: `signs` (what is known) → `health` (what is the matter, by `pulse`, `waiting`, `overruns`, `flood`) →
//! `rules` (what is done about it); `values` → `limits`; `watching` (where the supervisor's loop does all of it).

mod activity;
mod evidence;
mod flood;
mod health;
mod limits;
mod order;
mod overruns;
mod pulse;
mod rules;
mod signs;
mod times;
mod values;
mod waiting;
mod watching;

use chain::executive::{Action, Condition, Executive as Table, Watch};
pub(crate) use order::Order;

use self::evidence::Evidence;
use self::health::{Change, Patient};
use self::limits::{LimitChange, Limits};
use self::rules::Rules;
pub(crate) use self::signs::Signs;
use self::times::Times;
use self::values::Values;

/// Something that was found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Finding {
    /// The process at this place is in a condition from now on, whatever it was in before.
    Began(usize, Condition, Evidence),
    /// It is well: what was the matter, and for how long [ns].
    Ended(usize, Condition, u64),
    /// A watched value has another state.
    Limit(LimitChange),
    /// This is to be done.
    Do(Order),
}

/// The flow of sweeps at the moment of a look.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flow {
    /// From one sweep to the next [ns]; 0 where that is not known.
    pub(crate) period_ns: u64,
    /// A sensor's clock paces it.
    pub(crate) paced: bool,
    /// Sweeps are to come: the run has begun, and the source neither stands still nor has ended.
    pub(crate) flows: bool,
}

/// The engine: no clock, no file, no process of its own.
pub(crate) struct Executive {
    table: Table,
    names: Vec<String>,
    sectors: u64,
    patients: Vec<Patient>,
    rules: Rules,
    limits: Limits,
    values: Values,
    findings: Vec<Finding>,
}

impl Executive {
    /// For processes of these names in flow order, the source first; one beside the chain comes last.
    pub(crate) fn new(table: &Table, names: Vec<String>, sectors: u32, now_ns: u64) -> Self {
        Self {
            patients: names.iter().map(|_| Patient::default()).collect(),
            rules: Rules::new(&table.rules, &names),
            limits: Limits::new(&table.limits, &names, now_ns),
            values: Values::new(names.len()),
            findings: Vec::new(),
            table: table.clone(),
            sectors: u64::from(sectors.max(1)),
            names,
        }
    }

    /// Another table from now on.
    pub(crate) fn replace(&mut self, table: &Table, now_ns: u64) {
        self.rules.replace(&table.rules);
        self.limits.replace(&table.limits, &self.names, now_ns);
        self.table = table.clone();
    }

    /// The limits in host time, at this flow.
    pub(crate) fn times(&self, flow: Flow) -> Times {
        Times::of(&self.table.health, flow.period_ns, flow.paced)
    }

    /// What is the matter with the process at `place` now.
    pub(crate) fn condition(&self, place: usize) -> Option<Condition> {
        self.patients.get(place)?.ailment().map(|ailment| ailment.condition)
    }

    /// A watched value has come.
    pub(crate) fn feed(&mut self, now_ns: u64, watched: (Watch, Option<usize>), value: f64) {
        let findings = &mut self.findings;
        self.limits.feed(now_ns, watched, value, |change| findings.push(Finding::Limit(change)));
    }

    /// Looks at all processes, by place; then what was found since the last look, in the order in which it is to be said.
    pub(crate) fn look(&mut self, now_ns: u64, signs: &[Signs], flow: Flow) -> Vec<Finding> {
        let times = self.times(flow);
        for (place, signs) in signs.iter().enumerate().take(self.patients.len()) {
            let patient = &mut self.patients[place];
            let change = patient.look(now_ns, signs, (self.sectors, place == 0), (&times, &self.table.health));
            match change {
                Some(Change::Began(condition, evidence)) => {
                    patient.ailment().into_iter().for_each(|ailment| self.rules.begin(place, ailment));
                    self.findings.push(Finding::Began(place, condition, evidence));
                }
                Some(Change::Ended(condition, for_ns)) => {
                    self.rules.end(place);
                    self.findings.push(Finding::Ended(place, condition, for_ns));
                }
                None if patient.ailment().is_none() => self.rules.end(place),
                None => {}
            }
            let Some((condition, action)) = self.rules.look(now_ns, place) else { continue };
            // Whatever the table says, a stage that died is settled and started again at once.
            let is_done = action == Action::Event || (condition == Condition::Dead && action == Action::RestartStage);
            if !is_done {
                let reason = format!("{} is {}", self.names[place], word(condition));
                self.findings.push(Finding::Do(Order { action, stage: Some(place), reason }));
            }
        }
        let findings = &mut self.findings;
        self.limits.look(now_ns, flow.flows, |change| findings.push(Finding::Limit(change)));
        // Nothing is allocated where nothing was found.
        std::mem::take(&mut self.findings)
    }

    /// What is to be done because of a limit, where something is.
    fn order_of(&self, change: &LimitChange) -> Option<Order> {
        let reason = self.limit_in_words(change);
        change.then.map(|action| Order { action, stage: change.process, reason })
    }

    /// The limit, its value, and its bounds.
    fn limit_in_words(&self, change: &LimitChange) -> String {
        let Some(file) = self.limits.file(change.limit) else { return String::new() };
        let bound = |what: &str, bound: Option<f64>| bound.map_or(String::new(), |bound| format!(", {what} {bound}"));
        format!(
            "limit {:?}: {} is {:.3}{}{}",
            file.name,
            file.watch.word(),
            change.value,
            bound("at least", file.below),
            bound("at most", file.above)
        )
    }
}

/// The word of what a page says is the matter with a stage.
pub(crate) fn condition_name(number: u64) -> &'static str {
    number.checked_sub(1).and_then(|place| CONDITIONS.get(place as usize)).map_or("well", |condition| word(*condition))
}

/// All conditions, by their number.
const CONDITIONS: [Condition; 6] =
    [Condition::Dead, Condition::Hung, Condition::Spinning, Condition::Slow, Condition::Silent, Condition::Flooding];

/// The word of a condition in events and reasons.
pub(crate) fn word(condition: Condition) -> &'static str {
    match condition {
        Condition::Dead => "dead",
        Condition::Hung => "hung",
        Condition::Spinning => "spinning",
        Condition::Slow => "slow",
        Condition::Silent => "silent",
        Condition::Flooding => "flooding",
    }
}

#[cfg(test)]
mod tests;
