//! How a stage that died is started again: as configured within its budget, then with less and less that could be at fault,
//! then not at all. No path leads to an endless restart loop.

use chain::RestartBudget;
use runtime::page::Tier;

use crate::restarts::budget::Restarts;

/// Lives that a stage has at each tier below the configured one within the window, before the next is tried.
pub(crate) const LOWER_LIVES: u32 = 3;

/// What becomes of a stage that died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum After {
    /// It is started again as it was.
    Again,
    /// It is started again at this tier.
    Down(Tier),
    /// It is not started any more.
    GivenUp,
}

/// The lives of one stage.
pub(crate) struct Lives {
    tier: Tier,
    budget: RestartBudget,
    /// Restarts below the configured tier.
    lower: Restarts,
    has_stand_in: bool,
    excused: bool,
    given_up: bool,
}

impl Lives {
    /// A source has no stand-in.
    pub(crate) fn new(budget: RestartBudget, has_stand_in: bool) -> Self {
        Self {
            tier: Tier::Configured,
            budget,
            lower: Self::lower(budget),
            has_stand_in,
            excused: false,
            given_up: false,
        }
    }

    fn lower(budget: RestartBudget) -> Restarts {
        Restarts::new(RestartBudget { restarts: LOWER_LIVES - 1, window_s: budget.window_s })
    }

    /// Goes on at a tier, where one supervisor follows another.
    pub(crate) fn take_over(&mut self, tier: Tier) {
        self.tier = tier;
    }

    /// Which build its next life is.
    pub(crate) fn tier(&self) -> Tier {
        self.tier
    }

    pub(crate) fn is_given_up(&self) -> bool {
        self.given_up
    }

    /// Its next death was wanted and counts for nothing.
    pub(crate) fn excuse(&mut self) {
        self.excused = true;
    }

    /// Another chance: as configured, with a fresh budget.
    pub(crate) fn renew(&mut self) {
        (self.tier, self.given_up) = (Tier::Configured, false);
        self.lower.forget();
    }

    /// It died at host time `now_ns`; `refused` says that it could not start. `configured` is its budget as configured.
    pub(crate) fn died(&mut self, configured: &mut Restarts, now_ns: u64, refused: bool) -> After {
        let was_wanted = std::mem::take(&mut self.excused);
        let budget = if self.tier == Tier::Configured { configured } else { &mut self.lower };
        if !refused && (was_wanted || budget.allow(now_ns)) {
            return After::Again;
        }
        let next = match self.tier {
            Tier::Configured => Some(Tier::BuiltIn),
            Tier::BuiltIn if self.has_stand_in => Some(Tier::StandIn),
            Tier::BuiltIn | Tier::StandIn => None,
        };
        self.lower = Self::lower(self.budget);
        match next {
            Some(tier) => {
                self.tier = tier;
                After::Down(tier)
            }
            None => {
                self.given_up = true;
                After::GivenUp
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUDGET: RestartBudget = RestartBudget { restarts: 2, window_s: 1.0 };

    /// Dies at once, again and again, until it is given up; what became of it each time.
    fn crash_loop(sut: &mut Lives, configured: &mut Restarts, refused: bool) -> Vec<After> {
        let mut all = Vec::new();
        while all.last() != Some(&After::GivenUp) {
            all.push(sut.died(configured, 0, refused));
            assert!(all.len() < 100, "endless");
        }
        all
    }

    #[test]
    fn a_crash_loop_has_a_bounded_number_of_lives_at_each_tier() {
        let (mut sut, mut configured) = (Lives::new(BUDGET, true), Restarts::new(BUDGET));
        let again = [After::Again; 2];
        let expected =
            [&again[..], &[After::Down(Tier::BuiltIn)], &again, &[After::Down(Tier::StandIn)], &again].concat();
        let all = crash_loop(&mut sut, &mut configured, false);
        assert_eq!(all[..expected.len()], expected);
        assert_eq!(all.len(), expected.len() + 1);
        assert!(sut.is_given_up());
    }

    #[test]
    fn what_cannot_start_is_tried_once_at_each_tier_and_a_source_has_no_stand_in() {
        let (mut sut, mut configured) = (Lives::new(BUDGET, true), Restarts::new(BUDGET));
        let expected = [After::Down(Tier::BuiltIn), After::Down(Tier::StandIn), After::GivenUp];
        assert_eq!(crash_loop(&mut sut, &mut configured, true), expected);
        let (mut sut, mut configured) = (Lives::new(BUDGET, false), Restarts::new(BUDGET));
        assert_eq!(crash_loop(&mut sut, &mut configured, true), [After::Down(Tier::BuiltIn), After::GivenUp]);
    }

    #[test]
    fn a_death_that_was_wanted_counts_for_nothing_once() {
        let (mut sut, mut configured) = (Lives::new(BUDGET, true), Restarts::new(BUDGET));
        for _ in 0..100 {
            sut.excuse();
            assert_eq!(sut.died(&mut configured, 0, false), After::Again);
        }
        assert_eq!(crash_loop(&mut sut, &mut configured, false).len(), 9);
    }

    #[test]
    fn another_chance_is_a_whole_one() {
        let (mut sut, mut configured) = (Lives::new(BUDGET, true), Restarts::new(BUDGET));
        crash_loop(&mut sut, &mut configured, false);
        sut.renew();
        configured.forget();
        assert_eq!((sut.tier(), sut.is_given_up()), (Tier::Configured, false));
        assert_eq!(crash_loop(&mut sut, &mut configured, false).len(), 9);
    }
}
