use serde::{Deserialize, Serialize};

/// `config/training/*.toml`, as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainPlan {
    /// Stem of the scene whose first field is the distribution of obstacles.
    pub scene: String,
    /// Obstacles of each class to train on.
    pub examples: usize,
    /// Obstacles of each class, seen alone, to test on.
    pub held_out: usize,
    /// Cluttered scenes of each class to test on.
    pub cluttered_scenes: usize,
    /// Stem of the sensor that also looks at the cluttered scenes.
    pub dense_sensor: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Folds of the cross-validation.
    pub folds: usize,
    /// For Naive Bayes.
    pub naive_bayes: NaiveBayesPlan,
    /// For the support vector machine.
    pub svm: SvmPlan,
    /// For the reproduction of the paper's results; training alone does without.
    pub reproduction: Option<ReproductionPlan>,
}

/// What the reproduction of the paper's results needs besides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReproductionPlan {
    /// Sizes of the training set, obstacles of each class, for the curve of Fig. 7; all of `examples` comes last by itself.
    pub convergence: Vec<usize>,
    /// Examples of each class to train on where a choice is measured.
    pub choice_examples: usize,
    /// Examples of each class that C is then chosen on.
    pub choice_subset: usize,
    /// Stem of a scene whose field is nearer than the tests': the training of Fig. 6's blue circle.
    pub near_scene: String,
    /// Seed of the scene of Fig. 6.
    pub picture_seed: u64,
}

/// How Naive Bayes is fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NaiveBayesPlan {
    /// The model's folder.
    pub name: String,
    /// Additive smoothing to choose from.
    pub smoothing: Vec<f64>,
}

/// How the support vector machine is fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvmPlan {
    /// The model's folder.
    pub name: String,
    /// γ of the kernel exp(−γ‖x − s‖²).
    pub gamma: f64,
    /// Costs C to choose from.
    pub c: Vec<f64>,
    /// Examples of each class that C is chosen on.
    pub subset: usize,
}

/// Why a plan is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A number is out of its range.
    #[error("{key} is {value}, must be {expected}")]
    Number {
        /// The key, with its table.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// Nothing to choose from.
    #[error("{0} is empty, must have at least one value")]
    Empty(&'static str),
    /// The reproduction's table is not there.
    #[error("reproduction is missing, must be given: sizes of the curve and of the choices")]
    NoReproduction,
    /// A folder's name is a path, or both models have the same.
    #[error("name is {0:?}, must be a plain name, another for each model")]
    Name(String),
}

impl TrainPlan {
    /// Checks the plan.
    ///
    /// # Errors
    /// The first key that does not hold.
    pub fn check(&self) -> Result<(), PlanError> {
        let whole = |key, value: usize, least: usize, most: usize, expected| {
            number(key, value as f64, (least..=most).contains(&value), expected)
        };
        whole("folds", self.folds, 2, 20, "2 to 20")?;
        whole("examples", self.examples, self.folds, 100_000, "at least folds and at most 100000")?;
        whole("held_out", self.held_out, 1, 100_000, "1 to 100000")?;
        whole("cluttered_scenes", self.cluttered_scenes, 1, 10_000, "1 to 10000")?;
        whole("svm.subset", self.svm.subset, self.folds, self.examples, "at least folds and at most examples")?;
        number("svm.gamma", self.svm.gamma, positive(self.svm.gamma), "positive and finite")?;
        for (key, values) in [("naive_bayes.smoothing", &self.naive_bayes.smoothing), ("svm.c", &self.svm.c)] {
            if values.is_empty() {
                return Err(PlanError::Empty(key));
            }
            for &value in values {
                number(key, value, positive(value), "positive and finite")?;
            }
        }
        let names = [&self.naive_bayes.name, &self.svm.name];
        for name in names {
            let plain = !name.is_empty() && !name.contains(['/', '\\', '.']);
            if !plain || names[0] == names[1] {
                return Err(PlanError::Name(name.clone()));
            }
        }
        Ok(())
    }

    /// The reproduction's part of a plan, checked against the rest. Training alone needs none of it.
    ///
    /// # Errors
    /// A plan without one, or the first key of it that does not hold.
    pub fn reproduction(&self) -> Result<&ReproductionPlan, PlanError> {
        let reproduction = self.reproduction.as_ref().ok_or(PlanError::NoReproduction)?;
        let whole = |key, value: usize, least: usize, most: usize, expected| {
            number(key, value as f64, (least..=most).contains(&value), expected)
        };
        let (choice, subset) = (reproduction.choice_examples, reproduction.choice_subset);
        for &size in &reproduction.convergence {
            whole("reproduction.convergence", size, 1, self.examples, "1 to examples")?;
        }
        let expected = "at least folds and at most examples";
        whole("reproduction.choice_examples", choice, self.folds, self.examples, expected)?;
        let expected = "at least folds and at most choice_examples";
        whole("reproduction.choice_subset", subset, self.folds, choice, expected)?;
        Ok(reproduction)
    }
}

fn positive(value: f64) -> bool {
    value > 0.0 && value < f64::INFINITY
}

fn number(key: &'static str, value: f64, holds: bool, expected: &'static str) -> Result<(), PlanError> {
    if holds { Ok(()) } else { Err(PlanError::Number { key, value, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> TrainPlan {
        toml::from_str(include_str!("../../../config/training/paper.toml")).unwrap()
    }

    #[test]
    fn the_shipped_plan_holds_and_is_the_papers() {
        assert_eq!(plan().check(), Ok(()));
        assert!(plan().reproduction().is_ok());
        assert_eq!((plan().examples, plan().folds, plan().svm.gamma), (2_000, 5, 3.0));
    }

    #[test]
    fn each_broken_key_is_refused_by_name() {
        let refused = |breaks: fn(&mut TrainPlan)| {
            let mut plan = plan();
            breaks(&mut plan);
            plan.check().unwrap_err().to_string()
        };
        let reproduction = |breaks: fn(&mut ReproductionPlan)| {
            let mut plan = plan();
            breaks(plan.reproduction.as_mut().unwrap());
            assert_eq!(plan.check(), Ok(()), "training needs none of it");
            plan.reproduction().unwrap_err().to_string()
        };
        assert!(refused(|p| p.folds = 1).starts_with("folds is 1, must be 2 to 20"));
        assert!(refused(|p| p.examples = 4).starts_with("examples is 4"));
        assert!(refused(|p| p.held_out = 0).starts_with("held_out is 0"));
        assert!(refused(|p| p.cluttered_scenes = 0).starts_with("cluttered_scenes is 0"));
        assert!(refused(|p| p.svm.subset = 2_001).starts_with("svm.subset is 2001"));
        assert!(refused(|p| p.svm.gamma = f64::NAN).starts_with("svm.gamma is NaN"));
        assert!(refused(|p| p.svm.c.clear()).starts_with("svm.c is empty"));
        assert!(refused(|p| p.naive_bayes.smoothing[1] = -1.0).starts_with("naive_bayes.smoothing is -1"));
        assert!(
            reproduction(|r| r.convergence.push(0)).starts_with("reproduction.convergence is 0, must be 1 to examples")
        );
        assert!(reproduction(|r| r.choice_examples = 2_001).starts_with("reproduction.choice_examples is 2001"));
        assert!(reproduction(|r| r.choice_subset = 4).starts_with("reproduction.choice_subset is 4"));
        assert!(refused(|p| p.svm.name = "../x".to_owned()).starts_with("name is \"../x\""));
        assert!(refused(|p| p.svm.name = p.naive_bayes.name.clone()).starts_with("name is"));
    }
}
