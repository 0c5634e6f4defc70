//! How boosted trees on fitted solids are made: scenes are looked at by the deployed clusterer and extractor, trees fitted to
//! what they saw, their temperature and the most misfit of a true solid chosen on scenes apart, and the model tested, loaded
//! as the classifier will load it, on scenes apart from both.

mod plan;
mod rows;

use std::fmt;
use std::path::Path;

use classifier::{
    Card, FORMAT, Method, Model, ModelError, ModelFiles, SOLID_FEATURES, SolidsDefinition, solid_feature_names,
};
use lidar::ObstacleClass;

use self::rows::{Rows, look_at};
use crate::paper::Files;
use crate::{Confusion, FitTreesError, LabelledRows, ObserveError, Progress, Reliability, best_temperature, fit_trees};

pub use plan::{SetPlan, SolidsPlan, SolidsPlanError};

/// A model of boosted trees, ready to be written.
#[derive(Clone, Debug)]
pub struct TrainedSolids {
    /// Its folder.
    pub name: String,
    /// Its files.
    pub files: ModelFiles,
    /// What it reached on the test set.
    pub report: SolidsReport,
}

/// What a model reached on scenes that nothing of it was chosen on.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidsReport {
    /// Verdicts.
    pub confusion: Confusion,
    /// Clusters with a fit.
    pub clusters: usize,
    /// Share of them judged rightly \[0 to 1\]; none of the four is wrong.
    pub right: f64,
    /// Share of them called none of the four \[0 to 1\].
    pub false_alarm: f64,
    /// Expected calibration error of those judged.
    pub calibration_error: f64,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainSolidsError {
    /// The plan does not hold.
    #[error(transparent)]
    Plan(#[from] SolidsPlanError),
    /// A scene cannot be observed, or one of its files cannot be read.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// There are no trees.
    #[error(transparent)]
    Trees(#[from] FitTreesError),
    /// A card cannot be written as TOML.
    #[error("card.toml: {0}")]
    Card(#[from] toml::ser::Error),
    /// The classifier refuses the model.
    #[error("the model made is refused: {0}")]
    Refused(#[from] ModelError),
}

/// Name of the model's file.
const FILE: &str = "model.txt";

/// Makes the model of a plan. The same plan and files give the same bytes, on any number of cores.
///
/// # Errors
/// A plan or a file that does not hold.
pub fn train_solids(
    plan: &SolidsPlan,
    read: Files<'_>,
    progress: &mut dyn FnMut(&Progress),
) -> Result<TrainedSolids, TrainSolidsError> {
    plan.check()?;
    let mut say = |line: String| progress(&Progress(line));
    let mut training = Rows::default();
    for (place, set) in plan.training.iter().enumerate() {
        say(format!("set {} of {}: looking at {} scenes", place + 1, plan.training.len(), set.scenes));
        training.extend(look_at(set, plan.first_seed(place), read)?);
    }
    let after = plan.training.len();
    say(format!("looking at {} scenes to calibrate and to test", plan.calibration.scenes + plan.test.scenes));
    let calibration = look_at(&plan.calibration, plan.first_seed(after), read)?;
    let test = look_at(&plan.test, plan.first_seed(after + 1), read)?;

    let rows = LabelledRows { features: &training.features, classes: &training.classes, weights: None };
    let fitted = fit_trees(&solid_feature_names(), &rows, None, &plan.trees, &mut |loss| {
        if loss.rounds.is_multiple_of(25) {
            say(format!("{} rounds: loss {:.4} on {} clusters", loss.rounds, loss.training, rows.classes.len()));
        }
    })?;
    let scores: Vec<[f64; 4]> = (0..calibration.len()).map(|row| fitted.model.scores(calibration.row(row))).collect();
    let trees = fitted.model.with_temperature(best_temperature(&scores, &calibration.classes));
    let trees = trees.map_err(FitTreesError::from)?;

    let model = trees.to_text().into_bytes();
    let most_misfit = quantile(&calibration.misfits, 1.0 - plan.false_alarm);
    let mut card = Card {
        format: FORMAT,
        kind: Method::BoostedTrees,
        file: FILE.to_owned(),
        sha256: Card::checksum(&model),
        features: None,
        solids: Some(definition(read, most_misfit)?),
        data: table([
            ("simulated", sets(plan).into()),
            ("clusters", (training.len() as i64).into()),
            ("seed", (plan.seed as i64).into()),
        ]),
        parameters: toml::Table::try_from(&plan.trees)?,
        scores: toml::Table::new(),
    };
    let mut files = ModelFiles { card: toml::to_string(&card)?, model };
    let report = judge(&Model::load(Method::BoostedTrees, &files)?, &test);
    card.scores = scores_of(&report, plan);
    files.card = toml::to_string(&card)?;
    Ok(TrainedSolids { name: plan.name.clone(), files, report })
}

fn judge(model: &Model, test: &Rows) -> SolidsReport {
    let mut confusion = Confusion::default();
    let mut judged = Vec::new();
    let (mut right, mut none) = (0, 0);
    for row in 0..test.len() {
        let class = test.classes[row];
        let judgement = model.judge_solid(test.row(row), test.misfits[row]);
        confusion.count(ObstacleClass::SOLIDS[usize::from(class)], judgement.class);
        match judgement.class.solid_index() {
            None => none += 1,
            Some(place) => {
                right += usize::from(place == usize::from(class));
                judged.push((judgement.posterior.map(f64::from), class));
            }
        }
    }
    let of_all = |count: usize| count as f64 / test.len().max(1) as f64;
    SolidsReport {
        confusion,
        clusters: test.len(),
        right: of_all(right),
        false_alarm: of_all(none),
        calibration_error: Reliability::of(judged).expected_calibration_error(),
    }
}

/// The value below which a share of all values lies, up to two significant digits after it.
fn quantile(values: &[f32], share: f64) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let place = (share * sorted.len() as f64).ceil() as usize;
    let value = sorted.get(place.saturating_sub(1)).copied().unwrap_or(1.0);
    ((value * 100.0).ceil() / 100.0).max(1.0)
}

fn definition(read: Files<'_>, most_misfit: f32) -> Result<SolidsDefinition, ObserveError> {
    let path = "stages/extractor.toml";
    let text = read(path).map_err(|error| ObserveError::new(path, error))?;
    let params: extractor::Params = toml::from_str(&text).map_err(|error| ObserveError::new(path, error))?;
    let fit = params.fit;
    Ok(SolidsDefinition { evaluations: fit.evaluations, scouting_rays: fit.scouting_rays, rays: fit.rays, most_misfit })
}

fn sets(plan: &SolidsPlan) -> Vec<String> {
    plan.training.iter().map(ToString::to_string).collect()
}

impl fmt::Display for SetPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x config/scenes/{}.toml", self.scenes, self.scene)?;
        if let Some(sensor) = &self.sensor {
            write!(f, ", seen by {sensor}")?;
        }
        if let Some(range_sigma_m) = self.range_sigma_m {
            write!(f, ", range noise {range_sigma_m} m")?;
        }
        if let Some(dropout) = self.dropout {
            write!(f, ", dropout {dropout}")?;
        }
        if let Some([least, most]) = self.proportion {
            write!(f, ", proportions {least} to {most}")?;
        }
        if let Some(most_points) = self.most_points {
            write!(f, ", clusters to {most_points} points")?;
        }
        Ok(())
    }
}

fn scores_of(report: &SolidsReport, plan: &SolidsPlan) -> toml::Table {
    let rows: Vec<toml::Value> = (report.confusion.counts().iter())
        .map(|row| row.iter().map(|&count| i64::from(count)).collect::<Vec<_>>().into())
        .collect();
    let percent = |share: f64| toml::Value::from((share * 1e4).round() / 100.0);
    table([
        ("on", plan.test.to_string().into()),
        ("clusters", (report.clusters as i64).into()),
        ("right_per_cent", percent(report.right)),
        ("false_alarm_per_cent", percent(report.false_alarm)),
        ("calibration_error_per_cent", percent(report.calibration_error)),
        ("actual_by_predicted", rows.into()),
    ])
}

fn table<const N: usize>(entries: [(&str, toml::Value); N]) -> toml::Table {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

impl fmt::Display for SolidsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| 100.0 * share;
        writeln!(f, "{} clusters of scenes apart [%]\n{}", self.clusters, self.confusion)?;
        writeln!(f, "right {:.2} %", percent(self.right))?;
        writeln!(f, "called none of the four {:.2} %", percent(self.false_alarm))?;
        write!(f, "expected calibration error {:.2} %", percent(self.calibration_error))
    }
}

impl TrainedSolids {
    /// Writes the model to its folder under `models`, over what is there.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write_to(&self, models: &Path) -> std::io::Result<()> {
        let folder = models.join(&self.name);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join("card.toml"), &self.files.card)?;
        std::fs::write(folder.join(FILE), &self.files.model)
    }
}

const _: () = assert!(SOLID_FEATURES <= classifier::MAX_FEATURES);
