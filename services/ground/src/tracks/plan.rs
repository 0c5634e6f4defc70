use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::bars::BARS;
use crate::EvaluationPlanError;

/// `config/evaluation/tracks.toml`, as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TracksPlan {
    /// Stem of the scene in motion that tracks are measured on.
    pub scene: String,
    /// How many scenes of it.
    pub scenes: u32,
    /// Sweeps of each.
    pub sweeps: u32,
    /// Scene n has this seed + n, the n-th scene of encounters this + 2³² + n, that of times this + 2³³.
    pub seed: u64,
    /// A track lies on an obstacle when their centres are this far apart, or nearer [m].
    pub match_m: f64,
    /// Other such distances that are told and not judged [m].
    pub also_m: Vec<f64>,
    /// Distance at which two points are not similar at all [m]: HOTA's.
    pub zero_m: f64,
    /// Obstacles that come near.
    pub encounters: EncountersPlan,
    /// Time of the tracker.
    pub cost: CostPlan,
    /// Targets by the keys of [`crate::Bar`]; a bar that is left out is measured and not judged.
    pub bars: BTreeMap<String, f64>,
}

/// Obstacles on courses past the sensor, and into it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncountersPlan {
    /// How many.
    pub count: u32,
    /// In a scene, each from a direction of its own.
    pub together: u32,
    /// How long they are in view before they are judged [s].
    pub track_s: f64,
    /// How long before their closest approach they are judged [s].
    pub lead_s: f64,
    /// Least and most speed [m/s]; uniform between.
    pub speed_mps: [f64; 2],
    /// The centre's closest distance is uniform from 0 to this far beyond contact of the own ball and a ball round the
    /// obstacle [m].
    pub beyond_m: f64,
}

/// What the tracker is timed on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CostPlan {
    /// Obstacles of the scene.
    pub obstacles: usize,
    /// Its first sweeps.
    pub sweeps: u32,
}

impl TracksPlan {
    /// Checks the plan. Whether the scene holds is found when it is read.
    ///
    /// # Errors
    /// The first key that does not hold.
    pub fn check(&self) -> Result<(), EvaluationPlanError> {
        let count = |key, value: u64, least, most| match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(EvaluationPlanError::Count { key, value, least, most }),
        };
        let number = |key, value: f64, least, most| match (least..=most).contains(&value) {
            true => Ok(()),
            false => Err(EvaluationPlanError::Number { key, value, least, most }),
        };
        let EncountersPlan { count: encounters, together, track_s, lead_s, speed_mps: [slow, fast], beyond_m } =
            self.encounters;
        count("scenes", self.scenes.into(), 1, 100_000)?;
        count("sweeps", self.sweeps.into(), 1, 10_000)?;
        count("seed", self.seed, 0, i64::MAX as u64)?;
        number("match_m", self.match_m, 0.01, 100.0)?;
        self.also_m.iter().try_for_each(|&also_m| number("also_m", also_m, 0.01, 100.0))?;
        number("zero_m", self.zero_m, 0.01, 100.0)?;
        count("encounters.count", encounters.into(), 0, 1_000_000)?;
        count("encounters.together", together.into(), 1, 8)?;
        number("encounters.track_s", track_s, 0.1, 100.0)?;
        number("encounters.lead_s", lead_s, 0.1, 1_000.0)?;
        number("encounters.speed_mps[0]", slow, 0.01, 100.0)?;
        number("encounters.speed_mps[1]", fast, slow, 100.0)?;
        number("encounters.beyond_m", beyond_m, 0.0, 100.0)?;
        count("cost.obstacles", self.cost.obstacles as u64, 1, 1_000)?;
        count("cost.sweeps", self.cost.sweeps.into(), 1, 10_000)?;
        for (key, &value) in &self.bars {
            if BARS.iter().all(|bar| bar.key != key) {
                let known = BARS.iter().map(|bar| bar.key).collect::<Vec<_>>().join(", ");
                return Err(EvaluationPlanError::Unknown { key: key.clone(), known });
            }
            if !value.is_finite() {
                return Err(EvaluationPlanError::Target { key: key.clone(), value });
            }
        }
        Ok(())
    }

    pub(crate) fn scene_seed(&self, number: u32) -> u64 {
        self.seed.wrapping_add(number.into())
    }

    pub(crate) fn encounter_seed(&self, number: u32) -> u64 {
        self.seed.wrapping_add(1 << 32).wrapping_add(number.into())
    }

    pub(crate) fn cost_seed(&self) -> u64 {
        self.seed.wrapping_add(1 << 33)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> TracksPlan {
        toml::from_str(include_str!("../../../../config/evaluation/tracks.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_holds_and_its_targets_are_bars() {
        assert_eq!(plan().check(), Ok(()));
        assert_eq!(plan().encounters.count, 1_000);
        assert!(plan().bars.len() > 10);
    }

    #[test]
    fn no_two_scenes_have_the_same_seed_nor_that_of_a_plan_of_the_classifier() {
        let plan = plan();
        assert!(plan.scene_seed(plan.scenes) < plan.encounter_seed(0));
        assert!(plan.encounter_seed(plan.encounters.count) < plan.cost_seed());
        let classifier: crate::EvaluationPlan =
            toml::from_str(include_str!("../../../../config/evaluation/reference.toml")).unwrap();
        assert!(plan.seed > classifier.moving_seed(u32::MAX));
    }

    #[test]
    fn each_broken_key_is_refused_by_name() {
        let refused = |breaks: fn(&mut TracksPlan)| {
            let mut plan = plan();
            breaks(&mut plan);
            plan.check().unwrap_err().to_string()
        };
        assert_eq!(refused(|p| p.scenes = 0), "scenes is 0, must be 1 to 100000");
        assert_eq!(refused(|p| p.match_m = 0.0), "match_m is 0, must be 0.01 to 100");
        assert_eq!(refused(|p| p.also_m = vec![f64::NAN]), "also_m is NaN, must be 0.01 to 100");
        assert_eq!(refused(|p| p.encounters.together = 9), "encounters.together is 9, must be 1 to 8");
        assert_eq!(
            refused(|p| p.encounters.speed_mps = [0.5, 0.4]),
            "encounters.speed_mps[1] is 0.4, must be 0.5 to 100"
        );
        assert_eq!(refused(|p| p.cost.obstacles = 0), "cost.obstacles is 0, must be 1 to 1000");
        assert!(refused(|p| p.bars = [("speed".to_owned(), 1.0)].into()).starts_with("bars.speed is no bar, must be"));
        assert!(
            refused(|p| p.bars = [("tracker_ms".to_owned(), f64::NAN)].into()).starts_with("bars.tracker_ms is NaN")
        );
    }
}
