//! What the paper leaves open, each tried another way and measured on the cluttered scenes.

use simulator::Shape;

use super::bayes_variants::{Reading, Table};
use super::measure::{Machine, confusion, likeliest};
use super::{Data, Files};
use crate::fit_svm::Rounding;
use crate::sets::{self, Set};
use crate::svm_text::rounded;
use crate::{Confusion, Example, Observer, ReproductionPlan, SvmPlan, TrainError, TrainPlan, View, fit_naive_bayes};

/// One choice, made otherwise than in Tables I to III (but for the first: the same on fewer examples).
#[derive(Clone, Debug)]
pub struct Choice {
    /// A short name.
    pub name: &'static str,
    /// What the paper leaves open.
    pub open: &'static str,
    /// What Encke does.
    pub ours: &'static str,
    /// What was done here instead.
    pub tried: String,
    /// Naive Bayes on the cluttered scenes; none where the choice does not touch it.
    pub naive_bayes: Option<Confusion>,
    /// The support vector machine, likewise.
    pub svm: Option<Confusion>,
    /// Its C, chosen anew.
    pub c: Option<f64>,
    /// Clusters in classes of distance, by the support vector machine.
    pub by_distance: Vec<Confusion>,
}

/// How far bands of distance reach \[m\]; the last has no end.
pub(crate) const BAND_M: f32 = 5.0;
/// Bands: 0 to 5 m … 20 m and more.
pub(crate) const BANDS: usize = 5;

/// What is done otherwise.
#[derive(Clone, Debug)]
enum Otherwise {
    /// Nothing.
    Same,
    /// Each histogram multiplied by a number, or each of its bins changed.
    Scale(fn(&Example) -> Vec<messages::Bin>),
    /// Another Eq. 7.
    Bayes(Reading),
    /// Weights enter the machine as they are.
    Unrounded,
    /// Both training and tests are observed otherwise.
    View(View),
    /// Only training is.
    Training(View),
    /// Only tests are.
    Tests(View),
}

/// A choice before it is measured.
pub(crate) struct Question {
    name: &'static str,
    open: &'static str,
    ours: &'static str,
    tried: String,
    otherwise: Otherwise,
}

impl Question {
    /// Its short name.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }
}

fn counts(example: &Example) -> Vec<messages::Bin> {
    scaled(example, 4.0 * example.points as f32)
}

fn unit_length(example: &Example) -> Vec<messages::Bin> {
    let norm = example.bins.iter().map(|bin| bin.weight * bin.weight).sum::<f32>().sqrt();
    scaled(example, 1.0 / norm.max(f32::MIN_POSITIVE))
}

fn roots(example: &Example) -> Vec<messages::Bin> {
    example.bins.iter().map(|bin| messages::Bin { weight: bin.weight.sqrt(), ..*bin }).collect()
}

fn scaled(example: &Example, scale: f32) -> Vec<messages::Bin> {
    example.bins.iter().map(|bin| messages::Bin { weight: bin.weight * scale, ..*bin }).collect()
}

/// All questions, the unchanged first.
pub(crate) fn questions(plan: &TrainPlan, reproduction: &ReproductionPlan) -> Vec<Question> {
    let as_is = View::by_histogram(&plan.scene);
    let dense = View { sensor: Some(plan.dense_sensor.clone()), ..as_is.clone() };
    let scale = "how a cluster's histogram is scaled; γ = 3 means nothing without it";
    let eq_7 =
        "Eq. 7 divides counts by the number of examples, which is no probability, and is 0 for what was never seen";
    let field = "how large, how slender and how many obstacles are";
    let k = "whether the k = 5 of Eqs. 3 and 4 count the point itself";
    let one =
        |name, open, ours, tried: &str, otherwise| Question { name, open, ours, tried: tried.to_owned(), otherwise };
    let (sum_1, mean) =
        ("bins sum to 1", "mean of histograms that sum to 1, smoothed, the smoothing by cross-validation");
    let sizes = "half extent 0.35 to 2.2 m, proportions 0.4 to 1, as many as the scene's file says";
    vec![
        one("same", "", "", &format!("nothing: {} examples a class", reproduction.choice_examples), Otherwise::Same),
        one("counts", scale, sum_1, "counts: bins sum to the pairs of neighbours", Otherwise::Scale(counts)),
        one("root", scale, sum_1, "square roots of the bins", Otherwise::Scale(roots)),
        one("unit-length", scale, sum_1, "bins of length 1 (L2)", Otherwise::Scale(unit_length)),
        one("eq7-literal", eq_7, mean, "Eq. 7 as printed; ln 0 rules a class out", Otherwise::Bayes(Reading::Literal)),
        one(
            "eq7-floor",
            eq_7,
            mean,
            "Eq. 7 as printed; never seen counts as once",
            Otherwise::Bayes(Reading::LiteralFloor),
        ),
        one("eq7-pooled", eq_7, mean, "counts over the class's counts, Laplace", Otherwise::Bayes(Reading::Pooled)),
        one(
            "unrounded",
            "",
            "weights in multiples of 1/200, for a small model file",
            "weights as they are",
            Otherwise::Unrounded,
        ),
        one(
            "no-noise",
            "the noise of a range",
            "the sensor file's, 2 cm",
            "0 cm, in training and tests",
            Otherwise::View(View { range_sigma_m: Some(0.0), ..as_is.clone() }),
        ),
        one(
            "k-6",
            k,
            "5 points, itself included",
            "6 points: 5 others",
            Otherwise::View(View { neighbours: Some(6), ..as_is.clone() }),
        ),
        one(
            "near-training",
            "how far training obstacles are; Fig. 6 shows that tests reach farther",
            "as far as the tests'",
            &format!("nearer: config/scenes/{}.toml", reproduction.near_scene),
            Otherwise::Training(View::by_histogram(&reproduction.near_scene)),
        ),
        one(
            "slender",
            field,
            sizes,
            "proportions 0.2 to 1, in training and tests",
            Otherwise::View(View { proportion: Some([0.2, 1.0]), ..as_is.clone() }),
        ),
        one("sparse", field, sizes, "10 obstacles a test scene", Otherwise::Tests(View { count: Some(10), ..as_is })),
        one(
            "dense",
            "what becomes of sweeps with more columns than 500",
            "read in strides of columns",
            &format!("tests seen by {}, in strides", plan.dense_sensor),
            Otherwise::Tests(dense.clone()),
        ),
        one(
            "dense-whole",
            "what becomes of sweeps with more columns than 500",
            "read in strides of columns",
            &format!("tests seen by {}, without strides", plan.dense_sensor),
            // No sensor's columns are nearer than this.
            Otherwise::Tests(View { spacing_deg: Some(0.01), ..dense }),
        ),
    ]
}

