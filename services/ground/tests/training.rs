//! Training from end to end on few examples: repeatable, and accepted by the classifier.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use classifier::{Card, Classifier, Method, ModelFiles, Params};
use ground::{TrainPlan, Trained, train};
use stage::Stage;

fn read(path: &str) -> std::io::Result<String> {
    std::fs::read_to_string(format!("{}/../../config/{path}", env!("CARGO_MANIFEST_DIR")))
}

fn small_plan() -> TrainPlan {
    let mut plan: TrainPlan = toml::from_str(&read("training/paper.toml").unwrap()).unwrap();
    plan.examples = 40;
    plan.held_out = 10;
    plan.cluttered_scenes = 1;
    plan.folds = 4;
    plan.svm.subset = 20;
    plan.svm.c = vec![1.0, 30.0];
    plan
}

fn trained(plan: &TrainPlan) -> Trained {
    train(plan, &read, &mut |_| ()).unwrap()
}

fn files(trained: &Trained) -> Vec<(String, Vec<u8>)> {
    trained.files().map(|(path, bytes)| (path, bytes.to_vec())).collect()
}

// verifies GND-001
#[test]
fn the_same_plan_gives_the_same_bytes_and_another_seed_others() {
    let once = files(&trained(&small_plan()));
    assert_eq!(once, files(&trained(&small_plan())));
    let other = files(&trained(&TrainPlan { seed: 1, ..small_plan() }));
    assert_ne!(once, other);
}

// verifies GND-002
#[test]
fn the_classifier_takes_what_training_writes() {
    let folder = std::env::temp_dir().join(format!("encke-training-{}", std::process::id()));
    let plan = small_plan();
    let trained = trained(&plan);
    trained.write_to(&folder).unwrap();
    for (method, model) in [(Method::NaiveBayes, &plan.naive_bayes.name), (Method::Svm, &plan.svm.name)] {
        let card = std::fs::read_to_string(folder.join(model).join("card.toml")).unwrap();
        let parsed = Card::parse(&card).unwrap();
        let model_bytes = std::fs::read(folder.join(model).join(&parsed.file)).unwrap();
        assert!(parsed.scores["cluttered"]["mean_per_cent"].as_float().unwrap() > 0.0);
        assert_eq!(parsed.data["examples_of_each_class"].as_integer(), Some(40));
        let files = Some(ModelFiles { card, model: model_bytes });
        assert!(
            Classifier::init(Params { method, model: model.clone(), least_posterior: 0.0, overload: None, files })
                .is_ok()
        );
    }
    std::fs::remove_dir_all(&folder).unwrap();
    let held_out: u32 = trained.report.models[0].alone.counts().iter().flatten().sum();
    assert_eq!(held_out, 40);
}

#[test]
fn what_cannot_be_read_is_named() {
    let plan = small_plan();
    let refused = |plan: &TrainPlan, read: &dyn Fn(&str) -> std::io::Result<String>| {
        train(plan, read, &mut |_| ()).unwrap_err().to_string()
    };
    let missing = TrainPlan { scene: "nowhere".to_owned(), ..plan.clone() };
    assert!(refused(&missing, &read).starts_with("scenes/nowhere.toml: "));
    let broken =
        |path: &str| Ok(if path == "stages/extractor.toml" { "neighbours = 5".to_owned() } else { read(path)? });
    assert!(refused(&plan, &broken).contains("stages/extractor.toml: "));
    let bare = |path: &str| {
        let text = read(path)?;
        Ok(if path.starts_with("scenes/") { text[..text.find("[[field]]").unwrap()].to_owned() } else { text })
    };
    assert_eq!(refused(&plan, &bare), "scenes/reference.toml: field is missing, must be given once: it is drawn from");
    assert_eq!(refused(&TrainPlan { folds: 1, ..plan }, &read), "folds is 1, must be 2 to 20");
}
