//! Gradient-boosted trees: each round fits, for each class, a tree to the gradients of the softmax's log loss, by
//! Newton's steps on histograms of the features (Friedman, "Greedy function approximation: a gradient boosting machine",
//! Annals of Statistics 29, 2001, Algorithm 6; Ke et al., "LightGBM", NeurIPS 2017, for histograms and growth by leaf).
//!
//! The same rows and parameters give the same model on any number of cores: what runs side by side is whole trees and
//! fixed blocks of rows, and sums are taken in the order of rows and blocks.

mod bins;
mod grow;
mod histogram;
mod params;
mod rows;
mod scored;

use classifier::{BoostedTrees, BoostedTreesError, TreeNode};
use lidar::ObstacleClass;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use self::bins::{Binned, Quantiles};
use self::grow::GrownTree;
pub use self::params::BoostingParams;
pub use self::rows::LabelledRows;
use self::scored::Scored;
use crate::parallel;

/// What was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedTrees {
    /// With temperature 1. Its rounds are those up to the least loss on the held-out rows, all where there are none.
    pub model: BoostedTrees,
    /// Losses before the first round and after each that was run.
    pub losses: Vec<RoundLoss>,
}

/// Mean log loss after a round, in nats, weighted as the rows are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundLoss {
    /// Rounds done.
    pub rounds: usize,
    /// On the rows trained on.
    pub training: f64,
    /// On the rows held out.
    pub held_out: Option<f64>,
}

/// Why there is nothing to fit, or no way.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitTreesError {
    /// A parameter is out of its range.
    #[error("{key} is {value}, must be {expected}")]
    Param {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// Features, classes and weights are not of the same rows.
    #[error("{what} has {found} entries, must have {expected}")]
    Length {
        /// Which of them.
        what: &'static str,
        /// Its length.
        found: usize,
        /// What it must be.
        expected: usize,
    },
    /// A class is none of the four solids.
    #[error("class of row {row} is {class}, must be 0 to 3")]
    Class {
        /// From 0.
        row: usize,
        /// Its class.
        class: u8,
    },
    /// A weight cannot be one.
    #[error("weight of row {row} is {weight}, must be 0 to 1000000")]
    Weight {
        /// From 0.
        row: usize,
        /// Its weight.
        weight: f32,
    },
    /// A class that cannot be learned.
    #[error("no row with a weight is {name}, must be at least one", name = .0.name())]
    NoRows(ObstacleClass),
    /// Nothing to measure a loss on.
    #[error("the weights of the held-out rows are all 0 or there are none, must have a row with a weight")]
    NothingHeldOut,
    /// The names of the features are no model's.
    #[error(transparent)]
    Model(#[from] BoostedTreesError),
}

/// Something that runs independent jobs and puts their results in the order of jobs.
trait Workers {
    fn map<J: Sync, R: Send>(&self, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R>;
}

struct AllCores;

impl Workers for AllCores {
    fn map<J: Sync, R: Send>(&self, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
        parallel::map(jobs, work)
    }
}

/// Fits to `training`; with rows held out, until their loss has not fallen for [`BoostingParams::patience`] rounds.
/// `progress` hears of each round.
///
/// # Errors
/// A parameter, row or name that does not hold, or a class without rows.
pub fn fit_trees(
    feature_names: &[String],
    training: &LabelledRows,
    held_out: Option<&LabelledRows>,
    params: &BoostingParams,
    progress: &mut dyn FnMut(&RoundLoss),
) -> Result<FittedTrees, FitTreesError> {
    fit_with(&AllCores, feature_names, training, held_out, params, progress)
}

fn fit_with(
    workers: &impl Workers,
    feature_names: &[String],
    training: &LabelledRows,
    held_out: Option<&LabelledRows>,
    params: &BoostingParams,
    progress: &mut dyn FnMut(&RoundLoss),
) -> Result<FittedTrees, FitTreesError> {
    params.check()?;
    let base = training.check(feature_names.len())?.log_shares()?;
    if held_out.map(|rows| rows.check(feature_names.len())).transpose()?.is_some_and(|rows| rows.weight() <= 0.0) {
        return Err(FitTreesError::NothingHeldOut);
    }
    // Before the work, not after it.
    BoostedTrees::new::<Vec<TreeNode>>(feature_names.to_vec(), base, 1.0, &[])?;

    let quantiles = Quantiles::of(workers, training, feature_names.len());
    let mut trained_on = Scored::new(workers, training, &quantiles, base);
    let mut held_out = held_out.map(|rows| Scored::new(workers, rows, &quantiles, base));
    let mut trees: Vec<Vec<TreeNode>> = Vec::new();
    let mut losses = Vec::new();
    let mut best = (f64::INFINITY, 0);
    loop {
        let rounds = trees.len() / 4;
        let held_out_loss = held_out.as_ref().map(Scored::loss);
        losses.push(RoundLoss { rounds, training: trained_on.loss(), held_out: held_out_loss });
        losses.last().into_iter().for_each(&mut *progress);
        // Where nothing is held out, the last round is the best.
        if held_out_loss.is_none_or(|loss| loss < best.0) {
            best = (held_out_loss.unwrap_or(f64::INFINITY), rounds);
        }
        if rounds == params.rounds || rounds - best.1 >= params.patience {
            break;
        }
        let four = round(workers, &trained_on, params, rounds as u64);
        trained_on.advance(workers, &four);
        if let Some(rows) = &mut held_out {
            rows.advance(workers, &four);
        }
        trees.extend(four.iter().map(|tree| tree.preorder(&quantiles)));
    }
    trees.truncate(4 * best.1);
    Ok(FittedTrees { model: BoostedTrees::new(feature_names.to_vec(), base, 1.0, &trees)?, losses })
}

/// A tree for each class.
fn round(workers: &impl Workers, rows: &Scored, params: &BoostingParams, number: u64) -> Vec<GrownTree> {
    let binned: &Binned = rows.binned();
    let bag = sample(&mut stream(params.seed, 8 * number), params.row_share, binned.rows() as u32);
    workers.map(&[0, 1, 2, 3], |&class| {
        let random = &mut stream(params.seed, 8 * number + 1 + class as u64);
        let features = sample(random, params.feature_share, binned.features() as u32);
        let gradients = bag.iter().map(|&row| rows.gradient(row as usize, class)).collect();
        grow::grow(binned, features, bag.clone(), gradients, params)
    })
}

/// Random numbers of their own for each purpose, whichever thread draws them.
fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

/// A share of the numbers under `count`, at least one, in order (Knuth, "The Art of Computer Programming", Sec. 3.4.2,
/// Algorithm S).
fn sample(random: &mut ChaCha8Rng, share: f64, count: u32) -> Vec<u32> {
    let mut wanted = ((share * f64::from(count)).round() as u32).clamp(1, count);
    let mut chosen = Vec::with_capacity(wanted as usize);
    for number in 0..count {
        if random.random_range(0..count - number) < wanted {
            chosen.push(number);
            wanted -= 1;
        }
    }
    chosen
}

#[cfg(test)]
mod exact;
#[cfg(test)]
mod tests;
