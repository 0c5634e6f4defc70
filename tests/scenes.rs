//! The chain on simulated scenes, as processes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::BTreeSet;

use serde_json::Value;
use support::{LADDER, NO_LADDER, Run, chain_with, encke, leftovers, sum, text};

#[test]
fn every_sweep_gets_a_line_and_the_ledger_closes() {
    let run = Run::new(&["--sweeps", "60", "--pace", "fast"]).with_all_rows().finish().expect_code(0);
    assert!(run.is_closed());
    assert_eq!(run.sweeps(), (0..60).collect::<Vec<_>>());
    for stage in ["clusterer", "extractor", "classifier", "tracker", "recorder"] {
        let hop = run.hop(stage);
        for key in ["published", "received", "processed"] {
            assert_eq!(hop[key], 60 * run.report["sectors"].as_u64().unwrap(), "{stage} {key}");
        }
        assert_eq!(hop["open"], 0);
    }
    assert_eq!(run.missing(), 0);
    // Detections of the report, of the lines, and labels agree.
    let listed: usize = run.detections.iter().map(|line| line["detections"].as_array().unwrap().len()).sum();
    assert_eq!(sum(&run.report["detections"]), listed as u64);
    let rows = run.labels.lines().count() - 1;
    let returns: u64 = run.detections.iter().map(|line| line["returns"].as_u64().unwrap()).sum();
    assert_eq!(rows as u64, returns);
    assert!(returns > 60 * 1_000, "a scene with obstacles has returns: {returns}");
    // So do its tracks and those of their file, and the summary says them.
    let lines = run.tracks.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let confirmed: Vec<usize> = lines
        .map(|line| line["tracks"].as_array().unwrap().iter().filter(|track| track["state"] != "tentative").count())
        .collect();
    let (most, last) = (*confirmed.iter().max().unwrap(), *confirmed.last().unwrap());
    let tracks = &run.report["tracks"];
    assert_eq!((&tracks["confirmed_max"], &tracks["confirmed_last"]), (&most.into(), &last.into()));
    let line = format!("tracks      {most} confirmed at most, {last} at the end; {} alerts", tracks["alerts"]);
    assert!(most > 0 && run.stdout().contains(&line), "{line}: {}", run.stdout());
}

#[test]
fn the_same_scene_gives_the_same_bytes_at_any_pace() {
    // On a machine that is busy otherwise the ladder would leave things out.
    let (_dir, chain) = chain_with(&[(LADDER, NO_LADDER)]);
    let args = ["--from", "config/scenes/reference.toml", "--sweeps", "12", "--chain", &chain];
    let fast = Run::new(&[&args[..], &["--pace", "fast"]].concat()).with_all_rows().finish().expect_code(0);
    let again = Run::new(&[&args[..], &["--pace", "fast"]].concat()).with_all_rows().finish().expect_code(0);
    let paced = Run::new(&args).with_all_rows().finish().expect_code(0);
    assert_eq!(fast.bytes, again.bytes);
    assert_eq!(fast.labels, again.labels);
    assert_eq!(fast.tracks, again.tracks);
    if paced.missing() == 0 {
        assert_eq!(fast.bytes, paced.bytes);
    } else {
        assert!(paced.is_closed(), "what a busy machine dropped is accounted for");
    }
    let other = Run::new(&[&args[..], &["--pace", "fast", "--seed", "99"]].concat()).finish().expect_code(0);
    assert_ne!(fast.bytes, other.bytes, "another seed is another scene");
}

#[test]
fn every_stage_is_a_process_of_its_own() {
    let run = Run::new(&["--duration", "forever"]);
    let mut child = run.start();
    run.wait_for_sweeps(5);
    let status = run.status().unwrap();
    let stages = status["stages"].as_array().unwrap();
    let pids: BTreeSet<u64> = stages.iter().map(|stage| stage["pid"].as_u64().unwrap()).collect();
    assert_eq!(pids.len(), 6);
    for stage in stages {
        let maps = std::fs::read_to_string(format!("/proc/{}/maps", stage["pid"])).unwrap();
        assert!(maps.contains(&format!("encke_{}_", run.instance)), "{stage} maps shared memory");
    }
    let stop = encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    child.wait().unwrap();
    assert!(leftovers(&run.instance).is_empty());
}

