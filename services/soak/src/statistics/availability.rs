//! Which sweeps that were due were answered, and in time.
//!
//! A sweep is due at its last return. The source goes by a period, so that a distance of several periods between two answered
//! sweeps' due times says how many were not answered between them, whoever lost them or did not send them.

use serde::{Deserialize, Serialize};

/// One sweep that came to its end at the sink.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Answer {
    /// Host time of its last return [ns].
    pub(crate) due_ns: u64,
    /// Host time at which the sink had it [ns].
    pub(crate) answered_ns: u64,
    /// From its last return to its last detection sent [ns].
    pub(crate) latency_ns: u64,
    /// Whether nothing of it was lost, dropped or rejected.
    pub(crate) whole: bool,
}

/// A count of sweeps.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Tally {
    /// Sweeps due.
    pub due: u64,
    /// Answered, whole and within the deadline.
    pub in_time: u64,
    /// Answered whole, after the deadline.
    pub late: u64,
    /// Answered with parts missing or rejected.
    pub broken: u64,
    /// Not answered.
    pub missing: u64,
}

impl Tally {
    /// Share of the sweeps due that were answered whole and in time [%]; none where none was due.
    pub fn availability_pct(&self) -> Option<f64> {
        (self.due > 0).then(|| 100.0 * self.in_time as f64 / self.due as f64)
    }

    fn add(&mut self, fate: Fate) {
        self.due += 1;
        match fate {
            Fate::InTime => self.in_time += 1,
            Fate::Late => self.late += 1,
            Fate::Broken => self.broken += 1,
            Fate::Missing => self.missing += 1,
        }
    }
}

/// What became of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    InTime,
    Late,
    Broken,
    Missing,
}

/// Stretches of time, in order of their begin. The last may still go on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Exclusions {
    spans: Vec<(u64, u64)>,
}

impl Exclusions {
    /// A stretch begins at `from_ns`; it ends when [`Self::end_last`] says so.
    pub(crate) fn begin(&mut self, from_ns: u64) {
        self.spans.push((from_ns, u64::MAX));
    }

    /// The last stretch that began ends at `until_ns`.
    pub(crate) fn end_last(&mut self, until_ns: u64) {
        if let Some(last) = self.spans.last_mut() {
            last.1 = until_ns;
        }
    }

    /// A stretch from begin to end.
    pub(crate) fn add(&mut self, from_ns: u64, until_ns: u64) {
        self.spans.push((from_ns, until_ns));
    }

    /// Whether any stretch has a moment in common with `from_ns..=until_ns`. Of very many, the latest are looked at.
    pub(crate) fn touches(&self, from_ns: u64, until_ns: u64) -> bool {
        self.spans.iter().rev().take(256).any(|(from, until)| *from <= until_ns && *until >= from_ns)
    }
}

/// The account of all sweeps due.
#[derive(Clone, Debug)]
pub(crate) struct Availability {
    period_ns: u64,
    deadline_ns: u64,
    last_due_ns: Option<u64>,
    run: u64,
    /// Longest row of sweeps that were late, broken or missing.
    pub(crate) longest_run: u64,
    /// All sweeps due.
    pub(crate) overall: Tally,
    /// Those that no stretch given to [`Self::answer`] as `first` touches.
    pub(crate) outside_first: Tally,
    /// The same of `second`.
    pub(crate) outside_second: Tally,
}

impl Availability {
    /// Of sweeps that are due each `period_ns` and must be answered within `deadline_ns`.
    pub(crate) fn new(period_ns: u64, deadline_ns: u64) -> Self {
        Self {
            period_ns: period_ns.max(1),
            deadline_ns,
            last_due_ns: None,
            run: 0,
            longest_run: 0,
            overall: Tally::default(),
            outside_first: Tally::default(),
            outside_second: Tally::default(),
        }
    }

    /// Host time from one sweep to the next [ns].
    pub(crate) fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Adds a sweep that came to its end, after those that were due before it and did not. Nothing is due in `paused` time. Gives
    /// the number of sweeps that were not answered as they should, this one included.
    pub(crate) fn answer(
        &mut self,
        answer: &Answer,
        paused: &Exclusions,
        first: &Exclusions,
        second: &Exclusions,
    ) -> u64 {
        let misses = self.missing_before(answer.due_ns, paused, first, second);
        self.last_due_ns = Some(answer.due_ns);
        let fate = match answer {
            Answer { whole: false, .. } => Fate::Broken,
            answer if answer.latency_ns > self.deadline_ns => Fate::Late,
            _ => Fate::InTime,
        };
        let until_ns = answer.due_ns + self.deadline_ns;
        self.count(fate, !first.touches(answer.due_ns, until_ns), !second.touches(answer.due_ns, until_ns));
        misses + u64::from(fate != Fate::InTime)
    }

