//! A classifier that is timed: the chain's own, its support vector machine, or a file of another.

use std::hash::Hasher;
use std::path::Path;

use classifier::{Classifier, Decision, Method, Svm, SvmFile};
use messages::{Descriptors, Detections, MAX_CLUSTERS, Message};
use runtime::Plan;
use stage::Stage;
use zerocopy::IntoBytes;

use super::stages::{PART, Rejected, zeroed};
use crate::assets::Assets;
use crate::{Failure, dispatch};

/// The model where the chain's classifier is another than an SVM.
const PAPER_SVM: &str = "paper-svm";

/// A classifier, and what it said last.
pub(super) struct Judge {
    /// The model's name, or its file's.
    pub(super) name: String,
    /// 0 where the model is no support vector machine.
    pub(super) support_vectors: usize,
    by: By,
}

enum By {
    Stage { classifier: Box<Classifier>, detections: Box<Detections> },
    File { svm: Box<Svm>, decisions: Vec<Decision> },
}

impl Judge {
    /// The classifier as the chain has it.
    pub(super) fn configured(plan: &Plan, assets: &Assets) -> Result<Self, Failure> {
        Self::stage(plan, assets, |_| {})
    }

    /// The classifier as the chain has it, with its method set to SVM.
    pub(super) fn svm(plan: &Plan, assets: &Assets) -> Result<Self, Failure> {
        Self::stage(plan, assets, |params| {
            if params.method != Method::Svm {
                params.method = Method::Svm;
                params.model = PAPER_SVM.to_owned();
            }
        })
    }

    /// The support vector machine in this file.
    pub(super) fn of_file(path: &Path) -> Result<Self, Failure> {
        let named = |cause: &dyn std::fmt::Display| Failure::start(format!("--model {}: {cause}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|cause| named(&cause))?;
        let svm = Svm::new(&SvmFile::parse(&text).map_err(|cause| named(&cause))?);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let decisions = Vec::with_capacity(MAX_CLUSTERS);
        Ok(Self { name, support_vectors: svm.support_vectors(), by: By::File { svm: Box::new(svm), decisions } })
    }

    fn stage(plan: &Plan, assets: &Assets, choose: impl FnOnce(&mut classifier::Params)) -> Result<Self, Failure> {
        let (mut name, mut support_vectors) = (String::new(), 0);
        let classifier = dispatch::init::<Classifier>(plan, |params| {
            choose(params);
            dispatch::add_model(plan, assets, params)?;
            name.clone_from(&params.model);
            if params.method == Method::Svm {
                // What is wrong with the file, the stage says.
                let text = params.files.as_ref().and_then(|files| std::str::from_utf8(&files.model).ok());
                support_vectors = text.and_then(|text| SvmFile::parse(text).ok()).map_or(0, |file| file.vectors.len());
            }
            Ok(())
        })?;
        let by = By::Stage { classifier: Box::new(classifier), detections: zeroed()? };
        Ok(Self { name, support_vectors, by })
    }

    /// Judges every descriptor that has what the model judges.
    pub(super) fn process(&mut self, input: &Descriptors) -> Result<(), Rejected> {
        match &mut self.by {
            By::Stage { classifier, detections } => {
                detections.clear();
                Rejected::unless_taken(Classifier::NAME, classifier.process(PART, input, detections))
            }
            By::File { svm, decisions } => {
                decisions.clear();
                let described = input.descriptors.iter().filter(|descriptor| descriptor.bins > 0);
                let described = described.map(|descriptor| &input.bins[descriptor.bin_places()]);
                svm.decide_all(described, |_, _, decision| decisions.push(decision));
                Ok(())
            }
        }
    }

    /// What it said last; none where only decisions are timed.
    pub(super) fn detections(&self) -> Option<&Detections> {
        match &self.by {
            By::Stage { detections, .. } => Some(detections),
            By::File { .. } => None,
        }
    }

    pub(super) fn write(&self, hash: &mut dyn Hasher) {
        match &self.by {
            By::Stage { detections, .. } => {
                hash.write(detections.detections.item_bytes());
                hash.write(detections.solids.item_bytes());
            }
            By::File { decisions, .. } => {
                for decision in decisions {
                    hash.write_usize(decision.winner);
                    hash.write(decision.values.as_bytes());
                }
            }
        }
    }
}
