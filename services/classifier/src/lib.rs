//! What an obstacle is: boosted trees on fitted solids, or the paper's Naive Bayes (Eqs. 5 to 7) and support vector machine
//! (Sec. V-2), choosable.
//!
//! `Descriptors` in, [`Detections`](messages::Detections) out. A model is a file with a [`Card`] beside it that says what it
//! is, what features it expects and its checksum; a model that does not fit is refused at start.
//!
//! ```
//! use classifier::NaiveBayes;
//! use messages::Bin;
//! // Two bins matter: 0 speaks for the first class, 1 for the second.
//! let mut log_phi = vec![[-9.0; 4]; 1728];
//! log_phi[0][0] = -1.0;
//! log_phi[1][1] = -1.0;
//! let model = NaiveBayes::new(log_phi, [0.25_f64.ln(); 4], 1.0).unwrap();
//! let posterior = model.posterior(&[Bin { index: 1, weight: 1.0 }]);
//! assert!(posterior[1] > 0.99);
//! ```

mod boosted_trees;
mod boosted_trees_file;
mod card;
mod coupling;
mod exponential;
mod kernel;
mod model;
mod naive_bayes;
mod naive_bayes_file;
mod params;
mod room;
mod solid_features;
mod svm;
mod svm_file;
mod tile;

pub use boosted_trees::{
    BoostedTrees, BoostedTreesError, MAX_FEATURES, MAX_NODES, MAX_ROUNDS, MAX_TEMPERATURE, MIN_TEMPERATURE, TreeError,
    TreeNode, softmax,
};
pub use boosted_trees_file::BoostedTreesFileError;
pub use card::{Card, CardError, FORMAT, FeatureDefinition, NORMALISATION, SolidsDefinition};
pub use coupling::{couple, pairwise_probability};
pub use model::{Judgement, Model, ModelError, SolidSvm, SolidTrees};
pub use naive_bayes::{NaiveBayes, NaiveBayesError};
pub use naive_bayes_file::NaiveBayesFileError;
pub use params::{Method, ModelFiles, OverloadParams, Params};
pub use room::{Classifier, ClassifierError};
pub use solid_features::{SOLID_FEATURES, misfit, solid_feature_names, solid_features};
pub use svm::{Decision, MAX_CLASSES, PAIRS, Svm};
pub use svm_file::{SvmFile, SvmFileError};

/// Joint bins of a descriptor (paper, Sec. III-B.3).
pub const BINS: usize = 1_728;
