//! Models without files: trained, and judged on what they have not seen.

use classifier::{NaiveBayes, Svm};
use lidar::ObstacleClass;

use crate::fit_svm::{self, Rounding};
use crate::{Confusion, Example, SvmPlan};

/// A machine and how it came about.
pub(crate) struct Machine {
    pub(crate) svm: Svm,
    pub(crate) c: f64,
}

impl Machine {
    /// Chooses C by cross-validation on the first of each class, then trains on all.
    pub(crate) fn fit(examples: &[Example], plan: &SvmPlan, folds: usize, rounding: Rounding) -> Self {
        let subset = fit_svm::first_of_each_class(examples, plan.subset);
        let tried: Vec<(f64, f64)> =
            plan.c.iter().map(|&c| (c, fit_svm::cross_validated(&subset, plan.gamma, c, folds, rounding))).collect();
        let all: Vec<&Example> = examples.iter().collect();
        Self::train(&all, plan.gamma, fit_svm::best_c(&tried), rounding)
    }

    /// Trains with this C.
    pub(crate) fn train(examples: &[&Example], gamma: f64, c: f64, rounding: Rounding) -> Self {
        Self { svm: Svm::new(&fit_svm::train_on(examples, gamma, c, rounding)), c }
    }

    /// The verdict on a described cluster.
    pub(crate) fn verdict(&self, example: &Example) -> ObstacleClass {
        ObstacleClass::SOLIDS[fit_svm::solid_of(&self.svm, &self.svm.decide(&example.bins))]
    }
}

/// Naive Bayes' verdict on a described cluster.
pub(crate) fn likeliest(model: &NaiveBayes, example: &Example) -> ObstacleClass {
    let posterior = model.posterior(&example.bins);
    ObstacleClass::SOLIDS[(1..4).fold(0, |most, q| if posterior[q] > posterior[most] { q } else { most })]
}

/// Counts verdicts; a cluster without features is unclassified.
pub(crate) fn confusion<'a>(
    examples: impl IntoIterator<Item = &'a Example>,
    verdict: impl Fn(&Example) -> ObstacleClass,
) -> Confusion {
    let mut confusion = Confusion::default();
    for example in examples {
        let said = if example.bins.is_empty() { ObstacleClass::Unclassified } else { verdict(example) };
        confusion.count(example.class, said);
    }
    confusion
}
