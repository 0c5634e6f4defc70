use serde::{Deserialize, Serialize};

/// `config/stages/classifier.toml`, as written, and the model that it names, as the shell read it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Which classifier judges.
    pub method: Method,
    /// Name of the model: a folder of `config/models/`.
    pub model: String,
    /// A class less likely than this is not claimed: the cluster stays unclassified \[0 to 1\].
    pub least_posterior: f32,
    /// What judges when no solids are fitted for overload; without it clusters then stay unclassified.
    pub overload: Option<OverloadParams>,
    /// The model's files; not in the TOML file. The shell fills them in before the stage starts.
    #[serde(skip)]
    pub files: Option<ModelFiles>,
}

/// `[overload]` of `config/stages/classifier.toml`, as written, and its model.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverloadParams {
    /// Which classifier judges histograms at the step "paper-features".
    pub method: Method,
    /// Name of its model.
    pub model: String,
    /// As above.
    #[serde(skip)]
    pub files: Option<ModelFiles>,
}

/// The classifiers: the two of Sec. V, and one that goes beyond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Naive Bayes, Eqs. 5 to 7.
    NaiveBayes,
    /// Support vector machine with a Gaussian kernel.
    Svm,
    /// Boosted trees on fitted solids.
    BoostedTrees,
}

impl Method {
    /// The method's word in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NaiveBayes => "naive-bayes",
            Self::Svm => "svm",
            Self::BoostedTrees => "boosted-trees",
        }
    }
}

/// A model as it lies in its folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelFiles {
    /// Text of `card.toml`.
    pub card: String,
    /// Bytes of the file that the card names.
    pub model: Vec<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_names_a_method_and_a_model() {
        let params: Params = toml::from_str(include_str!("../../../config/stages/classifier.toml")).unwrap();
        let overload = OverloadParams { method: Method::Svm, model: "paper-svm".to_owned(), files: None };
        assert_eq!(
            params,
            Params {
                method: Method::BoostedTrees,
                model: "solids".to_owned(),
                least_posterior: 0.0,
                overload: Some(overload),
                files: None
            }
        );
    }

    #[test]
    fn unknown_keys_and_methods_are_refused() {
        let refused = |text| toml::from_str::<Params>(text).unwrap_err().to_string();
        assert!(refused("method = \"svm\"\nmodel = \"m\"\nleast_posterior = 0.0\ngamma = 3\n").contains("gamma"));
        assert!(refused("method = \"svm\"\nmodel = \"m\"\nfiles = 3\n").contains("files"));
        assert!(refused("method = \"forest\"\nmodel = \"m\"\n").contains("`naive-bayes`"));
    }
}
