//! The paper's experiments on few examples: tables that add up, a page that needs nothing else, the same bytes again.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::OnceLock;

use ground::{Reproduction, ReproductionPlan, RunNote, TrainPlan, reproduce};
use serde_json::Value;

fn read(path: &str) -> std::io::Result<String> {
    std::fs::read_to_string(format!("{}/../../config/{path}", env!("CARGO_MANIFEST_DIR")))
}

fn small_plan() -> TrainPlan {
    let mut plan: TrainPlan = toml::from_str(&read("training/paper.toml").unwrap()).unwrap();
    plan.examples = 30;
    plan.held_out = 5;
    plan.cluttered_scenes = 1;
    plan.folds = 3;
    plan.svm.subset = 10;
    plan.svm.c = vec![1.0, 30.0];
    plan.reproduction = Some(ReproductionPlan {
        convergence: vec![15, 5],
        choice_examples: 12,
        choice_subset: 6,
        ..plan.reproduction.unwrap()
    });
    plan
}

fn run() -> RunNote {
    RunNote { plan_file: "a <plan>.toml".to_owned(), machine: "M & Co".to_owned(), cores: 2, duration_s: 12.3 }
}

/// The small plan's results, made once for all tests.
fn small() -> &'static Reproduction {
    static SMALL: OnceLock<Reproduction> = OnceLock::new();
    SMALL.get_or_init(|| reproduce(&small_plan(), &read, &|_| ()).unwrap())
}

fn json() -> Value {
    serde_json::from_str(&small().to_json(&run())).unwrap()
}

fn sum(row: &Value) -> f64 {
    row.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).sum()
}

// verifies GND-003
#[test]
fn the_same_plan_gives_the_same_json_and_page() {
    let again = reproduce(&small_plan(), &read, &|_| ()).unwrap();
    assert_eq!(small().to_json(&run()), again.to_json(&run()));
    assert_eq!(small().to_html(&run()), again.to_html(&run()));
    // What differs from run to run stands in one place.
    let other = RunNote { machine: "another".to_owned(), duration_s: 99.0, ..run() };
    let mut other: Value = serde_json::from_str(&again.to_json(&other)).unwrap();
    assert_eq!(other["run"]["duration_s"], 99.0);
    other["run"] = json()["run"].clone();
    assert_eq!(other, json());
}

// verifies GND-004
#[test]
fn tables_add_up_and_have_the_papers_beside_them() {
    let json = json();
    for (table, paper_mean) in [("table_1", 42.5), ("table_2", 54.5)] {
        let table = &json[table];
        assert_eq!(table["paper_mean_per_cent"], paper_mean);
        for scenes in ["cluttered", "alone"] {
            let scenes = &table[scenes];
            for row in scenes["per_cent"].as_array().unwrap() {
                assert!((sum(row) - 100.0).abs() < 0.03, "{row}");
            }
            let diagonal: f64 = (0..4).map(|class| scenes["per_cent"][class][class].as_f64().unwrap()).sum();
            assert!((scenes["mean_per_cent"].as_f64().unwrap() - diagonal / 4.0).abs() < 0.02);
        }
        let alone = table["alone"]["actual_by_predicted"].as_array().unwrap();
        assert!(alone.iter().all(|row| sum(row) == 5.0), "each class has its five obstacles seen alone");
    }
    // Both classifiers saw the same clusters.
    let clusters = |table: &str, class: usize| sum(&json[table]["cluttered"]["actual_by_predicted"][class]);
    assert!((0..4).all(|class| clusters("table_1", class) == clusters("table_2", class)));
    let pairs = json["table_3"].as_array().unwrap();
    assert_eq!(pairs.iter().map(|pair| pair["paper_per_cent"].as_f64().unwrap()).sum::<f64>(), 516.0);
    for (pair, classes) in pairs.iter().zip([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]) {
        let of = |row: usize| sum(&pair["actual_by_predicted"][row]);
        assert_eq!((of(0), of(1)), (clusters("table_1", classes.0), clusters("table_1", classes.1)));
    }
}

#[test]
fn the_curve_rises_in_size_and_ends_with_the_whole_set() {
    let json = json();
    let curve = json["figure_7"].as_array().unwrap();
    let sizes: Vec<u64> = curve.iter().map(|point| point["examples_of_each_class"].as_u64().unwrap()).collect();
    assert_eq!(sizes, [5, 15, 30]);
    assert_eq!(curve[2]["svm_per_cent"], json["table_2"]["cluttered"]["mean_per_cent"]);
    assert_eq!(curve[2]["naive_bayes_per_cent"], json["table_1"]["cluttered"]["mean_per_cent"]);
}

#[test]
fn every_choice_is_named_and_changes_what_it_should() {
    let json = json();
    let choices = json["choices"].as_array().unwrap();
    let named = |name: &str| choices.iter().find(|choice| choice["name"] == name).unwrap();
    assert_eq!(choices[0]["name"], "same");
    for choice in &choices[1..] {
        assert!(!choice["tried"].as_str().unwrap().is_empty() && !choice["ours"].as_str().unwrap().is_empty());
        assert!(choice["svm"].is_object() || choice["naive_bayes"].is_object(), "{}", choice["name"]);
    }
    let svm = |name: &str| named(name)["svm"]["actual_by_predicted"].clone();
    for name in ["counts", "root", "unit-length", "no-noise", "k-6", "near-training", "slender", "sparse", "dense"] {
        assert_ne!(svm(name), svm("same"), "{name} changes nothing");
    }
    assert_ne!(svm("dense"), svm("dense-whole"));
    let clusters = |name: &str| svm(name).as_array().unwrap().iter().map(sum).sum::<f64>();
    assert_eq!(clusters("counts"), clusters("same"));
    assert!(clusters("sparse") < clusters("same") && clusters("same") < clusters("dense"));
    let bands = named("same")["svm_by_distance"].as_array().unwrap();
    let in_bands: f64 = bands.iter().flat_map(|b| b["actual_by_predicted"].as_array().unwrap()).map(sum).sum();
    assert_eq!(in_bands, clusters("same"));
}

// verifies GND-005
#[test]
fn the_page_stands_alone_and_holds_every_table_and_figure() {
    let page = small().to_html(&run());
    for foreign in ["http", "src=", "href", "<script", "url(", "@import", "<link", "NaN", "inf"] {
        assert!(!page.contains(foreign), "the page holds {foreign:?}");
    }
    for part in [
        "Table I.",
        "Table II.",
        "Table III.",
        "Fig. 2.",
        "Fig. 3.",
        "Fig. 6.",
        "Fig. 7.",
        "a &lt;plan&gt;.toml",
        "M &amp; Co",
    ] {
        assert!(page.contains(part), "the page lacks {part:?}");
    }
    assert_eq!(page.matches("<svg").count(), 4);
    for element in ["svg", "table", "tr", "td", "figure", "g", "div"] {
        let (open, shut) = (format!("<{element}"), format!("</{element}>"));
        let opened = page.matches(&format!("{open}>")).count() + page.matches(&format!("{open} ")).count();
        assert_eq!(opened, page.matches(&shut).count(), "{element}");
    }
}

#[test]
fn a_plan_without_the_reproductions_part_is_refused_by_name() {
    let refused = |plan: &TrainPlan| reproduce(plan, &read, &|_| ()).unwrap_err().to_string();
    assert!(refused(&TrainPlan { reproduction: None, ..small_plan() }).starts_with("reproduction is missing"));
    let nowhere = TrainPlan { scene: "nowhere".to_owned(), ..small_plan() };
    assert!(refused(&nowhere).starts_with("scenes/nowhere.toml: "));
}
