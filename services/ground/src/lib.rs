//! Offline: models are made and measured here, on the ground, with the very rooms that fly.
//!
//! [`train`] draws obstacles, has the simulator look at each of them alone, and the deployed clusterer and extractor
//! describe what it saw; fits both classifiers of the paper; and tests them, loaded as the classifier will load them.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let read = |path: &str| std::fs::read_to_string(format!("config/{path}"));
//! let plan: ground::TrainPlan = toml::from_str(&read("training/paper.toml")?)?;
//! let trained = ground::train(&plan, &read, &mut |progress| eprintln!("{progress}"))?;
//! trained.write_to(std::path::Path::new("config/models"))?;
//! println!("{}", trained.report);
//! # Ok(())
//! # }
//! ```

mod bars;
mod calibrate;
mod confusion;
mod few;
mod fit_naive_bayes;
mod fit_svm;
mod fit_trees;
mod observe;
mod owner;
mod page;
mod paper;
mod parallel;
mod plan;
mod report;
mod run_report;
mod sets;
mod solids;
mod svm_text;
mod tracks;
mod train;

pub use bars::{
    Bar, BudgetPlan, BudgetPoint, Claims, Clock, EvaluateError, Evaluation, EvaluationNote, EvaluationPlan,
    EvaluationPlanError, FitPlan, FitTime, Judge, Judges, Measure, Sense, Share, SolidErrors, Standing, Summed,
    SweepsPlan, Tally, Threshold, VariantsPlan,
};
pub use calibrate::{RELIABILITY_BINS, Reliability, ReliabilityBin, best_temperature, log_loss};
pub use confusion::Confusion;
pub use fit_trees::{BoostingParams, FitTreesError, FittedTrees, LabelledRows, RoundLoss, fit_trees};
pub use observe::{Described, Example, ObserveError, Observer, Seen, View};
pub use paper::{Choice, Converged, Files, FourClass, Reproduction, RunNote, TwoClass, reproduce};
pub use plan::{NaiveBayesPlan, PlanError, ReproductionPlan, SvmPlan, TrainPlan};
pub use report::{ModelReport, TrainReport};
pub use run_report::{RunFigures, RunReportError};
pub use solids::{SetPlan, SolidsPlan, SolidsPlanError, SolidsReport, TrainSolidsError, TrainedSolids, train_solids};
pub use tracks::{
    ALPHAS, Bodies, Classes, ClearMot, Confirming, Consistency, CostPlan, Danger, Encounter, Encounters,
    EncountersPlan, Followed, Follower, Followers, Foreseen, HardObstacle, Hota, Identity, Nees, PROBABILITY_BINS,
    ProbabilityBin, ProbabilityTable, RootMeanSquare, TrackErrors, TrackEvaluation, TrackScores, TrackerTime,
    TracksNote, TracksPlan, UnknownTracks,
};
pub use train::{Progress, TrainError, Trained, train};
