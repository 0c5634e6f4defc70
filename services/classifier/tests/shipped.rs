//! The models in config/models/ are what their cards say, and the classifier takes them.

use classifier::{Card, Classifier, Method, ModelFiles, Params, Svm, SvmFile};
use libsvm_rs::SvmNode;
use libsvm_rs::predict::predict_values;
use stage::Stage;

fn files(name: &str, file: &str) -> ModelFiles {
    let folder = format!("{}/../../config/models/{name}", env!("CARGO_MANIFEST_DIR"));
    let read = |file: &str| std::fs::read(format!("{folder}/{file}")).expect(file);
    ModelFiles { card: String::from_utf8(read("card.toml")).expect("text"), model: read(file) }
}

// verifies CLA-008
#[test]
fn each_shipped_model_is_accepted_by_its_method_alone() {
    for (method, other, name, file) in [
        (Method::NaiveBayes, Method::Svm, "paper-nb", "model.txt"),
        (Method::Svm, Method::NaiveBayes, "paper-svm", "model.libsvm"),
    ] {
        let files = files(name, file);
        let card = Card::parse(&files.card).expect("a card");
        let features = card.features.expect("a histogram");
        assert_eq!((card.file.as_str(), features.neighbours, features.spacing_deg), (file, 5, 0.72));
        assert_eq!(card.data["examples_of_each_class"].as_integer(), Some(2_000));
        let params = |method| Params {
            method,
            model: name.to_owned(),
            least_posterior: 0.0,
            overload: None,
            files: Some(files.clone()),
        };
        assert!(Classifier::init(params(method)).is_ok());
        assert!(Classifier::init(params(other)).is_err());
    }
}

// verifies CLA-008
#[test]
fn the_shipped_trees_are_accepted_and_reached_what_the_chain_promises() {
    let files = files("solids", "model.txt");
    let card = Card::parse(&files.card).expect("a card");
    assert!(card.scores["right_per_cent"].as_float().expect("a number") > 92.0);
    assert!(card.scores["false_alarm_per_cent"].as_float().expect("a number") <= 1.0);
    let params = Params {
        method: Method::BoostedTrees,
        model: "solids".to_owned(),
        least_posterior: 0.0,
        overload: None,
        files: Some(files),
    };
    assert!(Classifier::init(params).is_ok());
}

#[test]
fn the_shipped_svm_decides_as_libsvm_rs_does_on_the_same_file() {
    let files = files("paper-svm", "model.libsvm");
    let text = std::str::from_utf8(&files.model).expect("text");
    let reference = libsvm_rs::io::load_model_from_reader(text.as_bytes()).expect("a libsvm file");
    let file = SvmFile::parse(text).expect("a libsvm file");
    let sut = Svm::new(&file);
    // Every 40th support vector, as a descriptor.
    for bins in file.vectors.iter().step_by(40) {
        let nodes: Vec<SvmNode> =
            bins.iter().map(|bin| SvmNode { index: bin.index as i32 + 1, value: f64::from(bin.weight) }).collect();
        let mut expected = [0.0; 6];
        predict_values(&reference, &nodes, &mut expected);
        for (found, expected) in sut.decide(bins).values.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-3, "{found} is not {expected}");
        }
    }
}