#[test]
fn ctrl_c_drains_the_chain_and_prints_the_summary() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    let pid = rustix::process::Pid::from_raw(child.id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed());
    assert!(run.stdout().contains("ledger closed"));
    let sweeps = run.report["sweeps"].as_u64().unwrap();
    assert_eq!(run.sweeps().len() as u64 + run.missing(), sweeps);
}

#[test]
fn process_allocates_nothing_and_the_shell_at_most_once_a_sweep() {
    let run = Run::new(&["--sweeps", "80", "--pace", "fast"]).finish().expect_code(0);
    for stage in ["clusterer", "extractor", "classifier", "tracker"] {
        let process = run.process(stage);
        assert_eq!(process["heap_allocations_per_sweep"], 0.0, "{stage}");
        assert!(process["shell_heap_allocations_per_sweep"].as_f64().unwrap() <= 1.0, "{stage}: {process}");
    }
}

#[test]
fn a_capture_of_a_scene_gives_the_same_classes_as_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let capture = dir.path().join("scene.pcap");
    let scene = "config/scenes/default.toml";
    let made = encke().args(["simulate", "--scene", scene, "--sweeps", "4", "--out"]).arg(&capture).output().unwrap();
    assert!(made.status.success(), "{}", text(&made.stderr));
    let truth_path = dir.path().join("scene.truth.jsonl");
    assert_eq!(std::fs::read_to_string(truth_path).unwrap().lines().count(), 4);

    let direct = Run::new(&["--from", scene, "--sweeps", "4", "--pace", "fast"]).finish().expect_code(0);
    let packets = Run::new(&["--from", capture.to_str().unwrap(), "--pace", "fast"]).finish().expect_code(0);
    assert_eq!(direct.detections.len(), packets.detections.len());
    for (one, other) in direct.detections.iter().zip(&packets.detections) {
        let classes = |line: &serde_json::Value| {
            let list = line["detections"].as_array().unwrap().iter();
            list.map(|d| (d["points"].as_u64().unwrap(), d["class"].as_str().unwrap().to_owned())).collect::<Vec<_>>()
        };
        assert_eq!(classes(one), classes(other), "sweep {}", one["sweep"]);
    }
}

#[test]
fn messages_of_a_scene_give_the_bytes_of_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let scene = "config/scenes/default.toml";
    let direct = Run::new(&["--from", scene, "--sweeps", "4", "--pace", "fast"]).finish().expect_code(0);
    let files = [dir.path().join("one.mcap"), dir.path().join("other.mcap")];
    for file in &files {
        let made = encke().args(["simulate", "--scene", scene, "--sweeps", "4", "--out"]).arg(file).output().unwrap();
        assert!(made.status.success(), "{}", text(&made.stderr));
        let replayed = Run::new(&["--from", file.to_str().unwrap(), "--pace", "fast"]).finish().expect_code(0);
        assert!(replayed.bytes == direct.bytes);
    }
    let [one, other] = files.map(|file| std::fs::read(file).unwrap());
    assert!(one == other, "the same scene gives the same file");
}

#[test]
fn a_full_disk_costs_rows_and_not_the_chain() {
    let args = ["run", "--sweeps", "5", "--pace", "fast", "--detections", "/dev/full", "--json"];
    let output = encke().args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ledger"]["closed"], true);
    assert_eq!(report["lost_sweeps"]["detections"], 5);
    assert!(text(&output.stderr).contains("/dev/full"));
}

#[test]
fn detections_go_to_standard_output_when_asked() {
    let dir = tempfile::tempdir().unwrap();
    let mut command = encke();
    command.current_dir(dir.path()).args(["run", "--sweeps", "3", "--pace", "fast", "--detections", "-"]);
    let output = command.output().unwrap();
    assert!(output.status.success());
    let said = text(&output.stdout);
    let lines = said.lines().filter(|line| line.starts_with("{\"sweep\":"));
    assert_eq!(lines.count(), 3);
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "no file of that name");
}
