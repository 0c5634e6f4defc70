use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::{BINS, Method};

/// Version of cards and model files that this build reads and writes.
pub const FORMAT: u32 = 1;

/// How the extractor scales a descriptor: its weights sum to 1.
pub const NORMALISATION: &str = "sum-1";

/// `card.toml`: what a model is, beside its file in `config/models/<name>/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Version of card and model file: [`FORMAT`].
    pub format: u32,
    /// What the file holds.
    pub kind: Method,
    /// Name of the model file, in the card's own folder.
    pub file: String,
    /// Checksum of the model file, 64 hexadecimal digits.
    pub sha256: String,
    /// The histogram that the model expects; for Naive Bayes and the support vector machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub features: Option<FeatureDefinition>,
    /// The fit that the model expects; for boosted trees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solids: Option<SolidsDefinition>,
    /// What it was trained on: distribution, sensor, examples, seed. For people.
    pub data: toml::Table,
    /// What training chose. For people.
    pub parameters: toml::Table,
    /// What it reached on data it had not seen. For people.
    pub scores: toml::Table,
}

/// What a bin means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureDefinition {
    /// Joint bins: [`BINS`].
    pub bins: u32,
    /// Scale of the weights: [`NORMALISATION`].
    pub normalisation: String,
    /// `neighbours` of the extractor that made the training data.
    pub neighbours: u32,
    /// `spacing_deg` of the extractor that made the training data.
    pub spacing_deg: f64,
}

/// How the solids were fitted that a model was trained on, and which fits it judges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidsDefinition {
    /// `fit.evaluations` of the extractor.
    pub evaluations: u64,
    /// `fit.scouting_rays` of the extractor.
    pub scouting_rays: usize,
    /// `fit.rays` of the extractor.
    pub rays: usize,
    /// A cluster whose best solid is off by more ([`misfit`](crate::misfit)) is none of the four.
    pub most_misfit: f32,
}

/// Why a model is refused by its card.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CardError {
    /// Not TOML, or a key is missing, unknown or of the wrong type.
    #[error("card.toml: {0}")]
    Toml(String),
    /// Written by another version.
    #[error("format of card.toml is {0}, must be {FORMAT}")]
    Format(i64),
    /// The model is of another kind than the configuration asks for.
    #[error("kind is {found}, must be {wanted} as `method` says", found = .found.name(), wanted = .wanted.name())]
    Kind {
        /// In the card.
        found: Method,
        /// In the stage's parameters.
        wanted: Method,
    },
    /// The file is named by a path.
    #[error("file is {0:?}, must be a plain name in the card's folder")]
    File(String),
    /// What the kind of model expects is not said.
    #[error("[{table}] is missing, must be given for {kind}", kind = .kind.name())]
    Missing {
        /// The table.
        table: &'static str,
        /// The kind of model.
        kind: Method,
    },
    /// No fit passes, or every one.
    #[error("solids.most_misfit is {0}, must be positive and finite")]
    Misfit(f32),
    /// Trained on other features.
    #[error("features.bins is {0}, must be {BINS}")]
    Bins(u32),
    /// Trained on features of another scale.
    #[error("features.normalisation is {0:?}, must be {NORMALISATION:?}")]
    Normalisation(String),
    /// The model file is not the one that the card describes.
    #[error("sha256 of {file} is {found}, must be {expected} as card.toml says")]
    Checksum {
        /// The model file.
        file: String,
        /// Of the bytes at hand.
        found: String,
        /// In the card.
        expected: String,
    },
}

impl Card {
    /// Reads a card and checks what can be checked without its model.
    ///
    /// # Errors
    /// The first thing that does not hold; the version comes first.
    pub fn parse(text: &str) -> Result<Self, CardError> {
        let refused = |error: toml::de::Error| CardError::Toml(error.message().to_owned());
        let table: toml::Table = toml::from_str(text).map_err(refused)?;
        match table.get("format").and_then(toml::Value::as_integer) {
            Some(format) if format != i64::from(FORMAT) => return Err(CardError::Format(format)),
            _ => {}
        }
        let card: Self = table.try_into().map_err(refused)?;
        if card.file.is_empty() || card.file.contains(['/', '\\']) || card.file.starts_with('.') {
            return Err(CardError::File(card.file));
        }
        card.check_features()?;
        Ok(card)
    }

    fn check_features(&self) -> Result<(), CardError> {
        let missing = |table| CardError::Missing { table, kind: self.kind };
        if self.kind == Method::BoostedTrees {
            let most_misfit = self.solids.as_ref().ok_or(missing("solids"))?.most_misfit;
            let holds = most_misfit > 0.0 && most_misfit.is_finite();
            return if holds { Ok(()) } else { Err(CardError::Misfit(most_misfit)) };
        }
        let features = self.features.as_ref().ok_or(missing("features"))?;
        if features.bins as usize != BINS {
            return Err(CardError::Bins(features.bins));
        }
        if features.normalisation != NORMALISATION {
            return Err(CardError::Normalisation(features.normalisation.clone()));
        }
        Ok(())
    }

    /// Checks that the card is of the kind asked for and describes these bytes.
    ///
    /// # Errors
    /// [`CardError::Kind`] or [`CardError::Checksum`].
    pub fn vouch(&self, wanted: Method, model: &[u8]) -> Result<(), CardError> {
        if self.kind != wanted {
            return Err(CardError::Kind { found: self.kind, wanted });
        }
        let found = Self::checksum(model);
        if !found.eq_ignore_ascii_case(&self.sha256) {
            return Err(CardError::Checksum { file: self.file.clone(), found, expected: self.sha256.clone() });
        }
        Ok(())
    }

    /// SHA-256 of a model file, as a card writes it.
    pub fn checksum(model: &[u8]) -> String {
        Sha256::digest(model).iter().map(|byte| format!("{byte:02x}")).collect()
    }
}
