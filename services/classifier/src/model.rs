use lidar::ObstacleClass;
use messages::{Bin, Descriptors};

use crate::{
    BoostedTrees, BoostedTreesFileError, Card, CardError, Decision, MAX_CLASSES, Method, ModelFiles, NaiveBayes,
    NaiveBayesFileError, Svm, SvmFile, SvmFileError, misfit, solid_feature_names, solid_features,
};

/// A model ready to judge.
#[derive(Clone, Debug)]
pub enum Model {
    /// Naive Bayes.
    NaiveBayes(NaiveBayes),
    /// Support vector machine.
    Svm(SolidSvm),
    /// Boosted trees.
    BoostedTrees(SolidTrees),
}

/// Boosted trees that judge fitted solids.
#[derive(Clone, Debug)]
pub struct SolidTrees {
    trees: BoostedTrees,
    most_misfit: f32,
}

/// A support vector machine whose labels are the four solids.
#[derive(Clone, Debug)]
pub struct SolidSvm {
    svm: Svm,
    /// The solid's place of each label.
    solids: [usize; MAX_CLASSES],
}

/// What a model says of one descriptor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// The verdict.
    pub class: ObstacleClass,
    /// Probability of each of [`ObstacleClass::SOLIDS`]; sums to 1, or all 0 for `Unclassified`.
    pub posterior: [f32; 4],
}

/// Why a model is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Its card does not hold, or not for these bytes or this method.
    #[error(transparent)]
    Card(#[from] CardError),
    /// The file is not text.
    #[error("{0} is not UTF-8 text")]
    NotText(String),
    /// The file is no Naive Bayes model.
    #[error("{0}: {1}")]
    NaiveBayes(String, NaiveBayesFileError),
    /// The file is no SVM model of ours.
    #[error("{0}: {1}")]
    Svm(String, SvmFileError),
    /// The labels do not name the four solids.
    #[error(
        "{file}: label is {found:?}, must name each of 1 to 4 once (rectangular, ellipsoidal, cylindrical, conical)"
    )]
    Labels {
        /// The model file.
        file: String,
        /// Its labels.
        found: Vec<i32>,
    },
    /// The file holds no boosted trees.
    #[error("{0}: {1}")]
    BoostedTrees(String, BoostedTreesFileError),
    /// Trained on other features than this build makes.
    #[error("{file}: feature {place} is {found:?}, must be {expected:?}")]
    Features {
        /// The model file.
        file: String,
        /// From 1.
        place: usize,
        /// Its name in the file; empty where the file has fewer.
        found: String,
        /// Its name in this build; empty where it has fewer.
        expected: String,
    },
    /// The model cannot give a posterior.
    #[error("{0} has no probA and probB, must be trained with probabilities")]
    NoProbabilities(String),
}

impl Model {
    /// Checks a model's files and makes it ready.
    ///
    /// # Errors
    /// The first check that fails, cheapest first: card, kind, checksum, file.
    pub fn load(method: Method, files: &ModelFiles) -> Result<Self, ModelError> {
        let card = Card::parse(&files.card)?;
        card.vouch(method, &files.model)?;
        let (file, solids) = (card.file, card.solids);
        let Ok(text) = std::str::from_utf8(&files.model) else {
            return Err(ModelError::NotText(file));
        };
        match method {
            Method::NaiveBayes => match NaiveBayes::parse(text) {
                Ok(model) => Ok(Self::NaiveBayes(model)),
                Err(error) => Err(ModelError::NaiveBayes(file, error)),
            },
            Method::Svm => match SvmFile::parse(text) {
                Ok(read) => Self::from_svm(file, Svm::new(&read)),
                Err(error) => Err(ModelError::Svm(file, error)),
            },
            Method::BoostedTrees => {
                let trees = BoostedTrees::parse(text).map_err(|error| ModelError::BoostedTrees(file.clone(), error))?;
                fits_features(file, trees.feature_names())?;
                // A card of this kind has the table.
                let most_misfit = solids.map_or(f32::INFINITY, |solids| solids.most_misfit);
                Ok(Self::BoostedTrees(SolidTrees { trees, most_misfit }))
            }
        }
    }

    /// Whether it judges histograms, not solids.
    pub(crate) fn judges_histograms(&self) -> bool {
        !matches!(self, Self::BoostedTrees(_))
    }

