//! Accuracy and time against the residuals that a fit may evaluate.

use super::EvaluateError;
use super::fit_time::{Clock, FitTime};
use super::plan::EvaluationPlan;
use super::share::Share;
use super::tally::Tally;
use super::views;
use super::witness::{Judges, scenes};
use crate::Files;

/// One budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BudgetPoint {
    /// The extractor's `fit.evaluations`.
    pub evaluations: u64,
    /// Right of the clusters of at least 5 points.
    pub all: Share,
    /// Right of those of at least 50.
    pub large: Share,
    /// What a fit takes.
    pub time: FitTime,
}

/// Accuracy on all cores; times are still to be [`timed`].
pub(crate) fn judged(
    plan: &EvaluationPlan,
    evaluations: u64,
    read: Files<'_>,
    judges: Judges<'_>,
) -> Result<BudgetPoint, EvaluateError> {
    let view = views::budgeted(plan, evaluations);
    let tally = Tally::of(&scenes(plan, &view, plan.budget.scenes, read, judges)?);
    Ok(BudgetPoint { evaluations, all: tally.all, large: tally.large(), time: FitTime::default() })
}

/// Adds the times, on one thread.
pub(crate) fn timed(
    plan: &EvaluationPlan,
    point: BudgetPoint,
    read: Files<'_>,
    clock: Clock<'_>,
) -> Result<BudgetPoint, EvaluateError> {
    Ok(BudgetPoint { time: FitTime::measure(&plan.fit, Some(point.evaluations), read, clock)?, ..point })
}
