use std::fmt;
use std::path::Path;

use classifier::{
    Card, FORMAT, FeatureDefinition, Method, Model, ModelError, ModelFiles, NORMALISATION, NaiveBayesError,
};
use lidar::ObstacleClass;
use simulator::Shape;

use crate::sets::{self, Set};
use crate::svm_text::write_model;
use crate::{
    Confusion, Example, ModelReport, ObserveError, Observer, PlanError, TrainPlan, TrainReport, View, fit_naive_bayes,
    fit_svm,
};

/// Where training stands, as one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress(pub(crate) String);

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Both models, ready to be written, and how well they do.
#[derive(Clone, Debug)]
pub struct Trained {
    /// Name, card and model file of each.
    models: Vec<(String, String, ModelFiles)>,
    /// How well they do.
    pub report: TrainReport,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// The plan does not hold.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A scene cannot be observed, or one of its files cannot be read.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// The fit gave no model.
    #[error("naive bayes: {0}")]
    NaiveBayes(#[from] NaiveBayesError),
    /// A card cannot be written as TOML.
    #[error("card.toml: {0}")]
    Card(#[from] toml::ser::Error),
    /// The classifier refuses the model.
    #[error("the model made is refused: {0}")]
    Refused(#[from] ModelError),
}

/// Examples of each class, classes one after the other.
struct Examples {
    training: Vec<Example>,
    held_out: Vec<Example>,
    cluttered: Vec<Example>,
    /// The same scenes, seen by the dense sensor.
    dense: Vec<Example>,
}

/// Trains and tests both models as `plan` says. `read` gives the text of a file by its path in the configuration.
///
/// The same plan and files give the same bytes.
///
/// # Errors
/// A plan or a file that does not hold.
pub fn train(
    plan: &TrainPlan,
    read: &dyn Fn(&str) -> std::io::Result<String>,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Trained, TrainError> {
    plan.check()?;
    let mut say = |line: &str| progress(&Progress(line.to_owned()));
    let examples = observe(plan, read, &mut say)?;
    let features = feature_definition(read)?;

    say("naive bayes: fitting");
    let naive_bayes = fit_naive_bayes::fit(&examples.training, &plan.naive_bayes.smoothing, plan.folds)?;
    let mut say_svm = |line: &str| say(&format!("svm: {line}"));
    let svm = fit_svm::fit(&examples.training, &plan.svm, plan.folds, &mut say_svm);

    let fitted = [
        Fitted {
            name: &plan.naive_bayes.name,
            kind: Method::NaiveBayes,
            file: "model.txt",
            text: naive_bayes.model.to_text(),
            parameters: table([
                ("smoothing", naive_bayes.smoothing.into()),
                ("draws", rounded(naive_bayes.model.draws()).into()),
            ]),
            cross_validated: naive_bayes.cross_validated,
        },
        Fitted {
            name: &plan.svm.name,
            kind: Method::Svm,
            file: "model.libsvm",
            text: write_model(&svm.model),
            parameters: table([
                ("gamma", plan.svm.gamma.into()),
                ("c", svm.c.into()),
                ("c_tried", svm.tried.iter().map(|one| one.0).collect::<Vec<_>>().into()),
                ("c_tried_per_cent", svm.tried.iter().map(|one| per_cent(one.1)).collect::<Vec<_>>().into()),
                ("support_vectors", (svm.model.vectors.len() as i64).into()),
            ]),
            cross_validated: svm.cross_validated,
        },
    ];
    let mut trained = Trained { models: Vec::new(), report: TrainReport { models: Vec::new() } };
    for one in fitted {
        say(&format!("{}: testing", one.name));
        let (card, files, report) = test(plan, &examples, &features, one)?;
        trained.models.push((report.name.clone(), card.file, files));
        trained.report.models.push(report);
    }
    Ok(trained)
}

fn observe(
    plan: &TrainPlan,
    read: &dyn Fn(&str) -> std::io::Result<String>,
    say: &mut dyn FnMut(&str),
) -> Result<Examples, TrainError> {
    let view = View::by_histogram(&plan.scene);
    let mut observer = Observer::new(&view, read)?;
    let mut dense = Observer::new(&View { sensor: Some(plan.dense_sensor.clone()), ..view }, read)?;
    let mut examples =
        Examples { training: Vec::new(), held_out: Vec::new(), cluttered: Vec::new(), dense: Vec::new() };
    for shape in Shape::ALL {
        say(&format!("looking at {} obstacles: {}", plan.examples + plan.held_out, shape.class().name()));
        examples.training.extend(Set::Training.alone(&mut observer, plan.seed, shape, plan.examples)?);
        examples.held_out.extend(Set::HeldOut.alone(&mut observer, plan.seed, shape, plan.held_out)?);
        examples.cluttered.extend(sets::cluttered(&mut observer, plan.seed, shape, plan.cluttered_scenes)?);
        examples.dense.extend(sets::cluttered(&mut dense, plan.seed, shape, plan.cluttered_scenes)?);
    }
    Ok(examples)
}

/// A model before its test.
struct Fitted<'a> {
    name: &'a str,
    kind: Method,
    file: &'static str,
    text: String,
    parameters: toml::Table,
    cross_validated: f64,
}

/// Loads the model as the classifier will, tests it and writes the scores into its card.
fn test(
    plan: &TrainPlan,
    examples: &Examples,
    features: &FeatureDefinition,
    fitted: Fitted<'_>,
) -> Result<(Card, ModelFiles, ModelReport), TrainError> {
    let mut card = Card {
        format: FORMAT,
        kind: fitted.kind,
        file: fitted.file.to_owned(),
        sha256: Card::checksum(fitted.text.as_bytes()),
        features: Some(features.clone()),
        solids: None,
        data: table([
            ("simulated", format!("config/scenes/{}.toml, one obstacle at a time", plan.scene).into()),
            ("examples_of_each_class", (plan.examples as i64).into()),
            ("seed", (plan.seed as i64).into()),
        ]),
        parameters: fitted.parameters,
        scores: toml::Table::new(),
    };
    let mut files = ModelFiles { card: toml::to_string(&card)?, model: fitted.text.into_bytes() };
    let model = Model::load(fitted.kind, &files)?;
    let (alone, _) = judge(&model, &examples.held_out);
    let (cluttered, against_posterior) = judge(&model, &examples.cluttered);
    let (dense, _) = judge(&model, &examples.dense);
    card.scores = table([
        ("cross_validation_per_cent", per_cent(fitted.cross_validated).into()),
        ("alone", scores(&alone, &format!("{} obstacles of each class, seen alone", plan.held_out))),
        (
            "cluttered",
            scores(&cluttered, &format!("{} scenes of each class, one shape a scene", plan.cluttered_scenes)),
        ),
        ("dense", scores(&dense, &format!("the cluttered scenes, seen by {}", plan.dense_sensor))),
    ]);
    files.card = toml::to_string(&card)?;
    let report = ModelReport { name: fitted.name.to_owned(), alone, cluttered, dense, against_posterior };
    Ok((card, files, report))
}

fn judge(model: &Model, examples: &[Example]) -> (Confusion, u32) {
    let mut confusion = Confusion::default();
    let mut against_posterior = 0;
    for example in examples {
        if example.bins.is_empty() {
            confusion.count(example.class, ObstacleClass::Unclassified);
            continue;
        }
        let judgement = model.judge(&example.bins);
        confusion.count(example.class, judgement.class);
        let most = judgement.posterior.iter().copied().fold(0.0, f32::max);
        let own = judgement.class.solid_index().map_or(0.0, |place| judgement.posterior[place]);
        against_posterior += u32::from(own < most);
    }
    (confusion, against_posterior)
}

fn scores(confusion: &Confusion, on: &str) -> toml::Value {
    let rows: Vec<toml::Value> = confusion
        .counts()
        .iter()
        .map(|row| row.iter().map(|&count| i64::from(count)).collect::<Vec<_>>().into())
        .collect();
    let unclassified: Vec<i64> = confusion.unclassified().iter().map(|&count| i64::from(count)).collect();
    table([
        ("on", on.into()),
        ("mean_per_cent", rounded(confusion.mean_per_cent()).into()),
        ("actual_by_predicted", rows.into()),
        ("too_few_points", unclassified.into()),
    ])
    .into()
}

fn feature_definition(read: &dyn Fn(&str) -> std::io::Result<String>) -> Result<FeatureDefinition, ObserveError> {
    let path = "stages/extractor.toml";
    let text = read(path).map_err(|error| ObserveError::new(path, error))?;
    let params: extractor::Params = toml::from_str(&text).map_err(|error| ObserveError::new(path, error))?;
    Ok(FeatureDefinition {
        bins: extractor::BINS as u32,
        normalisation: NORMALISATION.to_owned(),
        neighbours: params.neighbours,
        spacing_deg: params.spacing_deg,
    })
}

fn table<const N: usize>(entries: [(&str, toml::Value); N]) -> toml::Table {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn per_cent(share: f64) -> f64 {
    rounded(100.0 * share)
}

fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

impl Trained {
    /// The models as files: path under `config/models/`, bytes.
    pub fn files(&self) -> impl Iterator<Item = (String, &[u8])> {
        self.models.iter().flat_map(|(name, file, files)| {
            [(format!("{name}/card.toml"), files.card.as_bytes()), (format!("{name}/{file}"), &files.model)]
        })
    }

    /// Writes each model to its folder under `models`, over what is there.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write_to(&self, models: &Path) -> std::io::Result<()> {
        for (path, bytes) in self.files() {
            let path = models.join(path);
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder)?;
            }
            std::fs::write(path, bytes)?;
        }
        Ok(())
    }
}
