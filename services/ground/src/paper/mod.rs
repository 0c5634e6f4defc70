//! The paper's experiments (Sec. VI), one after the other, from one plan.

mod bayes_variants;
pub(crate) mod charts;
mod choices;
mod json;
mod measure;
mod outline;
pub(crate) mod page;
mod page_choices;
mod pictures;
mod published;
mod summary;
pub(crate) mod svg;

use classifier::NaiveBayes;
use simulator::Shape;

pub use choices::Choice;
pub use json::RunNote;

use crate::fit_svm::{best_c, cross_validated, first_of_each_class};
use crate::sets::{self, Set};
use crate::svm_text::rounded;
use crate::{Confusion, Example, Observer, Progress, TrainError, TrainPlan, View, fit_naive_bayes, parallel};
use measure::{Machine, confusion, likeliest};
use pictures::Pictures;

/// Gives the text of a file by its path in the configuration, to any thread.
pub type Files<'a> = &'a (dyn Fn(&str) -> std::io::Result<String> + Sync);

/// The paper's tables and figures, as this machine's simulator gives them.
#[derive(Clone, Debug)]
pub struct Reproduction {
    /// What was run.
    pub plan: TrainPlan,
    /// Table I: Naive Bayes on cluttered scenes of one shape each.
    pub naive_bayes: FourClass,
    /// Table II: the support vector machine on the same.
    pub svm: FourClass,
    /// Cost of the machine, by cross-validation.
    pub c: f64,
    /// Costs tried, with the share right \[0 to 1\].
    pub c_tried: Vec<(f64, f64)>,
    /// Table III: a machine for each two classes.
    pub two_class: Vec<TwoClass>,
    /// Fig. 7: both classifiers against the size of the training set, smallest first.
    pub convergence: Vec<Converged>,
    /// What the paper leaves open; the first entry changes nothing and is what the others compare with.
    pub choices: Vec<Choice>,
    /// Figs. 2, 3 and 6.
    pub(crate) pictures: Pictures,
}

/// What one classifier reached.
#[derive(Clone, Copy, Debug)]
pub struct FourClass {
    /// On cluttered scenes.
    pub cluttered: Confusion,
    /// On obstacles seen alone.
    pub alone: Confusion,
}

/// A machine that knows two classes only.
#[derive(Clone, Copy, Debug)]
pub struct TwoClass {
    /// Their places in the order of solids.
    pub classes: [usize; 2],
    /// On cluttered scenes of these two.
    pub cluttered: Confusion,
    /// Its cost, chosen for itself.
    pub c: f64,
}

impl TwoClass {
    /// Mean of both classes' shares \[%\].
    pub fn mean_per_cent(&self) -> f64 {
        let rows = self.cluttered.per_cent();
        self.classes.iter().map(|&class| rows[class][class]).sum::<f64>() / 2.0
    }
}

/// One point of Fig. 7.
#[derive(Clone, Copy, Debug)]
pub struct Converged {
    /// Examples of each class.
    pub examples: usize,
    /// The machine on cluttered scenes.
    pub svm: Confusion,
    /// The machine on the very examples that it was trained on.
    pub svm_training: Confusion,
    /// Naive Bayes on cluttered scenes.
    pub naive_bayes: Confusion,
}

/// Examples of each class, classes one after the other.
pub(crate) struct Data {
    pub(crate) training: Vec<Example>,
    pub(crate) held_out: Vec<Example>,
    pub(crate) cluttered: Vec<Example>,
}

/// Repeats the paper's experiments as `plan` says, on all cores. The same plan and files give the same results.
///
/// # Errors
/// A plan or a file that does not hold.
pub fn reproduce(
    plan: &TrainPlan,
    read: Files<'_>,
    progress: &(dyn Fn(&Progress) + Sync),
) -> Result<Reproduction, TrainError> {
    plan.check()?;
    let reproduction = plan.reproduction()?;
    let say = |line: String| progress(&Progress(line));
    say(format!(
        "looking at {} obstacles and {} scenes of each class",
        plan.examples + plan.held_out,
        plan.cluttered_scenes
    ));
    let data = observe(plan, read)?;
    let pictures = Pictures::take(plan, reproduction.picture_seed, &data.training, read)?;

    say("naive bayes: fitting".to_owned());
    let naive_bayes = fit_naive_bayes::fit(&data.training, &plan.naive_bayes.smoothing, plan.folds)?.model;
    let subset = first_of_each_class(&data.training, plan.svm.subset);
    let c_tried = parallel::map(&plan.svm.c, |&c| {
        let right = cross_validated(&subset, plan.svm.gamma, c, plan.folds, rounded);
        say(format!("svm: C = {c}: {:.1} % in cross-validation", 100.0 * right));
        (c, right)
    });
    let c = best_c(&c_tried);

    let questions = choices::questions(plan, reproduction);
    // The longest first, so that no core is left with one at the end.
    let mut jobs = vec![Job::Whole];
    jobs.extend(published::TWO_CLASS.iter().map(|&(i, j, _)| Job::Pair([i, j])));
    jobs.extend(reproduction.convergence.iter().rev().map(|&size| Job::Size(size)));
    jobs.extend(questions.iter().map(Job::Choice));
    let done = parallel::map(&jobs, |job| {
        say(job.name(c));
        match job {
            Job::Whole => Ok(Done::Whole(Box::new(Machine::train(&all(&data.training), plan.svm.gamma, c, rounded)))),
            Job::Pair(classes) => Ok(Done::Pair(pair(plan, &data, *classes))),
            Job::Size(size) => converged(plan, &data, *size, c).map(Done::Size),
            Job::Choice(question) => choices::measure(question, plan, &data, read).map(Done::Choice),
        }
    });
    let (mut whole, mut two_class, mut convergence, mut choices) = (None, Vec::new(), Vec::new(), Vec::new());
    for one in done {
        match one? {
            Done::Whole(machine) => whole = Some(machine),
            Done::Pair(pair) => two_class.push(pair),
            Done::Size(point) => convergence.push(point),
            Done::Choice(choice) => choices.push(choice),
        }
    }
    let machine = match whole {
        Some(machine) => *machine,
        None => Machine::train(&all(&data.training), plan.svm.gamma, c, rounded),
    };

    say("testing, and drawing".to_owned());
    let svm = four_class(&data, |example| machine.verdict(example));
    let naive_bayes_reached = four_class(&data, |example| likeliest(&naive_bayes, example));
    convergence.push(Converged {
        examples: plan.examples,
        svm: svm.cluttered,
        svm_training: confusion(&data.training, |example| machine.verdict(example)),
        naive_bayes: naive_bayes_reached.cluttered,
    });
    convergence.sort_by_key(|point| point.examples);
    convergence.dedup_by_key(|point| point.examples);
    Ok(Reproduction {
        plan: plan.clone(),
        naive_bayes: naive_bayes_reached,
        svm,
        c,
        c_tried,
        two_class,
        convergence,
        choices,
        pictures: pictures.judged(|example| machine.verdict(example)),
    })
}

