use std::fmt;

use crate::Confusion;

/// What the models reached on obstacles that they were not trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainReport {
    /// One entry for each model: Naive Bayes, then the support vector machine.
    pub models: Vec<ModelReport>,
}

/// What one model reached.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelReport {
    /// Its folder.
    pub name: String,
    /// On obstacles seen alone.
    pub alone: Confusion,
    /// On cluttered scenes of one shape each: the paper's Tables I and II.
    pub cluttered: Confusion,
    /// On the same scenes, seen by the dense sensor.
    pub dense: Confusion,
    /// Classified clusters of the cluttered scenes (own sensor) whose verdict is not the class of the greatest posterior.
    pub against_posterior: u32,
}

impl fmt::Display for TrainReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, model) in self.models.iter().enumerate() {
            let gap = if place > 0 { "\n" } else { "" };
            writeln!(f, "{gap}{}, obstacles seen alone [%]\n{}", model.name, model.alone)?;
            writeln!(f, "\n{}, cluttered scenes of one shape [%]\n{}", model.name, model.cluttered)?;
            writeln!(f, "{:>12}  {} verdicts against the greatest posterior", "", model.against_posterior)?;
            writeln!(f, "\n{}, the same scenes seen by the dense sensor [%]\n{}", model.name, model.dense)?;
        }
        Ok(())
    }
}
