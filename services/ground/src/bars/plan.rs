use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::bar::BARS;

/// `config/evaluation/*.toml`, as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationPlan {
    /// Stem of the scene whose distribution accuracies refer to.
    pub scene: String,
    /// How many scenes of it.
    pub scenes: u32,
    /// Scene n has this seed + n, a field in motion this + 2³² + n.
    pub seed: u64,
    /// The same scenes with one thing changed.
    pub variants: VariantsPlan,
    /// Evidence summed over sweeps.
    pub sweeps: SweepsPlan,
    /// Time of a fit.
    pub fit: FitPlan,
    /// Accuracy and time against a fit's budget.
    pub budget: BudgetPlan,
    /// Targets by the keys of [`crate::Bar`]; a bar that is left out is measured and not judged.
    pub bars: BTreeMap<String, f64>,
}

/// One thing changed at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantsPlan {
    /// How many of the scenes.
    pub scenes: u32,
    /// Standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// Share of echoes that are lost.
    pub dropout: f64,
    /// Smallest and largest of the lesser extents as a share of the largest.
    pub proportion: [f64; 2],
    /// Stem of a sensor of many columns.
    pub dense_sensor: String,
    /// How many of the scenes it sees.
    pub dense_scenes: u32,
}

/// Log posteriors summed over sweeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepsPlan {
    /// Stem of a scene in motion.
    pub scene: String,
    /// How many scenes of it.
    pub scenes: u32,
    /// Sweeps of each.
    pub sweeps: u32,
}

/// What fits are timed on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitPlan {
    /// Stem of the scene.
    pub scene: String,
    /// Its first sweeps.
    pub sweeps: u32,
    /// Times that each is extracted.
    pub passes: u32,
}

/// The curve over a fit's budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BudgetPlan {
    /// How many of the scenes.
    pub scenes: u32,
    /// Values of the extractor's `fit.evaluations`.
    pub evaluations: Vec<u64>,
}

/// Why a plan is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationPlanError {
    /// A count is out of its range.
    #[error("{key} is {value}, must be {least} to {most}")]
    Count {
        /// The key, with its table.
        key: &'static str,
        /// Its value.
        value: u64,
        /// Least that it may be.
        least: u64,
        /// Most that it may be.
        most: u64,
    },
    /// A number is out of its range.
    #[error("{key} is {value}, must be {least} to {most}")]
    Number {
        /// The key, with its table.
        key: &'static str,
        /// Its value.
        value: f64,
        /// Least that it may be.
        least: f64,
        /// Most that it may be.
        most: f64,
    },
    /// Targets name a bar that is none.
    #[error("bars.{key} is no bar, must be one of {known}")]
    Unknown {
        /// The key.
        key: String,
        /// Those there are.
        known: String,
    },
    /// A target that nothing can be compared with.
    #[error("bars.{key} is {value}, must be finite")]
    Target {
        /// The key.
        key: String,
        /// Its value.
        value: f64,
    },
}

impl EvaluationPlan {
    /// Checks the plan. Whether scenes and sensors hold is found when they are read.
    ///
    /// # Errors
    /// The first key that does not hold.
    pub fn check(&self) -> Result<(), EvaluationPlanError> {
        let count = |key, value: u64, least, most| match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(EvaluationPlanError::Count { key, value, least, most }),
        };
        count("scenes", self.scenes.into(), 1, 100_000)?;
        count("seed", self.seed, 0, i64::MAX as u64)?;
        count("variants.scenes", self.variants.scenes.into(), 0, self.scenes.into())?;
        count("variants.dense_scenes", self.variants.dense_scenes.into(), 0, self.scenes.into())?;
        count("sweeps.scenes", self.sweeps.scenes.into(), 0, 100_000)?;
        count("sweeps.sweeps", self.sweeps.sweeps.into(), 1, 1_000)?;
        count("fit.sweeps", self.fit.sweeps.into(), 1, 1_000)?;
        count("fit.passes", self.fit.passes.into(), 1, 1_000)?;
        count("budget.scenes", self.budget.scenes.into(), 0, self.scenes.into())?;
        for (key, &value) in &self.bars {
            if BARS.iter().all(|bar| bar.key != key) {
                let known = BARS.map(|bar| bar.key).join(", ");
                return Err(EvaluationPlanError::Unknown { key: key.clone(), known });
            }
            if !value.is_finite() {
                return Err(EvaluationPlanError::Target { key: key.clone(), value });
            }
        }
        Ok(())
    }

    /// Seed of the n-th scene of the distribution.
    pub(crate) fn scene_seed(&self, number: u32) -> u64 {
        self.seed.wrapping_add(number.into())
    }

    /// Seed of the n-th scene in motion.
    pub(crate) fn moving_seed(&self, number: u32) -> u64 {
        self.seed.wrapping_add(1 << 32).wrapping_add(number.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> EvaluationPlan {
        toml::from_str(include_str!("../../../../config/evaluation/reference.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_holds_and_has_a_target_for_every_bar() {
        assert_eq!(plan().check(), Ok(()));
        let mut keys = BARS.map(|bar| bar.key);
        keys.sort_unstable();
        assert!(plan().bars.keys().map(String::as_str).eq(keys));
    }

    #[test]
    fn no_two_scenes_have_the_same_seed_nor_that_of_a_training_plan() {
        let plan = plan();
        assert!(plan.scene_seed(plan.scenes) < plan.moving_seed(0));
        assert!(plan.scene_seed(0) > 1 << 55, "training's seeds lie far below");
    }

    #[test]
    fn each_broken_key_is_refused_by_name() {
        let refused = |breaks: fn(&mut EvaluationPlan)| {
            let mut plan = plan();
            breaks(&mut plan);
            plan.check().unwrap_err().to_string()
        };
        assert_eq!(refused(|p| p.scenes = 0), "scenes is 0, must be 1 to 100000");
        assert_eq!(refused(|p| p.variants.scenes = 201), "variants.scenes is 201, must be 0 to 200");
        assert_eq!(refused(|p| p.budget.scenes = 201), "budget.scenes is 201, must be 0 to 200");
        assert_eq!(refused(|p| p.sweeps.sweeps = 0), "sweeps.sweeps is 0, must be 1 to 1000");
        assert_eq!(refused(|p| p.fit.passes = 0), "fit.passes is 0, must be 1 to 1000");
        assert!(refused(|p| p.bars = [("speed".to_owned(), 1.0)].into()).starts_with("bars.speed is no bar, must be"));
        assert!(refused(|p| p.bars = [("fit_ms".to_owned(), f64::NAN)].into()).starts_with("bars.fit_ms is NaN"));
    }
}
