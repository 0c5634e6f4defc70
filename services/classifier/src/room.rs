use messages::{Descriptors, Detection, Detections, Part, Step, Verdict};
use stage::{InitError, Stage};

use crate::{BINS, Judgement, Method, Model, ModelError, ModelFiles, Params};

/// The stage: descriptors in, detections out.
#[derive(Clone, Debug)]
pub struct Classifier {
    model: Model,
    /// Judges histograms where overload leaves no solids to judge.
    standby: Option<Model>,
    least_posterior: f32,
}

/// Why the classifier cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClassifierError {
    /// The shell gave no model.
    #[error("files of model {0:?} were not given")]
    NoFiles(String),
    /// Solids are just what there is none of then.
    #[error("overload.method is boosted-trees, must be svm or naive-bayes: no solids are fitted under overload")]
    Overload,
    /// No posterior is as likely, or none less.
    #[error("least_posterior is {0}, must be 0 to 1")]
    LeastPosterior(f32),
    /// The model does not hold.
    #[error("model {name:?}: {cause}")]
    Model {
        /// Its folder.
        name: String,
        /// What does not hold.
        #[source]
        cause: ModelError,
    },
}

impl Stage for Classifier {
    const NAME: &'static str = "classifier";
    type Params = Params;
    type Input = Descriptors;
    type Output = Detections;

    fn init(params: Params) -> Result<Self, InitError> {
        let least_posterior = params.least_posterior;
        if !(0.0..=1.0).contains(&least_posterior) {
            return Err(InitError::new(ClassifierError::LeastPosterior(least_posterior)));
        }
        let model = load(params.method, params.model, params.files).map_err(InitError::new)?;
        let standby = match params.overload {
            None => None,
            Some(overload) if overload.method == Method::BoostedTrees => {
                return Err(InitError::new(ClassifierError::Overload));
            }
            Some(overload) => Some(load(overload.method, overload.model, overload.files).map_err(InitError::new)?),
        };
        Ok(Self { model, standby, least_posterior })
    }

    fn process(&mut self, part: Part, input: &Descriptors, output: &mut Detections) -> Verdict {
        output.header = input.header;
        if !is_well_formed(input) || output.members.extend_from_slice(&input.members).is_err() {
            return Verdict::RejectedMalformed;
        }
        for descriptor in &input.descriptors {
            // Cannot overflow: both messages hold as many.
            let _ = output.detections.push(Detection { summary: descriptor.summary, ..Detection::default() });
        }
        let detections = &mut output.detections;
        let least = self.least_posterior;
        let model = match part.step() {
            Step::Nominal | Step::FewerStarts => Some(&mut self.model),
            Step::PaperFeatures if self.model.judges_histograms() => Some(&mut self.model),
            Step::PaperFeatures => self.standby.as_mut(),
            Step::ClustersOnly | Step::EverySecondSweep => None,
        };
        let Some(model) = model else { return Verdict::Complete };
        model.judge_all(input, |place, judgement| {
            let claimed = judgement.class.solid_index().is_some_and(|class| judgement.posterior[class] >= least);
            let judgement = if claimed { judgement } else { Judgement::NONE };
            detections[place].class = judgement.class;
            detections[place].posterior = judgement.posterior;
        });
        for (descriptor, detection) in input.descriptors.iter().zip(output.detections.iter_mut()) {
            detection.first_solid = output.solids.len() as u32;
            let Some((fit, solid)) = descriptor.fit_place().zip(detection.class.solid_index()) else { continue };
            // Cannot overflow: both messages hold as many.
            if output.solids.push(input.fits[fit].solids[solid].solid).is_ok() {
                detection.solids = 1;
            }
        }
        Verdict::Complete
    }
}

fn load(method: Method, name: String, files: Option<ModelFiles>) -> Result<Model, ClassifierError> {
    let Some(files) = files else { return Err(ClassifierError::NoFiles(name)) };
    Model::load(method, &files).map_err(|cause| ClassifierError::Model { name, cause })
}

/// Whether the descriptors part members, bins and fits among them, in order, and every bin and fit is one.
fn is_well_formed(input: &Descriptors) -> bool {
    let mut next_member: u64 = 0;
    let mut next_bin: u64 = 0;
    let mut next_fit: u64 = 0;
    for descriptor in &input.descriptors {
        let summary = descriptor.summary;
        if u64::from(summary.first_member) != next_member || u64::from(descriptor.first_bin) != next_bin {
            return false;
        }
        if u64::from(descriptor.first_fit) != next_fit || descriptor.fits > 1 {
            return false;
        }
        next_fit += u64::from(descriptor.fits);
        next_member += u64::from(summary.points);
        next_bin += u64::from(descriptor.bins);
    }
    if next_member != input.members.len() as u64
        || next_bin != input.bins.len() as u64
        || next_fit != input.fits.len() as u64
        || !input.fits.iter().flat_map(|fit| &fit.solids).all(|solid| solid.cost().is_finite())
    {
        return false;
    }
    input.descriptors.iter().all(|descriptor| {
        let bins = &input.bins[descriptor.bin_places()];
        bins.is_sorted_by(|a, b| a.index < b.index)
            && bins.iter().all(|bin| (bin.index as usize) < BINS && (0.0..=1.0).contains(&bin.weight))
    })
}
