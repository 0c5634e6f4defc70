//! The condition of one stage, told apart by its signs over time.

use chain::executive::{Condition, HealthFile};

use super::evidence::Evidence;
use super::flood::{EventFlood, SweepFlood};
use super::overruns::Overruns;
use super::pulse::Pulse;
use super::signs::Signs;
use super::times::Times;
use super::waiting::Waiting;

/// How long a stage that was found slow within a part counts as slow [sweeps].
const SLOW_SWEEPS: u64 = 10;
/// How long a process may take to come up [ns].
const START_NS: u64 = 10_000_000_000;

/// What is the matter with a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ailment {
    /// What.
    pub(crate) condition: Condition,
    /// Host time at which it was found [ns].
    pub(crate) since_ns: u64,
}

/// What has changed with a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    /// It is in this condition from now on, whatever it was in before.
    Began(Condition, Evidence),
    /// It is well: what was the matter, and for how long [ns].
    Ended(Condition, u64),
}

/// What is remembered of one stage.
#[derive(Debug, Default)]
pub(crate) struct Patient {
    ailment: Option<Ailment>,
    was_up: bool,
    processes: u64,
    /// Since when its present process has been coming up [ns].
    starts_ns: Option<u64>,
    life: u64,
    pulse: Pulse,
    waiting: Waiting,
    overruns: Overruns,
    /// Until then it is slow because it was long at one part [ns].
    slow_until_ns: u64,
    slow_by: Option<Evidence>,
    sweep_flood: SweepFlood,
    event_flood: EventFlood,
}

impl Patient {
    /// What is the matter with it.
    pub(crate) fn ailment(&self) -> Option<Ailment> {
        self.ailment
    }

    /// Looks at its signs. One condition at a time: the gravest.
    pub(crate) fn look(
        &mut self,
        now_ns: u64,
        signs: &Signs,
        (sectors, is_source): (u64, bool),
        (times, health): (&Times, &HealthFile),
    ) -> Option<Change> {
        if signs.told {
            // The process after the one that was told is no sign of a death.
            *self = Self { processes: signs.processes + 1, ..Self::default() };
            return None;
        }
        if !signs.up {
            return self.absent(now_ns, signs);
        }
        if !self.was_up || signs.life != self.life {
            self.begin(now_ns, signs, sectors);
        }
        let found = self.judge(now_ns, signs, (sectors, is_source), (times, health));
        self.note(now_ns, found)
    }

    /// No process of it is connected: it died, or comes up for the first time.
    fn absent(&mut self, now_ns: u64, signs: &Signs) -> Option<Change> {
        let died = self.was_up || (self.processes > 0 && signs.processes > self.processes);
        let process = if self.was_up { signs.processes.min(self.processes) } else { self.processes };
        if died || !signs.starts {
            self.starts_ns = None;
        }
        self.was_up = false;
        self.processes = signs.processes;
        let for_ns = signs.starts.then(|| now_ns.saturating_sub(*self.starts_ns.get_or_insert(now_ns)));
        if let Some(for_ns) = for_ns.filter(|for_ns| *for_ns >= START_NS) {
            return self.note(now_ns, Some((Condition::Hung, Evidence::NotUp { for_ns })));
        }
        if !died {
            return None;
        }
        self.note(now_ns, Some((Condition::Dead, Evidence::Ended { process })))
    }

    /// A life of it is connected: nothing that was before counts.
    fn begin(&mut self, now_ns: u64, signs: &Signs, sectors: u64) {
        let sweeps = signs.parts / sectors.max(1);
        *self = Self {
            ailment: self.ailment,
            was_up: true,
            processes: signs.processes,
            life: signs.life,
            overruns: Overruns::begin(sweeps, signs.overruns),
            sweep_flood: SweepFlood::begin(now_ns, signs.parts as f64 / sectors.max(1) as f64),
            event_flood: EventFlood::begin(now_ns, signs.said),
            ..Self::default()
        };
    }

    fn judge(
        &mut self,
        now_ns: u64,
        signs: &Signs,
        (sectors, is_source): (u64, bool),
        (times, health): (&Times, &HealthFile),
    ) -> Option<(Condition, Evidence)> {
        let sectors = sectors.max(1);
        // All are asked, whatever the first says: each remembers.
        let pulse = self.pulse.look(now_ns, signs, times);
        let silent = self.waiting.look(now_ns, signs, times);
        let of_ten = self.overruns.look(signs.parts / sectors, signs.overruns, health.slow_overruns);
        let (sweeps, period_ns) = (signs.parts as f64 / sectors as f64, times.period_ns);
        let sweeps = self.sweep_flood.look(now_ns, sweeps, period_ns, health.flood_ratio);
        let events = self.event_flood.look(now_ns, signs.said, health.flood_events_per_s);

        if let Some((Condition::Slow, by)) = pulse {
            (self.slow_until_ns, self.slow_by) = (now_ns + SLOW_SWEEPS * period_ns, Some(by));
        }
        let slow = of_ten.map(|of_ten| Evidence::Overruns { of_ten });
        let slow = self.slow_by.filter(|_| now_ns < self.slow_until_ns).or(slow);
        let flood = sweeps.filter(|_| is_source && times.paced);
        let flood = flood.map(|sweeps| Evidence::TooManySweeps { sweeps: sweeps as u64 });
        let flood = flood.or(events.map(|events| Evidence::TooManyEvents { events: events as u64 }));
        pulse
            .or(silent.map(|evidence| (Condition::Silent, evidence)))
            .or(slow.map(|evidence| (Condition::Slow, evidence)))
            .or(flood.map(|evidence| (Condition::Flooding, evidence)))
    }

    /// Whether what was found is new.
    fn note(&mut self, now_ns: u64, found: Option<(Condition, Evidence)>) -> Option<Change> {
        let before = self.ailment.map(|ailment| ailment.condition);
        if before == found.map(|(condition, _)| condition) {
            return None;
        }
        let ended = self.ailment.take();
        if let Some((condition, evidence)) = found {
            self.ailment = Some(Ailment { condition, since_ns: now_ns });
            return Some(Change::Began(condition, evidence));
        }
        ended.map(|ailment| Change::Ended(ailment.condition, now_ns.saturating_sub(ailment.since_ns)))
    }
}

#[cfg(test)]
mod tests;
