//! The configured classifier against declared bars, from one plan.

pub(crate) mod bar;
mod budget;
pub(crate) mod charts;
mod claims;
mod fit_time;
pub(crate) mod json;
mod judged;
pub(crate) mod page;
mod page_plots;
mod plan;
mod share;
mod solid_error;
mod summed;
pub(crate) mod table;
mod tally;
#[cfg(test)]
mod tests;
mod views;
mod witness;

use messages::Verdict;

pub use bar::{Bar, Measure, Sense, Standing};
pub use budget::BudgetPoint;
pub use claims::Claims;
pub use fit_time::{Clock, FitTime};
pub use json::EvaluationNote;
pub use plan::{BudgetPlan, EvaluationPlan, EvaluationPlanError, FitPlan, SweepsPlan, VariantsPlan};
pub use share::Share;
pub(crate) use share::quantile;
pub use summed::Summed;
pub use tally::{SolidErrors, Tally, Threshold};
pub(crate) use witness::Witness;
pub use witness::{Judge, Judges};

use crate::{Files, ObserveError, Progress, View};
use views::Views;

/// All that was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// What was looked at.
    pub plan: EvaluationPlan,
    /// The distribution itself.
    pub reference: Tally,
    /// With more noise.
    pub noisy: Tally,
    /// With lost echoes.
    pub dropouts: Tally,
    /// With flatter and slimmer bodies.
    pub flat: Tally,
    /// Seen by a sensor of many columns.
    pub dense: Tally,
    /// Evidence summed over sweeps.
    pub summed: Summed,
    /// What a fit takes.
    pub fit: FitTime,
    /// Accuracy and time against the fit's budget.
    pub budget: Vec<BudgetPoint>,
    /// What is claimed of a recording, if one was given.
    pub claims: Option<Claims>,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// The plan does not hold.
    #[error(transparent)]
    Plan(#[from] EvaluationPlanError),
    /// A scene cannot be observed, or one of its files cannot be read.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The classifier would not take what the extractor gave.
    #[error("classifier: {}, must take what the extractor gives", .0.name())]
    Rejected(Verdict),
    /// The tracker would not take what the classifier gave, or gave no tracks at a sweep's end.
    #[error("tracker: {}, must take what the classifier gives, with tracks at each sweep's end", .0.name())]
    Tracker(Verdict),
    /// The tracker does not look as far ahead as encounters are judged.
    #[error("encounters.lead_s is {lead_s}, must be at most the tracker's horizon, {horizon_s}")]
    Horizon {
        /// The plan's.
        lead_s: f64,
        /// The tracker's.
        horizon_s: f64,
    },
    /// The recording cannot be read on.
    #[error("{0}")]
    Recording(String),
    /// A message needs some megabytes.
    #[error("no memory for a message")]
    NoMemory,
}

impl Evaluation {
    /// Measures the classifiers that `judges` makes, on all cores, and fits' times on one. The same plan, files and
    /// classifier give the same results, but for times.
    ///
    /// # Errors
    /// A plan or a file that does not hold, or a classifier that does not take what the extractor gives.
    pub fn measure(
        plan: &EvaluationPlan,
        read: Files<'_>,
        judges: Judges<'_>,
        clock: Clock<'_>,
        progress: &mut dyn FnMut(&Progress),
    ) -> Result<Self, EvaluateError> {
        plan.check()?;
        views::check(plan, read)?;
        let mut say = |line: String| progress(&Progress(line));
        let variants = &plan.variants;
        let views = Views::of(plan);
        let mut tally = |name: &str, view: &View, count: u32| -> Result<Tally, EvaluateError> {
            say(format!("{name}: {count} scenes"));
            Ok(Tally::of(&witness::scenes(plan, view, count, read, judges)?))
        };
        let mut evaluation = Self {
            plan: plan.clone(),
            reference: tally(&plan.scene, &views.reference, plan.scenes)?,
            noisy: tally(&format!("noise of {} m", variants.range_sigma_m), &views.noisy, variants.scenes)?,
            dropouts: tally(&format!("{} of echoes lost", variants.dropout), &views.dropouts, variants.scenes)?,
            flat: tally(&format!("proportions from {}", variants.proportion[0]), &views.flat, variants.scenes)?,
            dense: tally(&variants.dense_sensor, &views.dense, variants.dense_scenes)?,
            summed: {
                say(format!("{}: {} scenes of {} sweeps", plan.sweeps.scene, plan.sweeps.scenes, plan.sweeps.sweeps));
                Summed::measure(plan, read, judges)?
            },
            fit: FitTime::default(),
            budget: Vec::new(),
            claims: None,
        };
        for &evaluations in &plan.budget.evaluations {
            say(format!("{evaluations} evaluations a fit: {} scenes", plan.budget.scenes));
            evaluation.budget.push(budget::judged(plan, evaluations, read, judges)?);
        }
        say("timing fits".to_owned());
        evaluation.fit = FitTime::measure(&plan.fit, None, read, clock)?;
        for point in &mut evaluation.budget {
            *point = budget::timed(plan, *point, read, clock)?;
        }
        Ok(evaluation)
    }

    /// Every bar, judged or not.
    pub fn bars(&self) -> Vec<Bar> {
        bar::BARS.iter().map(|definition| definition.bar(self, &self.plan.bars)).collect()
    }

    /// Keys of the bars that fall short.
    pub fn short(&self) -> Vec<&'static str> {
        let short = |bar: &Bar| bar.standing() == Standing::FallsShort;
        self.bars().iter().filter(|bar| short(bar)).map(|bar| bar.key).collect()
    }
}
