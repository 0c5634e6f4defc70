//! `encke evaluate --paper` as its user runs it: a page, numbers, and one line where it cannot start.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::fs;
use std::path::Path;

use serde_json::Value;
use support::{encke, text};

/// The shipped plan, small enough for a test.
fn write_plan(path: &Path) {
    let shipped = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/training/paper.toml")).unwrap();
    let mut plan: toml::Table = shipped.parse().unwrap();
    for (key, value) in [("examples", 20), ("held_out", 4), ("cluttered_scenes", 1), ("folds", 2)] {
        plan.insert(key.to_owned(), value.into());
    }
    plan["svm"]["subset"] = 8.into();
    plan["svm"]["c"] = vec![10.0].into();
    plan["reproduction"]["convergence"] = vec![5].into();
    plan["reproduction"]["choice_examples"] = 8.into();
    plan["reproduction"]["choice_subset"] = 4.into();
    fs::write(path, plan.to_string()).unwrap();
}

fn evaluate(plan: &Path, out: &Path, more: &[&str]) -> std::process::Output {
    let mut command = encke();
    command.args(["evaluate", "--paper", "--plan"]).arg(plan).arg("--out").arg(out).args(more);
    command.output().unwrap()
}

#[test]
fn the_paper_is_reproduced_into_a_folder_twice_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let plan = dir.path().join("small.toml");
    write_plan(&plan);
    let results = ["a", "b/c"].map(|folder| {
        let out = dir.path().join(folder);
        let output = evaluate(&plan, &out, &["--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stderr).lines().count() > 10, "progress is told");
        let json = fs::read_to_string(out.join("paper.json")).unwrap();
        assert_eq!(text(&output.stdout), json);
        let page = fs::read_to_string(out.join("paper.html")).unwrap();
        assert!(page.contains("small.toml") && page.contains("Table III."));
        assert!(!page.contains("http") && !page.contains("<script"));
        let mut files: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        files.sort();
        assert_eq!(files, ["paper.html", "paper.json"], "nothing else is left there");
        let mut value: Value = serde_json::from_str(&json).unwrap();
        assert!(value["run"]["duration_s"].as_f64().unwrap() >= 0.0);
        value.as_object_mut().unwrap().remove("run");
        value
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0]["table_2"]["paper_mean_per_cent"], 54.5);
}

#[test]
fn what_stands_in_the_way_is_named_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let plan = dir.path().join("small.toml");
    write_plan(&plan);
    let good = fs::read_to_string(&plan).unwrap();
    let refused = |plan: &Path, out: &Path, words: &[&str]| {
        let output = evaluate(plan, out, &[]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said:?} must name {words:?}");
        assert!(!said.contains("looking at"), "{said:?}");
    };
    let out = dir.path().join("out");
    refused(&dir.path().join("no.toml"), &out, &["no.toml"]);
    let broken = dir.path().join("broken.toml");
    for (from, to, words) in [
        ("folds = 2", "folds = 1", ["broken.toml", "folds is 1, must be 2 to 20"]),
        ("folds = 2", "fulds = 2", ["broken.toml", "fulds"]),
        ("choice_examples = 8", "choice_examples = 21", ["broken.toml", "reproduction.choice_examples is 21"]),
    ] {
        assert!(good.contains(from), "{good}");
        fs::write(&broken, good.replace(from, to)).unwrap();
        refused(&broken, &out, &words);
    }
    assert!(!out.exists(), "a plan that does not hold leaves nothing behind");
    let file = dir.path().join("file");
    fs::write(&file, "in the way").unwrap();
    refused(&plan, &file, &["--out", "file"]);
    refused(&plan, &file.join("below"), &["--out", "below"]);
}