    fn from_svm(file: String, svm: Svm) -> Result<Self, ModelError> {
        let solid_of = |place: usize| {
            let label = svm.labels().get(place).copied().unwrap_or(0);
            ObstacleClass::SOLIDS.iter().position(|&solid| solid as i32 == label)
        };
        let mut solids = [0; MAX_CLASSES];
        let mut named = [false; MAX_CLASSES];
        for (place, solid) in solids.iter_mut().enumerate() {
            match solid_of(place) {
                Some(found) if !named[found] => {
                    named[found] = true;
                    *solid = found;
                }
                _ => return Err(ModelError::Labels { file, found: svm.labels().to_vec() }),
            }
        }
        if !svm.has_probabilities() {
            return Err(ModelError::NoProbabilities(file));
        }
        Ok(Self::Svm(SolidSvm { svm, solids }))
    }

    /// Judges a histogram: at least one bin, indices under 1728 in rising order. Boosted trees say `Unclassified`: they
    /// judge solids.
    ///
    /// Naive Bayes takes the most likely class, the SVM the one with the most votes; equals go to the first in the
    /// paper's order (for the SVM: in the order of the file's labels).
    pub fn judge(&self, bins: &[Bin]) -> Judgement {
        match self {
            Self::NaiveBayes(model) => from_naive_bayes(model, bins),
            Self::Svm(model) => judgement(&model.svm, &model.solids, &model.svm.decide(bins)),
            Self::BoostedTrees(_) => Judgement::NONE,
        }
    }

    /// Judges a fitted cluster by its features and its misfit; `Unclassified` from models that judge histograms.
    pub fn judge_solid(&self, features: &[f32], misfit: f32) -> Judgement {
        match self {
            Self::BoostedTrees(model) => model.judge(features, misfit),
            Self::NaiveBayes(_) | Self::Svm(_) => Judgement::NONE,
        }
    }

    /// Judges every descriptor of a sweep that has what the model judges, giving `each` its place and the judgement.
    pub(crate) fn judge_all(&mut self, input: &Descriptors, mut each: impl FnMut(usize, Judgement)) {
        let described = || {
            input
                .descriptors
                .iter()
                .enumerate()
                .filter(|(_, d)| d.bins > 0)
                .map(|(p, d)| (p, &input.bins[d.bin_places()]))
        };
        match self {
            Self::NaiveBayes(model) => {
                for (place, bins) in described() {
                    each(place, from_naive_bayes(model, bins));
                }
            }
            Self::Svm(model) => {
                let SolidSvm { svm, solids } = model;
                let mut places = described().map(|(place, _)| place);
                svm.decide_all(described().map(|(_, bins)| bins), |svm, _, decision| {
                    if let Some(place) = places.next() {
                        each(place, judgement(svm, solids, &decision));
                    }
                });
            }
            Self::BoostedTrees(model) => {
                for (place, descriptor) in input.descriptors.iter().enumerate() {
                    let Some(fit) = descriptor.fit_place().map(|fit| &input.fits[fit]) else { continue };
                    let features = solid_features(&input.header, &descriptor.summary, fit);
                    each(place, model.judge(&features, misfit(fit)));
                }
            }
        }
    }
}

impl Judgement {
    /// None of the four.
    pub const NONE: Self = Self { class: ObstacleClass::Unclassified, posterior: [0.0; 4] };

    /// The most likely class; among equals the first in the paper's order.
    fn most_likely(posterior: [f64; 4]) -> Self {
        let most = (1..4).fold(0, |most, q| if posterior[q] > posterior[most] { q } else { most });
        Self { class: ObstacleClass::SOLIDS[most], posterior: posterior.map(|p| p as f32) }
    }
}

impl SolidTrees {
    /// None of the four where the best solid does not explain the rays.
    fn judge(&self, features: &[f32], misfit: f32) -> Judgement {
        if misfit > self.most_misfit {
            return Judgement::NONE;
        }
        Judgement::most_likely(self.trees.posterior(features))
    }
}

/// Whether a model was trained on the features that this build makes.
fn fits_features(file: String, found: &[String]) -> Result<(), ModelError> {
    let expected = solid_feature_names();
    for place in 0..expected.len().max(found.len()) {
        if expected.get(place) != found.get(place) {
            let name = |names: &[String]| names.get(place).cloned().unwrap_or_default();
            return Err(ModelError::Features { file, place: place + 1, found: name(found), expected: name(&expected) });
        }
    }
    Ok(())
}

/// What a support vector machine's decision says of the solids, given the solid of each label.
fn judgement(svm: &Svm, solids: &[usize; MAX_CLASSES], decision: &Decision) -> Judgement {
    let mut posterior = [0.0; 4];
    for (place, probability) in svm.posterior(decision).into_iter().enumerate() {
        posterior[solids[place]] = probability as f32;
    }
    Judgement { class: ObstacleClass::SOLIDS[solids[decision.winner]], posterior }
}

fn from_naive_bayes(model: &NaiveBayes, bins: &[Bin]) -> Judgement {
    Judgement::most_likely(model.posterior(bins))
}
