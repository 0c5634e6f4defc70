//! The ladder of overload: how much the chain leaves out, decided from what the pages count.

use std::collections::VecDeque;

use chain::Overload;
use messages::Step;
use runtime::page::Page;
use serde::{Deserialize, Serialize};

/// Most steps that a report keeps by name; later ones are only counted.
const MAX_MOVES: usize = 100;
/// Most that the time without trouble before a step back is multiplied by.
const MOST_PATIENCE: u32 = 16;

/// A step taken or taken back.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Move {
    /// First sweep that the source may have sent at the new step.
    pub sweep: u64,
    /// The step before.
    pub from: String,
    /// The step from here on.
    pub to: String,
    /// What the trouble was, or that there was none.
    pub reason: String,
}

/// What was left out in a run.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct OverloadReport {
    /// Sweeps on which a stage was busy for longer than its budget, by stage.
    pub overruns: std::collections::BTreeMap<String, u64>,
    /// Parts that were waiting when the stage had finished the one before, by stage.
    pub slips: std::collections::BTreeMap<String, u64>,
    /// The first hundred moves on the ladder.
    pub moves: Vec<Move>,
    /// All moves.
    pub move_count: u64,
}

/// What the pages have counted so far that tells of overload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Trouble {
    pub(crate) overruns: u64,
    pub(crate) late: u64,
    pub(crate) dropped: u64,
    pub(crate) stale: u64,
}

impl Trouble {
    /// Adds up the pages of all stages.
    pub(crate) fn of<'a>(pages: impl Iterator<Item = &'a Page>) -> Self {
        pages.fold(Self::default(), |sum, page| Self {
            overruns: sum.overruns + page.overruns.get(),
            late: sum.late + page.late.get(),
            dropped: sum.dropped + page.dropped.get(),
            stale: sum.stale + page.rejected[messages::Verdict::RejectedStale as usize].get(),
        })
    }

    fn since(self, before: Self) -> Self {
        Self {
            overruns: self.overruns.saturating_sub(before.overruns),
            late: self.late.saturating_sub(before.late),
            dropped: self.dropped.saturating_sub(before.dropped),
            stale: self.stale.saturating_sub(before.stale),
        }
    }

    fn any(self) -> bool {
        self != Self::default()
    }
}

/// Where on the ladder the chain stands.
pub(crate) struct Ladder {
    config: Overload,
    /// Steps taken: 0 is nominal, `n` the n-th of the configured ones.
    taken: usize,
    /// Whether each of the last sweeps was in trouble.
    recent: VecDeque<bool>,
    /// Sweeps without trouble in a row.
    calm_sweeps: u32,
    /// What `recover_sweeps` is multiplied by.
    patience: u32,
    /// Whether the last move was a step back.
    stepped_back: bool,
    sweep: u64,
    seen: Trouble,
    /// What has been counted since the last move.
    since_move: Trouble,
    at_move: Trouble,
}

impl Ladder {
    pub(crate) fn new(config: Overload) -> Self {
        Self {
            config,
            taken: 0,
            recent: VecDeque::new(),
            calm_sweeps: 0,
            patience: 1,
            stepped_back: false,
            sweep: 0,
            seen: Trouble::default(),
            since_move: Trouble::default(),
            at_move: Trouble::default(),
        }
    }

    /// Goes on at `step`, where one supervisor follows another; `sweeps` have been sent by now, and `trouble` is counted.
    pub(crate) fn resume(&mut self, step: Step, sweeps: u64, trouble: Trouble) {
        self.taken = self.config.steps.iter().position(|&number| number == step as u32).map_or(0, |place| place + 1);
        (self.sweep, self.seen, self.at_move) = (sweeps, trouble, trouble);
    }

    /// The step in force.
    pub(crate) fn step(&self) -> Step {
        match self.taken {
            0 => Step::Nominal,
            taken => Step::from_number(self.config.steps.get(taken - 1).copied().unwrap_or_default()),
        }
    }

    /// Looks at what has been counted by the time that `sweeps` have been sent. Trouble is charged to the sweeps sent
    /// since the last look. Gives a move when there is one.
    pub(crate) fn look(&mut self, sweeps: u64, trouble: Trouble) -> Option<Move> {
        let passed = sweeps.saturating_sub(self.sweep);
        if passed == 0 {
            return None;
        }
        let troubled = trouble.since(self.seen).any();
        (self.sweep, self.seen) = (sweeps, trouble);
        self.since_move = trouble.since(self.at_move);
        for _ in 0..passed.min(u64::from(self.config.within_sweeps)) {
            if self.recent.len() == self.config.within_sweeps as usize {
                self.recent.pop_front();
            }
            self.recent.push_back(troubled);
        }
        self.calm_sweeps = if troubled { 0 } else { self.calm_sweeps.saturating_add(passed as u32) };
        let count = self.recent.iter().filter(|&&troubled| troubled).count() as u32;
        if count >= self.config.troubled_sweeps && self.taken < self.config.steps.len() {
            // Stepped back too early: be more patient the next time.
            self.patience = if self.stepped_back { (2 * self.patience).min(MOST_PATIENCE) } else { self.patience };
            let Trouble { overruns, late, dropped, stale } = self.since_move;
            let reason = format!("{overruns} overruns, {late} late sweeps, {dropped} parts dropped, {stale} stale");
            return Some(self.go(self.taken + 1, reason));
        }
        let calm = self.config.recover_sweeps.saturating_mul(self.patience);
        if self.taken > 0 && self.calm_sweeps >= calm {
            return Some(self.go(self.taken - 1, format!("{calm} sweeps without trouble")));
        }
        if self.taken == 0 && self.calm_sweeps >= calm {
            (self.patience, self.stepped_back) = (1, false);
        }
        None
    }

