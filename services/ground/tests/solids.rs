//! Boosted trees on fitted solids from end to end, on few scenes: repeatable, and accepted by the classifier.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use classifier::{Card, Classifier, Method, Params};
use ground::{SolidsPlan, TrainSolidsError, TrainedSolids, train_solids};
use stage::Stage;

fn read(path: &str) -> std::io::Result<String> {
    std::fs::read_to_string(format!("{}/../../config/{path}", env!("CARGO_MANIFEST_DIR")))
}

/// The shipped plan with few scenes and few trees.
fn small_plan() -> SolidsPlan {
    let mut plan: SolidsPlan = toml::from_str(&read("training/solids.toml").unwrap()).unwrap();
    plan.training.truncate(2);
    for set in plan.training.iter_mut().chain([&mut plan.calibration, &mut plan.test]) {
        set.scenes = 6;
    }
    plan.false_alarm = 0.05;
    plan.trees.rounds = 20;
    plan.trees.min_rows = 5;
    plan.trees.learning_rate = 0.2;
    plan
}

fn trained(plan: &SolidsPlan) -> TrainedSolids {
    train_solids(plan, &read, &mut |_| ()).unwrap()
}

// verifies GND-001
#[test]
fn the_same_plan_gives_the_same_model_and_another_seed_another() {
    let once = trained(&small_plan()).files;
    assert_eq!(once, trained(&small_plan()).files);
    assert_ne!(once, trained(&SolidsPlan { seed: 5, ..small_plan() }).files);
}

// verifies GND-002
#[test]
fn the_classifier_takes_the_model_and_its_card_says_what_it_reached() {
    let trained = trained(&small_plan());
    let card = Card::parse(&trained.files.card).unwrap();
    let right = card.scores["right_per_cent"].as_float().unwrap();
    assert!((right / 100.0 - trained.report.right).abs() < 1e-3);
    assert!(right > 60.0, "far above chance with few trees: {right}");
    assert_eq!(card.scores["clusters"].as_integer(), Some(trained.report.clusters as i64));
    let counted: u32 = trained.report.confusion.counts().iter().flatten().sum();
    let none: u32 = trained.report.confusion.unclassified().iter().sum();
    assert_eq!((counted + none) as usize, trained.report.clusters);
    let params = Params {
        method: Method::BoostedTrees,
        model: trained.name.clone(),
        least_posterior: 0.0,
        overload: None,
        files: Some(trained.files.clone()),
    };
    assert!(Classifier::init(params).is_ok());
    let folder = std::env::temp_dir().join(format!("encke-solids-{}", std::process::id()));
    trained.write_to(&folder).unwrap();
    assert_eq!(std::fs::read_to_string(folder.join("solids/card.toml")).unwrap(), trained.files.card);
    assert_eq!(std::fs::read(folder.join("solids/model.txt")).unwrap(), trained.files.model);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_scene_that_is_not_there_is_named() {
    let mut plan = small_plan();
    plan.training[1].scene = "nowhere".to_owned();
    let error = train_solids(&plan, &read, &mut |_| ()).unwrap_err();
    assert!(matches!(error, TrainSolidsError::Observe(_)));
    assert!(error.to_string().contains("scenes/nowhere.toml"), "{error}");
}
