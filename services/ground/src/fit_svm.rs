//! The support vector machine (Sec. V-2): C by cross-validation, one against one, a sigmoid for each pair of classes.

use classifier::{Decision, PAIRS, Svm, SvmFile};
use libsvm_rs::probability::sigmoid_train;
use libsvm_rs::train::svm_train;
use libsvm_rs::{KernelType, SvmModel, SvmNode, SvmParameter, SvmProblem, SvmType};
use messages::Bin;

use crate::svm_text::rounded;
use crate::{Example, SvmPlan};

/// What was fitted, and how well it does where it was not fitted.
pub(crate) struct Fitted {
    pub(crate) model: SvmFile,
    pub(crate) c: f64,
    /// Share of the subset that cross-validation got right, for each C tried.
    pub(crate) tried: Vec<(f64, f64)>,
    /// Share of the whole training set that cross-validation got right with the C chosen.
    pub(crate) cross_validated: f64,
}

/// The two classes of each pair, as places of their labels.
const PAIR: [(usize, usize); PAIRS] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// How a weight enters training and the model.
pub(crate) type Rounding = fn(f32) -> f64;

/// Fits to `examples`: classes one after the other, each with as many as the others and more than `folds`.
///
/// libsvm draws its folds from a generator that goes on from call to call; folds here are every n-th example, so that
/// the result hangs on the examples alone. The sigmoids are fitted, as in libsvm, to decision values that
/// cross-validation gives.
pub(crate) fn fit(examples: &[Example], plan: &SvmPlan, folds: usize, progress: &mut dyn FnMut(&str)) -> Fitted {
    let subset = first_of_each_class(examples, plan.subset);
    let mut tried = Vec::new();
    for &c in &plan.c {
        let right = cross_validated(&subset, plan.gamma, c, folds, rounded);
        progress(&format!("C = {c}: {:.1} % in cross-validation", 100.0 * right));
        tried.push((c, right));
    }
    let c = best_c(&tried);

    let all: Vec<&Example> = examples.iter().collect();
    progress(&format!("C = {c}: sigmoids"));
    let judged = cross_validate(&all, plan.gamma, c, folds, rounded);
    let sigmoids = PAIR.iter().enumerate().map(|(pair, &(i, j))| sigmoid(&judged, pair, i, j)).collect();
    progress(&format!("C = {c}: the model"));
    let model = SvmFile { sigmoids, ..train_on(&all, plan.gamma, c, rounded) };
    Fitted { model, c, tried, cross_validated: share_right(&judged) }
}

/// The first `count` examples of each class, in their order.
pub(crate) fn first_of_each_class(examples: &[Example], count: usize) -> Vec<&Example> {
    let mut taken = [0; 4];
    let chosen = |example: &&Example| {
        example.class.solid_index().is_some_and(|class| {
            taken[class] += 1;
            taken[class] <= count
        })
    };
    examples.iter().filter(chosen).collect()
}

/// The cost with the greatest share right; the first of equals: the smaller C, fewer support vectors at their bound.
pub(crate) fn best_c(tried: &[(f64, f64)]) -> f64 {
    tried.iter().fold((1.0, f64::NEG_INFINITY), |best, &one| if one.1 > best.1 { one } else { best }).0
}

/// Slope and offset of a pair's sigmoid, from the examples of its two classes.
fn sigmoid(judged: &[Judged], pair: usize, i: usize, j: usize) -> [f64; 2] {
    let (values, labels): (Vec<f64>, Vec<f64>) = judged
        .iter()
        .filter(|one| one.class == i || one.class == j)
        .map(|one| (one.decision.values[pair], if one.class == i { 1.0 } else { -1.0 }))
        .unzip();
    let (a, b) = sigmoid_train(&values, &labels);
    [a, b]
}

/// An example's class and what a machine trained without its fold says, as places in the order of solids.
struct Judged {
    class: usize,
    winner: usize,
    decision: Decision,
}

/// Share of the examples that a machine trained without their fold gets right.
pub(crate) fn cross_validated(examples: &[&Example], gamma: f64, c: f64, folds: usize, rounding: Rounding) -> f64 {
    share_right(&cross_validate(examples, gamma, c, folds, rounding))
}

fn cross_validate(examples: &[&Example], gamma: f64, c: f64, folds: usize, rounding: Rounding) -> Vec<Judged> {
    let mut judged = Vec::with_capacity(examples.len());
    for fold in 0..folds {
        let others: Vec<&Example> =
            examples.iter().enumerate().filter(|(place, _)| place % folds != fold).map(|(_, e)| *e).collect();
        let svm = Svm::new(&train_on(&others, gamma, c, rounding));
        for example in examples.iter().skip(fold).step_by(folds) {
            if let Some(class) = example.class.solid_index() {
                let decision = svm.decide(&example.bins);
                judged.push(Judged { class, winner: solid_of(&svm, &decision), decision });
            }
        }
    }
    judged
}

/// The verdict as a place in the order of solids: a label is the class's number, which counts from 1.
pub(crate) fn solid_of(svm: &Svm, decision: &Decision) -> usize {
    svm.labels()[decision.winner] as usize - 1
}

fn share_right(judged: &[Judged]) -> f64 {
    let right = judged.iter().filter(|one| one.winner == one.class).count();
    right as f64 / judged.len().max(1) as f64
}

/// A machine without sigmoids; labels are the classes' numbers, in order.
pub(crate) fn train_on(examples: &[&Example], gamma: f64, c: f64, rounding: Rounding) -> SvmFile {
    libsvm_rs::set_quiet(true);
    let parameter = SvmParameter {
        svm_type: SvmType::CSvc,
        kernel_type: KernelType::Rbf,
        gamma,
        c,
        cache_size: 200.0,
        ..SvmParameter::default()
    };
    let problem = SvmProblem {
        labels: examples.iter().map(|example| f64::from(example.class as u8)).collect(),
        instances: examples.iter().map(|example| nodes(&example.bins, rounding)).collect(),
    };
    from_libsvm(&svm_train(&problem, &parameter))
}

/// A support vector as the model file will hold it.
fn nodes(bins: &[Bin], rounding: Rounding) -> Vec<SvmNode> {
    bins.iter()
        .map(|bin| SvmNode { index: bin.index as i32 + 1, value: rounding(bin.weight) })
        .filter(|node| node.value > 0.0)
        .collect()
}

fn from_libsvm(model: &SvmModel) -> SvmFile {
    SvmFile {
        gamma: model.param.gamma,
        labels: model.label.clone(),
        rho: model.rho.clone(),
        sigmoids: Vec::new(),
        vectors_of_class: model.n_sv.clone(),
        coefficients: (0..model.sv.len()).map(|vector| model.sv_coef.iter().map(|row| row[vector]).collect()).collect(),
        vectors: model
            .sv
            .iter()
            .map(|nodes| {
                nodes.iter().map(|node| Bin { index: node.index as u32 - 1, weight: node.value as f32 }).collect()
            })
            .collect(),
    }
}
