use classifier::MAX_ROUNDS;
use serde::{Deserialize, Serialize};

use super::FitTreesError;

/// How trees are boosted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoostingParams {
    /// Rounds at most, each with a tree for each class.
    pub rounds: usize,
    /// Rounds without a lesser loss on the held-out rows after which it ends; without such rows nothing ends early.
    pub patience: usize,
    /// Share of Newton's step that a leaf takes.
    pub learning_rate: f64,
    /// Leaves of a tree at most.
    pub leaves: usize,
    /// Rows of a leaf at least.
    pub min_rows: usize,
    /// Added to a leaf's sum of second derivatives: draws small leaves to 0.
    pub lambda_l2: f64,
    /// Share of the features that a tree may split by, drawn anew for each.
    pub feature_share: f64,
    /// Share of the rows that a round's trees see, drawn anew for each round.
    pub row_share: f64,
    /// Seed of everything random.
    pub seed: u64,
}

impl BoostingParams {
    /// Checks the parameters.
    ///
    /// # Errors
    /// The first key that does not hold.
    pub fn check(&self) -> Result<(), FitTreesError> {
        let whole = |key, value: usize, least: usize, most: usize, expected| {
            number(key, value as f64, (least..=most).contains(&value), expected)
        };
        let share = |key, value: f64| number(key, value, value > 0.0 && value <= 1.0, "over 0 and at most 1");
        whole("rounds", self.rounds, 1, MAX_ROUNDS, "1 to 10000")?;
        whole("patience", self.patience, 1, MAX_ROUNDS, "1 to 10000")?;
        share("learning_rate", self.learning_rate)?;
        whole("leaves", self.leaves, 2, 4_096, "2 to 4096")?;
        whole("min_rows", self.min_rows, 1, 1_000_000, "1 to 1000000")?;
        number("lambda_l2", self.lambda_l2, (0.0..=1e6).contains(&self.lambda_l2), "0 to 1000000")?;
        share("feature_share", self.feature_share)?;
        share("row_share", self.row_share)
    }
}

fn number(key: &'static str, value: f64, holds: bool, expected: &'static str) -> Result<(), FitTreesError> {
    if holds { Ok(()) } else { Err(FitTreesError::Param { key, value, expected }) }
}
