//! A model that does not fit is refused at start, by name.

mod common;

use classifier::{Classifier, Method, ModelFiles, Params};
use common::{naive_bayes_params, svm_params, text_of, trained, trees_params, trees_text};
use stage::Stage;

fn refusal(params: Params) -> String {
    Classifier::init(params).expect_err("must be refused").to_string()
}

fn spoilt(from: &str, to: &str) -> String {
    let mut params = naive_bayes_params();
    if let Some(files) = &mut params.files {
        assert!(files.card.contains(from), "{from}");
        files.card = files.card.replace(from, to);
    }
    refusal(params)
}

// verifies CLA-005
#[test]
fn a_card_that_does_not_fit_is_refused() {
    assert!(Classifier::init(naive_bayes_params()).is_ok());
    assert_eq!(spoilt("format = 1", "format = 2"), "model \"test\": format of card.toml is 2, must be 1");
    assert_eq!(spoilt("bins = 1728", "bins = 125"), "model \"test\": features.bins is 125, must be 1728");
    assert!(spoilt("sum-1", "unit").contains("features.normalisation is \"unit\", must be \"sum-1\""));
    assert!(spoilt("model.txt", "../model.txt").contains("file is \"../model.txt\", must be a plain name"));
    assert!(spoilt("[scores]", "[marks]").contains("card.toml: unknown field `marks`"));
    assert!(spoilt("[scores]", "").contains("missing field `scores`"));
    assert!(spoilt("format = 1", "format 1").contains("card.toml: "));
    assert!(spoilt("format = 1", "").contains("missing field `format`"));
}

#[test]
fn a_model_of_another_kind_than_the_method_is_refused() {
    let kind = spoilt("naive-bayes", "svm");
    assert_eq!(kind, "model \"test\": kind is svm, must be naive-bayes as `method` says");
    let params = Params { method: Method::Svm, ..naive_bayes_params() };
    assert_eq!(refusal(params), "model \"test\": kind is naive-bayes, must be svm as `method` says");
}

#[test]
fn a_model_file_of_another_checksum_is_refused() {
    let mut params = naive_bayes_params();
    if let Some(files) = &mut params.files {
        files.model.push(b'\n');
    }
    let refusal = refusal(params);
    assert!(refusal.starts_with("model \"test\": sha256 of model.txt is "), "{refusal}");
    assert!(refusal.ends_with(" as card.toml says"), "{refusal}");
}

#[test]
fn a_model_file_that_is_none_is_refused() {
    assert!(refusal(svm_params("nonsense")).contains("model.libsvm: line 1: nonsense is"));
    let files = ModelFiles { card: common::card_text("svm", "model.libsvm", &[0xff]), model: vec![0xff] };
    let params = Params {
        method: Method::Svm,
        model: "test".to_owned(),
        least_posterior: 0.0,
        overload: None,
        files: Some(files),
    };
    assert!(refusal(params).contains("model.libsvm is not UTF-8 text"));
}

#[test]
fn an_svm_without_probabilities_or_with_other_labels_is_refused() {
    let plain = text_of(&trained(4, 60, 1.0, false));
    assert!(refusal(svm_params(&plain)).contains("has no probA and probB"));
    let text = text_of(&trained(4, 60, 1.0, true));
    assert!(Classifier::init(svm_params(&text)).is_ok());
    for labels in ["0 1 2 3", "1 2 3 3", "1 2 3 5"] {
        let refusal = refusal(svm_params(&text.replace("label 1 2 3 4", &format!("label {labels}"))));
        assert!(refusal.contains("must name each of 1 to 4 once"), "{refusal}");
    }
    assert!(refusal(svm_params(&text_of(&trained(3, 60, 1.0, true)))).contains("label is [1, 2, 3]"));
}

// verifies CLA-005
#[test]
fn trees_without_their_definition_or_on_other_features_are_refused() {
    assert!(Classifier::init(trees_params(&trees_text())).is_ok());
    let spoilt = |from: &str, to: &str| {
        let mut params = trees_params(&trees_text());
        if let Some(files) = &mut params.files {
            assert!(files.card.contains(from), "{from}");
            files.card = files.card.replace(from, to);
        }
        refusal(params)
    };
    assert_eq!(
        spoilt("most_misfit = 5.0", "most_misfit = 0.0"),
        "model \"test\": solids.most_misfit is 0, must be positive and finite"
    );
    assert!(spoilt("most_misfit = 5.0", "").contains("missing field `most_misfit`"));
    let kind = spoilt("boosted-trees", "svm");
    assert_eq!(kind, "model \"test\": [features] is missing, must be given for svm");
    let renamed = trees_text().replacen("box_excess", "box_surplus", 1);
    let refused = refusal(trees_params(&renamed));
    assert_eq!(refused, "model \"test\": model.txt: feature 1 is \"box_surplus\", must be \"box_excess\"");
    assert!(refusal(trees_params("encke boosted-trees 9\n")).contains("model.txt: line 1 is"));
}

#[test]
fn a_model_that_was_not_given_is_refused() {
    let params = Params { files: None, ..naive_bayes_params() };
    assert_eq!(refusal(params), "files of model \"test\" were not given");
}