    /// The chain was asked to end at `at_ns`: what was due a deadline before that has no answer any more.
    pub(crate) fn end(&mut self, at_ns: u64, paused: &Exclusions, first: &Exclusions, second: &Exclusions) -> u64 {
        self.missing_before(at_ns.saturating_sub(self.deadline_ns), paused, first, second)
    }

    fn missing_before(&mut self, due_ns: u64, paused: &Exclusions, first: &Exclusions, second: &Exclusions) -> u64 {
        let Some(mut due) = self.last_due_ns else { return 0 };
        let mut missing = 0;
        // A successor of the source begins at any phase: half a period is none.
        while due + self.period_ns + self.period_ns / 2 < due_ns {
            due += self.period_ns;
            if paused.touches(due.saturating_sub(self.period_ns), due) {
                continue;
            }
            missing += 1;
            let until_ns = due + self.deadline_ns;
            self.count(Fate::Missing, !first.touches(due, until_ns), !second.touches(due, until_ns));
        }
        self.last_due_ns = Some(due);
        missing
    }

    fn count(&mut self, fate: Fate, outside_first: bool, outside_second: bool) {
        self.overall.add(fate);
        if outside_first {
            self.outside_first.add(fate);
        }
        if outside_second {
            self.outside_second.add(fate);
        }
        self.run = if fate == Fate::InTime { 0 } else { self.run + 1 };
        self.longest_run = self.longest_run.max(self.run);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn answer(due_ms: u64, latency_ms: u64) -> Answer {
        let (due_ns, latency_ns) = (due_ms * MS, latency_ms * MS);
        Answer { due_ns, answered_ns: due_ns + latency_ns, latency_ns, whole: true }
    }

    fn of(answers: &[Answer], paused: &Exclusions, first: &Exclusions) -> Availability {
        let mut sut = Availability::new(100 * MS, 100 * MS);
        for answer in answers {
            sut.answer(answer, paused, first, &Exclusions::default());
        }
        sut
    }

    #[test]
    fn what_lies_between_two_answers_was_due_and_is_missing() {
        let answers = [answer(1000, 5), answer(1101, 5), answer(1500, 120), answer(1600, 5)];
        let none = Exclusions::default();
        let sut = of(&answers, &none, &none);
        let expected = Tally { due: 7, in_time: 3, late: 1, broken: 0, missing: 3 };
        assert_eq!((sut.overall, sut.longest_run), (expected, 4));
        assert_eq!(sut.outside_first, sut.overall);
    }

    #[test]
    fn a_source_that_comes_back_at_another_phase_owes_no_more_than_whole_periods() {
        let none = Exclusions::default();
        assert_eq!(of(&[answer(0, 5), answer(149, 5)], &none, &none).overall.missing, 0);
        assert_eq!(of(&[answer(0, 5), answer(240, 5)], &none, &none).overall.missing, 1);
    }

    #[test]
    fn nothing_is_due_while_the_chain_is_paused() {
        let mut paused = Exclusions::default();
        paused.begin(1050 * MS);
        paused.end_last(2930 * MS);
        let sut = of(&[answer(1000, 5), answer(3000, 5), answer(3100, 5)], &paused, &Exclusions::default());
        assert_eq!((sut.overall.due, sut.overall.missing), (3, 0));
    }

    #[test]
    fn sweeps_on_their_way_when_a_fault_comes_are_its_own() {
        let mut fault = Exclusions::default();
        fault.add(1050 * MS, 1500 * MS);
        let answers = [answer(900, 5), answer(1000, 480), answer(1600, 5)];
        let sut = of(&answers, &Exclusions::default(), &fault);
        // 1000 was due before the fault, and had until 1100; 1100 to 1500 are missing within it.
        assert_eq!(sut.outside_first, Tally { due: 2, in_time: 2, ..Tally::default() });
        assert_eq!((sut.overall.due, sut.overall.missing, sut.overall.late), (8, 5, 1));
    }

    #[test]
    fn what_was_due_before_the_end_and_never_came_is_missing() {
        let none = Exclusions::default();
        let mut sut = of(&[answer(1000, 5)], &none, &none);
        assert_eq!(sut.end(1150 * MS, &none, &none, &none), 0);
        assert_eq!(sut.end(1500 * MS, &none, &none, &none), 3);
        assert_eq!(Tally::default().availability_pct(), None);
    }
}
