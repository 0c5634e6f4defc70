//! What changed between two looks, in words.

use std::collections::VecDeque;

use messages::{Step, Verdict};
use runtime::page::State;

use crate::attached::Facts;
use crate::sample::{Sample, StageSample};
use crate::top::EventView;

/// Events that are remembered.
const MOST: usize = 200;
/// The same at the same stage within this time is one event with a larger number [s].
const MERGE_S: f64 = 5.0;

/// What can happen again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Never merged.
    Once,
    Lost,
    Dropped,
    Rejected(usize),
    Overrun,
    Miss,
}

#[derive(Clone, Debug)]
struct Event {
    at_s: f64,
    sweep: u64,
    stage: String,
    kind: Kind,
    count: u64,
    text: String,
}

/// The latest events.
#[derive(Default)]
pub(crate) struct Events {
    events: VecDeque<Event>,
}

/// Uptime [s] and sweep of a look.
pub(crate) type Moment = (f64, u64);

impl Events {
    fn add(&mut self, (at_s, sweep): Moment, stage: &str, kind: Kind, count: u64, text: String) {
        let same = |event: &&mut Event| event.stage == stage && event.kind == kind && at_s - event.at_s < MERGE_S;
        if kind != Kind::Once
            && let Some(event) = self.events.iter_mut().rev().find(same)
        {
            event.count += count;
            event.text = text;
            return;
        }
        self.events.push_back(Event { at_s, sweep, stage: stage.to_owned(), kind, count, text });
        if self.events.len() > MOST {
            self.events.pop_front();
        }
    }

    fn once(&mut self, moment: Moment, stage: &str, text: String) {
        self.add(moment, stage, Kind::Once, 1, text);
    }

    /// The instance runs again.
    pub(crate) fn add_renewal(&mut self) {
        self.once((0.0, 0), "chain", "the instance was started anew".to_owned());
    }

    /// Adds what changed from one look to the next.
    pub(crate) fn compare(&mut self, facts: &Facts, now: Moment, before: &Sample, after: &Sample) {
        for (name, (before, after)) in facts.stages.iter().zip(before.stages.iter().zip(&after.stages)) {
            self.compare_stage(now, name, before, after);
        }
        let step = |sample: &Sample| sample.stages.first().map_or(0, |source| source.counts.step) as u32;
        if step(before) != step(after) {
            let name = |sample| Step::from_number(step(sample)).name();
            self.once(now, "chain", format!("step {} → {}", name(before), name(after)));
        }
    }

    fn compare_stage(&mut self, now: Moment, name: &str, before: &StageSample, after: &StageSample) {
        let (old, new) = (&before.counts, &after.counts);
        if before.usage.is_some() && (after.usage.is_none() || old.pid != new.pid) && new.state != State::Stopped {
            self.once(now, name, format!("process {} is gone", old.pid));
        }
        if new.incarnation > old.incarnation.max(1) {
            self.once(now, name, format!("restarted: life {}, process {}", new.incarnation, new.pid));
        }
        if new.state != old.state && matches!(new.state, State::Ended | State::Stopped) {
            self.once(now, name, new.state.name().to_owned());
        }
        let mut grew = |kind, old: u64, new: u64, text: &str| {
            if new > old {
                self.add(now, name, kind, new - old, text.to_owned());
            }
        };
        grew(Kind::Lost, old.lost, new.lost, "lost with a process");
        grew(Kind::Dropped, old.dropped, new.dropped, "dropped, queue full");
        grew(Kind::Overrun, old.overruns, new.overruns, "over its budget");
        for (place, verdict) in Verdict::ALL.into_iter().enumerate() {
            let text = format!("rejected, {}", verdict.name());
            grew(Kind::Rejected(place), old.rejected[place], new.rejected[place], &text);
        }
    }

    /// Adds a sweep that was late or not answered.
    pub(crate) fn add_miss(&mut self, at: Moment, facts: &Facts, latency_ns: Option<u64>) {
        let text = match latency_ns {
            Some(ns) => format!("{:.1} ms of {:.0}", ns as f64 / 1e6, facts.deadline_ms),
            None => "not answered".to_owned(),
        };
        self.add(at, "chain", Kind::Miss, 1, text);
    }

    /// For people, oldest first.
    pub(crate) fn views(&self) -> Vec<EventView> {
        self.events.iter().map(Event::view).collect()
    }
}

fn times(count: u64) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

impl Event {
    fn view(&self) -> EventView {
        let what = match self.kind {
            Kind::Once => self.text.clone(),
            Kind::Miss if self.count == 1 => format!("deadline missed: {}", self.text),
            Kind::Miss => format!("{} deadlines missed, last {}", self.count, self.text),
            Kind::Overrun => format!("{}: {}", self.text, times(self.count)),
            _ if self.count == 1 => format!("{}: 1 part", self.text),
            _ => format!("{}: {} parts", self.text, self.count),
        };
        let grave = matches!(self.kind, Kind::Lost | Kind::Dropped | Kind::Miss) || what.ends_with("is gone");
        EventView { at_s: self.at_s, sweep: self.sweep, stage: self.stage.clone(), what, grave }
    }
}
