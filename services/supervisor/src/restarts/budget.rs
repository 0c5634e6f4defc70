use std::collections::VecDeque;

use chain::RestartBudget;
use chain::executive::ChainBudgetFile;

/// Restarts of one stage within a sliding window.
pub(crate) struct Restarts {
    budget: RestartBudget,
    recent_ns: VecDeque<u64>,
    /// Restarts so far.
    pub(crate) total: u64,
}

impl Restarts {
    pub(crate) fn new(budget: RestartBudget) -> Self {
        Self { budget, recent_ns: VecDeque::new(), total: 0 }
    }

    /// Of all stages together.
    pub(crate) fn of_chain(budget: ChainBudgetFile) -> Self {
        Self::new(RestartBudget { restarts: budget.restarts, window_s: budget.window_s })
    }

    /// Begins anew: what was allowed so far does not count any more.
    pub(crate) fn forget(&mut self) {
        self.recent_ns.clear();
    }

    /// Whether one more restart is allowed at host time `now_ns`; if so it is counted.
    pub(crate) fn allow(&mut self, now_ns: u64) -> bool {
        let window_ns = (self.budget.window_s * 1e9) as u64;
        while self.recent_ns.front().is_some_and(|&then_ns| now_ns.saturating_sub(then_ns) > window_ns) {
            self.recent_ns.pop_front();
        }
        if self.recent_ns.len() >= self.budget.restarts as usize {
            return false;
        }
        self.recent_ns.push_back(now_ns);
        self.total += 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_per_window_and_never_more() {
        let mut sut = Restarts::new(RestartBudget { restarts: 2, window_s: 1.0 });
        assert!(sut.allow(0));
        assert!(sut.allow(500_000_000));
        assert!(!sut.allow(900_000_000));
        assert!(sut.allow(1_100_000_000), "the first has left the window");
        assert!(!sut.allow(1_200_000_000));
        assert_eq!(sut.total, 3);
    }

    #[test]
    fn no_restarts_means_none() {
        assert!(!Restarts::new(RestartBudget { restarts: 0, window_s: 1.0 }).allow(0));
    }
}
