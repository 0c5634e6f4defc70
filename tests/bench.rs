//! `encke bench` as its user runs it: every stage on every sweep, and one line where it cannot start.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::fs;
use std::path::Path;
use std::process::Stdio;

use serde_json::Value;
use support::{encke, text};

const STAGES: [&str; 10] = [
    "cluster",
    "normals",
    "histogram",
    "svm",
    "fit",
    "paper_chain",
    "full_chain",
    "track",
    "paper_last_sector",
    "full_last_sector",
];

/// The lines of `encke bench --json` with three runs.
fn bench(args: &[&str]) -> Vec<Value> {
    let output = encke().args(["bench", "--runs", "3", "--json"]).args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Asserts every stage once, in order, with times that can be.
fn assert_stages(lines: &[Value]) {
    let stages: Vec<_> = lines.iter().map(|line| line["stage"].as_str().unwrap()).collect();
    assert_eq!(stages, STAGES);
    for line in lines {
        let [median_ms, min_ms] = ["median_ms", "min_ms"].map(|key| line[key].as_f64().unwrap());
        assert!(0.0 < min_ms && min_ms <= median_ms, "{line}");
        assert_eq!(line["who"], "encke");
        let fits = ["fits", "evaluations"].map(|key| line[key].as_f64());
        match (line["stage"].as_str(), fits) {
            (Some("fit"), [Some(fits), Some(evaluations)]) => {
                assert!(fits <= line["described"].as_f64().unwrap());
                assert_eq!(fits > 0.0, evaluations > 0.0, "{line}");
            }
            (Some("fit"), _) => panic!("{line}"),
            (_, fits) => assert_eq!(fits, [None, None], "{line}"),
        }
    }
}

/// Two walls of 30 and 40 returns, 9 m apart, and a pair of returns far from both.
fn write_walls(path: &Path) {
    let mut csv = "x,y,z\n".to_owned();
    for (x, count) in [(4.0, 30), (13.0, 40)] {
        for place in 0..count {
            csv += &format!("{x},{},{}\n", f64::from(place % 6) * 0.1, f64::from(place / 6) * 0.1);
        }
    }
    csv += "-40,0,0\n-40,0.1,0\n";
    fs::write(path, csv).unwrap();
}

/// Groups of returns at most `range_m` apart in a folder's only CSV file, by comparing all with all.
fn components(folder: &Path, range_m: f64) -> usize {
    let file = fs::read_dir(folder).unwrap().next().unwrap().unwrap().path();
    let text = fs::read_to_string(file).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let places = ["x", "y", "z"].map(|name| header.iter().position(|word| *word == name).unwrap());
    let mut left: Vec<[f64; 3]> = rows.map(|row| places.map(|place| row[place].parse().unwrap())).collect();
    let mut groups = 0;
    while let Some(first) = left.pop() {
        groups += 1;
        let mut open = vec![first];
        while let Some(from) = open.pop() {
            let apart2 = |to: &[f64; 3]| (0..3).map(|axis| (from[axis] - to[axis]).powi(2)).sum::<f64>();
            open.extend(left.extract_if(.., |to| apart2(to) <= range_m * range_m));
        }
    }
    groups
}

#[test]
fn every_stage_has_a_line_that_says_what_it_worked_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("two-walls.csv");
    write_walls(&path);
    let from = path.display().to_string();
    let counts = |args: &[&str]| {
        let lines = bench(&[&["--from", &from], args].concat());
        assert_stages(&lines);
        for line in &lines {
            assert_eq!((&line["sweep"], &line["n"]), (&"two-walls".into(), &72.into()), "{line}");
            let stage = line["stage"].as_str().unwrap();
            if !stage.starts_with("full_") && stage != "track" {
                assert_eq!(line["support_vectors"], lines[0]["support_vectors"], "{line}");
            }
        }
        let line = lines.iter().find(|line| line["stage"] == "fit").unwrap();
        ["clusters", "described", "fits", "support_vectors"].map(|key| line[key].as_u64().unwrap())
    };
    let [clusters, described, fits, support_vectors] = counts(&[]);
    assert_eq!((clusters, described, fits), (3, 2, 2));
    assert!(support_vectors > 4);
    assert_eq!(counts(&["--range", "9"])[..3], [2, 1, 0], "the walls are one, too wide for a solid");
    assert_eq!(counts(&["--min-points", "31"])[..3], [3, 1, 1]);
    assert_eq!(counts(&["--min-points", "41"])[..3], [3, 0, 0]);
    assert_eq!(counts(&["--min-points", "2"])[..3], [3, 2, 2], "five points are the least for features");

    let model = dir.path().join("two.libsvm");
    let head = "svm_type c_svc\nkernel_type rbf\ngamma 1\nnr_class 2\ntotal_sv 2\nrho 0\nlabel 1 4\nnr_sv 1 1\nSV\n";
    fs::write(&model, format!("{head}1 1:1\n-1 2:1\n")).unwrap();
    assert_eq!(counts(&["--model", &model.display().to_string()]), [3, 2, 2, 2], "needs no probabilities and no card");
}