    /// One step down, whatever the pages count; none where it stands on the last one.
    pub(crate) fn step_down(&mut self, reason: &str) -> Option<Move> {
        (self.taken < self.config.steps.len()).then(|| self.go(self.taken + 1, reason.to_owned()))
    }

    fn go(&mut self, to: usize, reason: String) -> Move {
        let from = self.step();
        self.stepped_back = to < self.taken;
        self.taken = to;
        self.recent.clear();
        self.calm_sweeps = 0;
        self.at_move = self.seen;
        Move { sweep: self.sweep, from: from.name().to_owned(), to: self.step().name().to_owned(), reason }
    }
}

impl OverloadReport {
    /// Notes a move.
    pub(crate) fn note(&mut self, step: Move) {
        self.move_count += 1;
        if self.moves.len() < MAX_MOVES {
            self.moves.push(step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sut() -> Ladder {
        let steps = [Step::FewerStarts, Step::ClustersOnly].map(|step| step as u32).to_vec();
        Ladder::new(Overload { steps, troubled_sweeps: 3, within_sweeps: 5, recover_sweeps: 10 })
    }

    /// Lets sweeps pass, in trouble or not; the steps in force after each.
    fn pass(sut: &mut Ladder, troubled: impl IntoIterator<Item = bool>) -> Vec<Step> {
        let step = |troubled: bool| {
            let seen = sut.seen;
            sut.look(sut.sweep + 1, Trouble { overruns: seen.overruns + u64::from(troubled), ..seen });
            sut.step()
        };
        troubled.into_iter().map(step).collect()
    }

    #[test]
    fn a_step_is_taken_on_sustained_trouble_alone() {
        let mut sut = sut();
        let steps = pass(&mut sut, [true, false, false, true, false, false, true, false, false]);
        assert!(steps.iter().all(|&step| step == Step::Nominal), "never three of five");
        assert_eq!(pass(&mut sut, [true, true]), [Step::Nominal, Step::FewerStarts], "with the one three sweeps ago");
        assert_eq!(pass(&mut sut, [true, true, true])[1..], [Step::FewerStarts, Step::ClustersOnly]);
        assert_eq!(pass(&mut sut, [true; 20]).last(), Some(&Step::ClustersOnly), "the last step is the last");
    }

    #[test]
    fn steps_are_taken_back_one_by_one_and_more_slowly_where_that_proved_too_early() {
        let mut sut = sut();
        pass(&mut sut, [true; 6]);
        assert_eq!(sut.step(), Step::ClustersOnly);
        assert_eq!(pass(&mut sut, [false; 10])[8..], [Step::ClustersOnly, Step::FewerStarts]);
        assert_eq!(pass(&mut sut, [true; 3]).last(), Some(&Step::ClustersOnly), "too early");
        assert_eq!(pass(&mut sut, [false; 20])[18..], [Step::ClustersOnly, Step::FewerStarts]);
        assert_eq!(pass(&mut sut, [false; 20])[18..], [Step::FewerStarts, Step::Nominal]);
        pass(&mut sut, [false; 20]);
        pass(&mut sut, [true; 3]);
        assert_eq!(pass(&mut sut, [false; 10]).last(), Some(&Step::Nominal), "patience is forgotten when all is well");
    }

    #[test]
    fn a_step_that_is_asked_for_is_taken_back_like_any_other() {
        let mut sut = sut();
        assert_eq!(sut.step_down("a rule").unwrap().reason, "a rule");
        assert!(sut.step_down("again").is_some() && sut.step_down("and again").is_none());
        assert_eq!(pass(&mut sut, [false; 20]).last(), Some(&Step::Nominal));
    }

    #[test]
    fn without_steps_trouble_moves_nothing() {
        let mut sut = Ladder::new(Overload { steps: vec![], ..sut().config });
        assert!(pass(&mut sut, [true; 30]).iter().all(|&step| step == Step::Nominal));
    }

    #[test]
    fn a_move_says_what_the_trouble_was() {
        let mut sut = sut();
        let trouble = |n| Trouble { late: n, dropped: 2 * n, ..Trouble::default() };
        assert_eq!(sut.look(1, trouble(1)), None);
        assert_eq!(sut.look(2, trouble(2)), None);
        let taken = sut.look(3, trouble(3)).unwrap();
        assert_eq!((taken.sweep, taken.from.as_str(), taken.to.as_str()), (3, "nominal", "fewer-starts"));
        assert_eq!(taken.reason, "0 overruns, 3 late sweeps, 6 parts dropped, 0 stale");
    }
}
