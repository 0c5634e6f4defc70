use serde::{Deserialize, Serialize};

use crate::{BoostingParams, FitTreesError, PlanError};

/// A plan for boosted trees on fitted solids, as written: `config/training/solids.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidsPlan {
    /// The model's folder.
    pub name: String,
    /// Seed of everything random but the trees' own choices.
    pub seed: u64,
    /// What the trees are fitted to.
    pub training: Vec<SetPlan>,
    /// What temperature and misfit are chosen on.
    pub calibration: SetPlan,
    /// What the card's scores are of.
    pub test: SetPlan,
    /// Share of true solids that may be called none of the four.
    pub false_alarm: f64,
    /// How the trees are fitted.
    pub trees: BoostingParams,
}

/// Scenes of a set. Every one has another seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetPlan {
    /// Stem of the scene's file.
    pub scene: String,
    /// Number of scenes.
    pub scenes: u64,
    /// Sensor in place of the scene's own.
    pub sensor: Option<String>,
    /// Standard deviation of a range in place of the sensor's [m].
    pub range_sigma_m: Option<f64>,
    /// Share of lost echoes in place of the scene's.
    pub dropout: Option<f64>,
    /// Smallest and largest proportion in place of the scene's.
    pub proportion: Option<[f64; 2]>,
    /// Larger clusters are left out.
    pub most_points: Option<u32>,
}

/// Why a plan for solids is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolidsPlanError {
    /// A key does not hold.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The trees' parameters do not hold.
    #[error("trees: {0}")]
    Trees(#[from] FitTreesError),
}

/// Most scenes of a set: sets of one plan are this many seeds apart.
const MOST_SCENES: u64 = 1_000_000;

impl SolidsPlan {
    /// Checks the plan.
    ///
    /// # Errors
    /// The first key that does not hold.
    pub fn check(&self) -> Result<(), SolidsPlanError> {
        if self.name.is_empty() || self.name.contains(['/', '\\', '.']) {
            return Err(PlanError::Name(self.name.clone()).into());
        }
        if self.training.is_empty() {
            return Err(PlanError::Empty("training").into());
        }
        for set in self.training.iter().chain([&self.calibration, &self.test]) {
            let holds = (1..=MOST_SCENES).contains(&set.scenes);
            number("scenes", set.scenes as f64, holds, "1 to 1000000")?;
        }
        let holds = (0.0..=0.5).contains(&self.false_alarm);
        number("false_alarm", self.false_alarm, holds, "0 to 0.5")?;
        Ok(self.trees.check()?)
    }

    /// Seed of the first scene of a set: training sets in order, then calibration, then test.
    pub(super) fn first_seed(&self, set: usize) -> u64 {
        self.seed.wrapping_add(set as u64 * MOST_SCENES)
    }
}

fn number(key: &'static str, value: f64, holds: bool, expected: &'static str) -> Result<(), PlanError> {
    if holds { Ok(()) } else { Err(PlanError::Number { key, value, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> SolidsPlan {
        toml::from_str(include_str!("../../../../config/training/solids.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_holds() {
        shipped().check().unwrap();
    }

    #[test]
    fn each_broken_key_is_refused_by_name() {
        let refused = |breaks: fn(&mut SolidsPlan)| {
            let mut plan = shipped();
            breaks(&mut plan);
            plan.check().unwrap_err().to_string()
        };
        assert!(refused(|p| p.name = "a/b".to_owned()).contains("a/b"));
        assert!(refused(|p| p.training.clear()).contains("training is empty"));
        assert!(refused(|p| p.test.scenes = 0).contains("scenes is 0"));
        assert!(refused(|p| p.false_alarm = 0.7).contains("false_alarm is 0.7"));
        assert!(refused(|p| p.trees.leaves = 1).contains("leaves is 1"));
    }

    #[test]
    fn no_two_sets_share_a_seed() {
        let plan = shipped();
        assert!(plan.first_seed(1) - plan.first_seed(0) >= MOST_SCENES);
    }
}