#[test]
fn the_full_chain_is_the_configured_one_and_all_other_lines_are_the_same_whatever_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("two-walls.csv");
    write_walls(&path);
    let chain = dir.path().join("chain.toml");
    fs::copy("config/chain.toml", &chain).unwrap();
    fs::create_dir(dir.path().join("stages")).unwrap();
    fs::copy("config/stages/clusterer.toml", dir.path().join("stages/clusterer.toml")).unwrap();
    let mut extractor: toml::Table = fs::read_to_string("config/stages/extractor.toml").unwrap().parse().unwrap();
    extractor.insert("histogram".to_owned(), true.into());
    extractor.insert("solids".to_owned(), false.into());
    fs::write(dir.path().join("stages/extractor.toml"), extractor.to_string()).unwrap();
    for (method, model) in [("naive-bayes", "paper-nb"), ("svm", "paper-svm")] {
        let classifier = format!("method = {method:?}\nmodel = {model:?}\nleast_posterior = 0.0\n");
        fs::write(dir.path().join("stages/classifier.toml"), classifier).unwrap();
        let lines = bench(&["--from", &path.display().to_string(), "--chain", &chain.display().to_string()]);
        assert_stages(&lines);
        for line in &lines {
            let stage = line["stage"].as_str().unwrap();
            let full = stage.starts_with("full_") || stage == "track";
            assert_eq!(line["model"], if full { model } else { "paper-svm" }, "{line}");
            assert_eq!(line["support_vectors"] == 0, full && method != "svm", "{line}");
            assert!(line["stage"] != "fit" || line["fits"] == 2, "{line}");
        }
    }
}

#[test]
fn several_sources_come_in_order_and_a_scene_is_its_own_recording() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    let folder = path("s.v1");
    let scene = "config/scenes/reference.toml";
    let simulated =
        encke().args(["simulate", "--scene", scene, "--sweeps", "1", "--out", &path("s")]).output().unwrap();
    assert!(simulated.status.success(), "{}", text(&simulated.stderr));
    fs::rename(path("s"), &folder).unwrap();
    let truth = fs::read_to_string(path("s.truth.jsonl")).unwrap();
    let truth: Value = serde_json::from_str(&truth).unwrap();
    let clusters = components(Path::new(&folder), 1.0);

    let lines = bench(&["--from", scene, &folder]);
    let (of_scene, of_folder) = lines.split_at(STAGES.len());
    for (lines, name) in [(of_scene, "reference"), (of_folder, "s.v1")] {
        assert_stages(lines);
        for line in lines {
            assert_eq!(line["sweep"], name);
            assert_eq!(line["n"], truth["owners"].as_array().unwrap().len());
            assert_eq!(line["clusters"], clusters);
        }
    }
}

#[test]
fn without_json_there_is_a_table_for_people() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("two-walls.csv");
    write_walls(&path);
    let output = encke().args(["bench", "--runs", "1", "--from"]).arg(&path).output().unwrap();
    let table = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(table.contains("two-walls: 72 returns, 3 clusters, 2 with features"), "{table}");
    assert!(table.lines().any(|line| line.starts_with("fit ") && line.contains("2 fits of ")), "{table}");
    assert!(STAGES.iter().all(|stage| table.lines().any(|line| line.starts_with(stage))), "{table}");
}

#[test]
fn what_cannot_be_timed_is_refused_in_one_line_before_anything_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    let walls = path("walls.csv");
    write_walls(Path::new(&walls));
    fs::write(path("text.bin"), b"this is no recording of anything at all, only words in a row").unwrap();
    fs::write(path("words.libsvm"), "svm_type c_svc\nkernel_type linear\n").unwrap();
    let refused = |args: &[&str], words: &[&str]| {
        let output = encke().args(["bench", "--from", &walls]).args(args).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said:?} must name {words:?}");
        assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
    };
    refused(&["no/such.csv"], &["no/such.csv"]);
    refused(&[&path("text.bin")], &["text.bin"]);
    refused(&["--range", "-1"], &["--range", "-1", "0.001 to 1000"]);
    refused(&["--min-points", "0"], &["--min-points", "must be 1 to"]);
    refused(&["--model", &path("none.libsvm")], &["--model", "none.libsvm"]);
    refused(&["--model", &path("words.libsvm")], &["words.libsvm", "kernel_type", "rbf"]);
    refused(&["config/scenes/default.toml", "--sensor", "vlp-16"], &["--sensor", "scene"]);
    assert_eq!(encke().args(["bench"]).output().unwrap().status.code(), Some(2), "--from must be given");
    assert_eq!(encke().args(["bench", "--from", &walls, "--runs", "0"]).output().unwrap().status.code(), Some(2));
}

#[test]
fn a_hop_through_shared_memory_beats_a_socket_and_leaves_nothing_behind() {
    let mut command = encke();
    command.args(["bench", "--hop", "--runs", "60", "--json"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let name = format!("hop-{}", child.id());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let hops: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&hops["returns"], &hops["bytes"], &hops["runs"]), (&69_440.into(), &1_111_040.into(), &60.into()));
    for way in ["shared_memory", "socket"] {
        let [p50, p99, max] = ["p50_us", "p99_us", "max_us"].map(|key| hops[way][key].as_f64().unwrap());
        assert!(0.0 < p50 && p50 <= p99 && p99 <= max, "{hops}");
    }
    let ratio = hops["ratio_p50"].as_f64().unwrap();
    assert!(ratio > 1.5, "{hops}");
    let left = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let left: Vec<_> = left.filter(|file| file.starts_with(&format!("encke_{name}_"))).collect();
    assert_eq!(left, Vec::<String>::new());
    assert!(!transport::Instance::named(&name).unwrap().dir().exists());
    assert_eq!(encke().args(["bench", "--hop", "--range", "1"]).output().unwrap().status.code(), Some(2));
}