/// Measures one.
pub(crate) fn measure(
    question: &Question,
    plan: &TrainPlan,
    data: &Data,
    read: Files<'_>,
) -> Result<Choice, TrainError> {
    let reproduction = plan.reproduction()?;
    let few = reproduction.choice_examples;
    let choose = SvmPlan { subset: reproduction.choice_subset, ..plan.svm.clone() };
    let mut training: Vec<Example> =
        crate::fit_svm::first_of_each_class(&data.training, few).into_iter().cloned().collect();
    let mut tests = None;
    let mut rounding: Rounding = rounded;
    match &question.otherwise {
        Otherwise::Same | Otherwise::Bayes(_) => {}
        Otherwise::Scale(scale) => {
            rescale(&mut training, *scale);
            let mut changed = data.cluttered.clone();
            rescale(&mut changed, *scale);
            tests = Some(changed);
        }
        Otherwise::Unrounded => rounding = f64::from,
        Otherwise::View(view) => {
            training = observe_training(view, plan, few, read)?;
            tests = Some(observe_tests(view, plan, read)?);
        }
        Otherwise::Training(view) => training = observe_training(view, plan, few, read)?,
        Otherwise::Tests(view) => tests = Some(observe_tests(view, plan, read)?),
    }
    let tests = tests.as_ref().unwrap_or(&data.cluttered);
    let mut choice = Choice {
        name: question.name,
        open: question.open,
        ours: question.ours,
        tried: question.tried.clone(),
        naive_bayes: None,
        svm: None,
        c: None,
        by_distance: Vec::new(),
    };
    match &question.otherwise {
        Otherwise::Bayes(reading) => {
            let table = Table::fit(&training, *reading);
            choice.naive_bayes = Some(confusion(tests, |example| table.verdict(example)));
            return Ok(choice);
        }
        // Naive Bayes takes histograms that sum to 1, and knows no rounding.
        Otherwise::Scale(_) | Otherwise::Unrounded => {}
        _ => {
            let fitted = fit_naive_bayes::fit(&training, &plan.naive_bayes.smoothing, plan.folds)?;
            choice.naive_bayes = Some(confusion(tests, |example| likeliest(&fitted.model, example)));
        }
    }
    let machine = Machine::fit(&training, &choose, plan.folds, rounding);
    choice.svm = Some(confusion(tests, |example| machine.verdict(example)));
    choice.c = Some(machine.c);
    if matches!(question.otherwise, Otherwise::Same | Otherwise::Training(_)) {
        choice.by_distance = (0..BANDS)
            .map(|band| confusion(tests.iter().filter(|e| band_of(e) == band), |example| machine.verdict(example)))
            .collect();
    }
    Ok(choice)
}

fn band_of(example: &Example) -> usize {
    ((example.range_m / BAND_M) as usize).min(BANDS - 1)
}

fn rescale(examples: &mut [Example], scale: fn(&Example) -> Vec<messages::Bin>) {
    for example in examples {
        example.bins = scale(example);
    }
}

fn observe_training(view: &View, plan: &TrainPlan, count: usize, read: Files<'_>) -> Result<Vec<Example>, TrainError> {
    let mut observer = Observer::new(view, &read)?;
    let mut examples = Vec::new();
    for shape in Shape::ALL {
        examples.extend(Set::Training.alone(&mut observer, plan.seed, shape, count)?);
    }
    Ok(examples)
}

fn observe_tests(view: &View, plan: &TrainPlan, read: Files<'_>) -> Result<Vec<Example>, TrainError> {
    let mut observer = Observer::new(view, &read)?;
    let mut examples = Vec::new();
    for shape in Shape::ALL {
        examples.extend(sets::cluttered(&mut observer, plan.seed, shape, plan.cluttered_scenes)?);
    }
    Ok(examples)
}
