//! `encke evaluate --tracks` as its user runs it: bars, numbers, a page, and one line where it cannot start.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;
use support::{encke, text};

/// A folder with the shipped plan, small enough for a test, and these targets.
fn folder(bars: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/config/evaluation/tracks.toml");
    let mut plan: toml::Table = fs::read_to_string(shipped).unwrap().parse().unwrap();
    for (key, value) in [("scenes", 2), ("sweeps", 25)] {
        plan.insert(key.to_owned(), value.into());
    }
    plan["encounters"]["count"] = 8.into();
    plan["encounters"]["track_s"] = 1.0.into();
    plan["cost"]["sweeps"] = 3.into();
    plan.insert("bars".to_owned(), bars.parse::<toml::Table>().unwrap().into());
    fs::write(dir.path().join("plan.toml"), plan.to_string()).unwrap();
    dir
}

fn evaluate(dir: &Path, more: &[&str]) -> Output {
    encke().current_dir(dir).args(["evaluate", "--tracks", "--plan", "plan.toml"]).args(more).output().unwrap()
}

/// What any tracker reaches that follows anything.
const LAX: &str = "obstacle_sweeps = 500\nidf1_per_cent = 60.0\nmota_per_cent = 50.0\nposition_rmse_m = 0.5\n\
                   class_10_sweeps_per_cent = 60.0\ntracker_ms = 1000.0\n";

#[test]
fn bars_of_tracks_that_hold_end_well_with_a_table_numbers_and_a_page() {
    let dir = folder(LAX);
    let output = evaluate(dir.path(), &["--out", "report"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let said = text(&output.stdout);
    let row = said.lines().find(|line| line.starts_with("mota_per_cent")).unwrap();
    assert!(row.contains("≥ 50") && row.ends_with("ok"), "{row}");
    assert!(said.lines().any(|line| line.starts_with("hota_per_cent") && line.ends_with("no target")));
    let page = fs::read_to_string(dir.path().join("report/tracks.html")).unwrap();
    assert!(page.contains("idf1_per_cent") && page.matches("<svg").count() == 8);
    assert!(!page.contains("http") && !page.contains("<script"));

    // The same again, but for times.
    let json = fs::read_to_string(dir.path().join("report/tracks.json")).unwrap();
    let again = evaluate(dir.path(), &["--json"]);
    let [first, second] = [json.as_bytes(), &again.stdout].map(|json| {
        let mut value: Value = serde_json::from_slice(json).unwrap();
        let all = value.as_object_mut().unwrap();
        all.remove("run").unwrap();
        all.remove("tracker").unwrap();
        all["bars"].as_array_mut().unwrap().retain(|bar| bar["key"] != "tracker_ms");
        value
    });
    assert_eq!(first, second);
    assert_eq!(first["encounters"]["count"], 8);
}

#[test]
fn a_bar_of_tracks_out_of_reach_is_named() {
    let output = evaluate(folder("idf1_per_cent = 100.1\nmota_per_cent = 10.0\n").path(), &[]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr).lines().last(), Some("encke: bars that fall short: idf1_per_cent"));
}

#[test]
fn tracks_of_a_recording_are_told_without_truth() {
    let dir = folder("");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/scenes/reference-tumbling.toml");
    let mut simulate = encke();
    simulate.current_dir(dir.path()).args(["simulate", "--sweeps", "20", "--out", "capture.mcap", "--scene"]);
    let made = simulate.arg(scene).output().unwrap();
    assert!(made.status.success(), "{}", text(&made.stderr));
    let output = evaluate(dir.path(), &["--json", "--from", "capture.mcap", "--out", "report"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(value["sweeps"].as_u64().unwrap() >= 19 && value["recording"] == "capture.mcap");
    assert!(value["confirmed"].as_u64().unwrap() > 20, "{value}");
    assert!(value["changed"]["per_cent"].as_f64().unwrap() < 5.0, "{value}");
    assert!(fs::read_to_string(dir.path().join("report/tracks.html")).unwrap().contains("capture.mcap"));
}

#[test]
fn what_stands_in_the_way_of_tracks_is_named_before_any_work() {
    let dir = folder(LAX);
    let good = fs::read_to_string(dir.path().join("plan.toml")).unwrap();
    let refused = |plan: &str, more: &[&str], words: &[&str]| {
        fs::write(dir.path().join("plan.toml"), plan).unwrap();
        let output = evaluate(dir.path(), more);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said:?} must name {words:?}");
        assert!(output.stdout.is_empty() && !said.contains("scenes of"), "{said:?}");
    };
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{good}");
        good.replace(from, to)
    };
    refused(&with("zero_m", "nero_m"), &[], &["plan.toml", "nero_m"]);
    refused(&with("match_m = 2.0", "match_m = 0.0"), &[], &["plan.toml: match_m is 0, must be 0.01 to 100"]);
    refused(&with("tracker_ms = ", "speed = "), &[], &["plan.toml: bars.speed is no bar", "tracker_ms"]);
    refused(&with("\"reference-tumbling\"", "\"no\""), &[], &["scenes/no.toml"]);
    refused(&good, &["--from", "no.pcap"], &["no.pcap"]);
    refused(&good, &["--out", "plan.toml"], &["--out", "plan.toml"]);
    refused(&good, &["--paper"], &["--paper", "--tracks"]);
}
