//! Made-up histograms, models trained on them, and messages of them. Each test file uses a part of it.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use classifier::{BINS, BoostedTrees, Card, Method, ModelFiles, NaiveBayes, Params, TreeNode, solid_feature_names};
use libsvm_rs::{KernelType, SvmModel, SvmNode, SvmParameterBuilder, SvmProblem, SvmType};
use messages::{Bin, ClusterSummary, Descriptor, Descriptors, Fit};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use zerocopy::FromZeros;

/// Histograms of four made-up classes in turn: each favours a region of the bins; sum 1.
pub(crate) fn histograms(count: usize, seed: u64) -> Vec<(i32, Vec<Bin>)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|example| {
            let class = example % 4;
            let mut weights = std::collections::BTreeMap::new();
            for _ in 0..random.random_range(3..40) {
                let spread: u32 = random.random_range(0..60);
                let index = if random.random_bool(0.6) { class as u32 * 300 + spread } else { spread * 28 };
                *weights.entry(index).or_insert(0.0_f32) += random.random::<f32>();
            }
            let sum: f32 = weights.values().sum();
            let bins = weights.into_iter().map(|(index, weight)| Bin { index, weight: weight / sum }).collect();
            (class as i32 + 1, bins)
        })
        .collect()
}

pub(crate) fn nodes(bins: &[Bin]) -> Vec<SvmNode> {
    bins.iter().map(|bin| SvmNode { index: bin.index as i32 + 1, value: f64::from(bin.weight) }).collect()
}

/// A model of the first `classes` classes.
pub(crate) fn trained(classes: i32, count: usize, c: f64, probability: bool) -> SvmModel {
    libsvm_rs::set_quiet(true);
    let (labels, instances) = histograms(count, 1)
        .iter()
        .filter(|(label, _)| *label <= classes)
        .map(|(label, bins)| (f64::from(*label), nodes(bins)))
        .unzip();
    let parameter = SvmParameterBuilder::new()
        .svm_type(SvmType::CSvc)
        .kernel_type(KernelType::Rbf)
        .gamma(3.0)
        .c(c)
        .probability(probability)
        .build()
        .unwrap();
    libsvm_rs::train::svm_train(&SvmProblem { labels, instances }, &parameter)
}

pub(crate) fn text_of(model: &SvmModel) -> String {
    let mut bytes = Vec::new();
    libsvm_rs::io::save_model_to_writer(&mut bytes, model).unwrap();
    String::from_utf8(bytes).unwrap()
}

pub(crate) fn naive_bayes_text() -> String {
    let log_phi = (0..BINS).map(|bin| std::array::from_fn(|q| if bin / 300 == q { -3.0 } else { -9.0 })).collect();
    NaiveBayes::new(log_phi, [-1.386_294; 4], 10.0).unwrap().to_text()
}

pub(crate) fn card_text(kind: &str, file: &str, model: &[u8]) -> String {
    format!(
        "format = 1\nkind = \"{kind}\"\nfile = \"{file}\"\nsha256 = \"{}\"\n\n[features]\nbins = 1728\n\
         normalisation = \"sum-1\"\nneighbours = 5\nspacing_deg = 0.72\n\n[data]\n[parameters]\n[scores]\n",
        Card::checksum(model)
    )
}

pub(crate) fn svm_params(text: &str) -> Params {
    let files = ModelFiles { card: card_text("svm", "model.libsvm", text.as_bytes()), model: text.into() };
    Params { method: Method::Svm, model: "test".to_owned(), least_posterior: 0.0, overload: None, files: Some(files) }
}

pub(crate) fn naive_bayes_params() -> Params {
    let text = naive_bayes_text();
    let files = ModelFiles { card: card_text("naive-bayes", "model.txt", text.as_bytes()), model: text.into() };
    Params {
        method: Method::NaiveBayes,
        model: "test".to_owned(),
        least_posterior: 0.0,
        overload: None,
        files: Some(files),
    }
}

/// A message with a descriptor of `points` members and the given bins for each entry.
pub(crate) fn message(entries: &[(u32, Vec<Bin>)]) -> Box<Descriptors> {
    let mut message = Descriptors::new_box_zeroed().unwrap();
    message.header.sensor_time_ns = 11;
    for (points, bins) in entries {
        let first_member = message.members.len() as u32;
        let summary = ClusterSummary { key: first_member, first_member, points: *points, ..ClusterSummary::default() };
        let first_bin = message.bins.len() as u32;
        let bins_only = Descriptor { summary, first_bin, bins: bins.len() as u32, ..Descriptor::default() };
        message.descriptors.push(bins_only).unwrap();
        message.bins.extend_from_slice(bins).unwrap();
        for member in first_member..first_member + points {
            message.members.push(member).unwrap();
        }
    }
    message
}

/// Trees that say: the solid whose excess of cost is under 1 is e³ times as likely as each other.
pub(crate) fn trees_text() -> String {
    let names = solid_feature_names();
    let excess = |solid: &str| names.iter().position(|name| *name == format!("{solid}_excess")).unwrap() as u8;
    let trees = ["box", "ellipsoid", "cylinder", "cone"].map(|solid| {
        vec![TreeNode::Split { feature: excess(solid), threshold: 1.0 }, TreeNode::Leaf(3.0), TreeNode::Leaf(0.0)]
    });
    BoostedTrees::new(names.clone(), [0.0; 4], 1.0, &trees).unwrap().to_text()
}

pub(crate) fn trees_card(model: &[u8]) -> String {
    format!(
        "format = 1\nkind = \"boosted-trees\"\nfile = \"model.txt\"\nsha256 = \"{}\"\n\n[solids]\nevaluations = 30000\n\
         scouting_rays = 36\nrays = 96\nmost_misfit = 5.0\n\n[data]\n[parameters]\n[scores]\n",
        Card::checksum(model)
    )
}

pub(crate) fn trees_params(text: &str) -> Params {
    let files = ModelFiles { card: trees_card(text.as_bytes()), model: text.into() };
    Params {
        method: Method::BoostedTrees,
        model: "test".to_owned(),
        least_posterior: 0.0,
        overload: None,
        files: Some(files),
    }
}

/// A fit to 10 hits of which one solid explains each to `residual` standard deviations, and the others to twice that and
/// more.
pub(crate) fn fit(solid: usize, residual: f32) -> Fit {
    let mut fit = Fit { hits: 10, ..Fit::default() };
    for (place, of) in fit.solids.iter_mut().enumerate() {
        let times = if place == solid { 1.0 } else { 4.0 + place as f32 };
        of.hit_cost = 10.0 * residual * residual * times;
        of.solid.centre_m = [5.0, place as f32, 0.0];
        of.solid.size_m = [1.0, 1.0, 2.0];
    }
    fit
}

/// A message with a descriptor of `points` members and a fit, if any, for each entry.
pub(crate) fn fitted_message(entries: &[(u32, Option<Fit>)]) -> Box<Descriptors> {
    let bare: Vec<(u32, Vec<Bin>)> = entries.iter().map(|(points, _)| (*points, Vec::new())).collect();
    let mut message = message(&bare);
    for (place, (_, fit)) in entries.iter().enumerate() {
        message.descriptors[place].first_fit = message.fits.len() as u32;
        if let Some(fit) = fit {
            message.descriptors[place].fits = 1;
            message.fits.push(*fit).unwrap();
        }
    }
    message
}
