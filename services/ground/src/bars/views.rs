//! What a plan looks at.

use super::plan::{BudgetPlan, EvaluationPlan};
use crate::{Described, Files, ObserveError, Observer, View};

/// The distribution, and the same with one thing changed.
pub(crate) struct Views {
    pub(crate) reference: View,
    pub(crate) noisy: View,
    pub(crate) dropouts: View,
    pub(crate) flat: View,
    pub(crate) dense: View,
}

impl Views {
    pub(crate) fn of(plan: &EvaluationPlan) -> Self {
        let variants = &plan.variants;
        let reference = View::of(&plan.scene);
        Self {
            noisy: View { range_sigma_m: Some(variants.range_sigma_m), ..reference.clone() },
            dropouts: View { dropout: Some(variants.dropout), ..reference.clone() },
            flat: View { proportion: Some(variants.proportion), ..reference.clone() },
            dense: View { sensor: Some(variants.dense_sensor.clone()), ..reference.clone() },
            reference,
        }
    }
}

/// The distribution with another budget for a fit.
pub(crate) fn budgeted(plan: &EvaluationPlan, evaluations: u64) -> View {
    View { evaluations: Some(evaluations), ..View::of(&plan.scene) }
}

/// What fits are timed on.
pub(crate) fn timed(scene: &str, evaluations: Option<u64>) -> View {
    View { described: Described::Solids, evaluations, ..View::of(scene) }
}

/// Builds an observer of everything once, so that what cannot be seen is known before any work.
pub(crate) fn check(plan: &EvaluationPlan, read: Files<'_>) -> Result<(), ObserveError> {
    let Views { reference, noisy, dropouts, flat, dense } = Views::of(plan);
    let BudgetPlan { evaluations, .. } = &plan.budget;
    let moving = View::of(&plan.sweeps.scene);
    let views = [reference, noisy, dropouts, flat, dense, moving, timed(&plan.fit.scene, None)];
    let budgets = evaluations.iter().map(|&evaluations| budgeted(plan, evaluations));
    views.into_iter().chain(budgets).try_for_each(|view| Observer::new(&view, &read).map(drop))
}