enum Job<'a> {
    Whole,
    Pair([usize; 2]),
    Size(usize),
    Choice(&'a choices::Question),
}

enum Done {
    Whole(Box<Machine>),
    Pair(TwoClass),
    Size(Converged),
    Choice(Choice),
}

impl Job<'_> {
    fn name(&self, c: f64) -> String {
        match self {
            Self::Whole => format!("svm: training on all examples, C = {c}"),
            Self::Pair(classes) => {
                let [one, other] = classes.map(|class| lidar::ObstacleClass::SOLIDS[class].name());
                format!("two classes: {one} and {other}")
            }
            Self::Size(size) => format!("convergence: {size} examples of each class"),
            Self::Choice(question) => format!("open choices: {}", question.name()),
        }
    }
}

fn observe(plan: &TrainPlan, read: Files<'_>) -> Result<Data, TrainError> {
    let view = View::by_histogram(&plan.scene);
    let of_shapes = parallel::map(&Shape::ALL, |&shape| -> Result<Data, TrainError> {
        let mut observer = Observer::new(&view, &read)?;
        Ok(Data {
            training: Set::Training.alone(&mut observer, plan.seed, shape, plan.examples)?,
            held_out: Set::HeldOut.alone(&mut observer, plan.seed, shape, plan.held_out)?,
            cluttered: sets::cluttered(&mut observer, plan.seed, shape, plan.cluttered_scenes)?,
        })
    });
    let mut data = Data { training: Vec::new(), held_out: Vec::new(), cluttered: Vec::new() };
    for one in of_shapes {
        let one = one?;
        data.training.extend(one.training);
        data.held_out.extend(one.held_out);
        data.cluttered.extend(one.cluttered);
    }
    Ok(data)
}

fn all(examples: &[Example]) -> Vec<&Example> {
    examples.iter().collect()
}

fn four_class(data: &Data, verdict: impl Fn(&Example) -> lidar::ObstacleClass) -> FourClass {
    FourClass { cluttered: confusion(&data.cluttered, &verdict), alone: confusion(&data.held_out, &verdict) }
}

/// Table III: trained on two classes, tested on the cluttered scenes of these two.
fn pair(plan: &TrainPlan, data: &Data, classes: [usize; 2]) -> TwoClass {
    let of_both = |example: &&Example| example.class.solid_index().is_some_and(|class| classes.contains(&class));
    let training: Vec<Example> = data.training.iter().filter(of_both).cloned().collect();
    let machine = Machine::fit(&training, &plan.svm, plan.folds, rounded);
    let cluttered = confusion(data.cluttered.iter().filter(of_both), |example| machine.verdict(example));
    TwoClass { classes, cluttered, c: machine.c }
}

/// Fig. 7: the first `size` examples of each class, with the C of the whole.
fn converged(plan: &TrainPlan, data: &Data, size: usize, c: f64) -> Result<Converged, TrainError> {
    let few = first_of_each_class(&data.training, size);
    let machine = Machine::train(&few, plan.svm.gamma, c, rounded);
    let owned: Vec<Example> = few.iter().map(|&example| example.clone()).collect();
    let bayes: NaiveBayes = fit_naive_bayes::fit(&owned, &plan.naive_bayes.smoothing, plan.folds)?.model;
    Ok(Converged {
        examples: size,
        svm: confusion(&data.cluttered, |example| machine.verdict(example)),
        svm_training: confusion(&owned, |example| machine.verdict(example)),
        naive_bayes: confusion(&data.cluttered, |example| likeliest(&bayes, example)),
    })
}
