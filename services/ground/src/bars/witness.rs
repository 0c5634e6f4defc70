//! Who looks and judges: an observer with a classifier behind it.

use messages::{Descriptors, Detections, Message, Verdict};
use zerocopy::FromZeros;

use super::EvaluateError;
use super::judged::{Judged, judged};
use super::plan::EvaluationPlan;
use crate::{Files, Observer, View, parallel};

/// A classifier: fills the detections, which arrive empty.
pub type Judge = Box<dyn FnMut(&Descriptors, &mut Detections) -> Verdict>;

/// Makes a classifier for any thread; each must say the same of the same descriptors.
pub type Judges<'a> = &'a (dyn Fn() -> Judge + Sync);

/// Scenes that one core looks at in a row.
const SCENES_A_JOB: u32 = 5;

/// One observer and one classifier.
pub(crate) struct Witness {
    pub(crate) observer: Observer,
    pub(crate) bench: Bench,
}

/// A classifier and what it said last.
pub(crate) struct Bench {
    judge: Judge,
    detections: Box<Detections>,
}

impl Witness {
    pub(crate) fn new(view: &View, read: Files<'_>, judges: Judges<'_>) -> Result<Self, EvaluateError> {
        let detections = Detections::new_box_zeroed().map_err(|_| EvaluateError::NoMemory)?;
        let bench = Bench { judge: judges(), detections };
        Ok(Self { observer: Observer::new(view, &read)?, bench })
    }

    /// Clusters of the n-th sweep of the scene with this seed.
    pub(crate) fn look(&mut self, seed: u64, sweep: u64) -> Result<Vec<Judged>, EvaluateError> {
        self.observer.show(Some(seed), sweep)?;
        let seen = self.observer.seen();
        let detections = self.bench.detect(seen.descriptors)?;
        Ok(judged(seen, detections))
    }
}

impl Bench {
    /// What it said last.
    pub(crate) fn detections(&self) -> &Detections {
        &self.detections
    }

    /// What the classifier says of a sweep.
    pub(crate) fn detect(&mut self, descriptors: &Descriptors) -> Result<&Detections, EvaluateError> {
        self.detections.clear();
        let verdict = (self.judge)(descriptors, &mut self.detections);
        if verdict.is_rejected() || self.detections.detections.len() != descriptors.descriptors.len() {
            return Err(EvaluateError::Rejected(verdict));
        }
        Ok(&self.detections)
    }
}

/// The clusters of the plan's first scenes, as `view` has them: one sweep each, on all cores.
pub(crate) fn scenes(
    plan: &EvaluationPlan,
    view: &View,
    scenes: u32,
    read: Files<'_>,
    judges: Judges<'_>,
) -> Result<Vec<Judged>, EvaluateError> {
    let jobs: Vec<u32> = (0..scenes).step_by(SCENES_A_JOB as usize).collect();
    let done = parallel::map(&jobs, |&first| -> Result<Vec<Judged>, EvaluateError> {
        let mut witness = Witness::new(view, read, judges)?;
        let mut found = Vec::new();
        for number in first..(first + SCENES_A_JOB).min(scenes) {
            found.extend(witness.look(plan.scene_seed(number), 0)?);
        }
        Ok(found)
    });
    done.into_iter().collect::<Result<Vec<_>, _>>().map(|jobs| jobs.into_iter().flatten().collect())
}
