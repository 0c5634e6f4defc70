//! The same input gives the same bytes: at any pace, on one core or two, and whatever dies on the way.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::process::Command;

use support::{Finished, NO_LADDER, Run};

const STAGES: [&str; 6] = ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"];

/// A chain that does everything at real time too, however late: no ladder, a queue of 4 s, old parts are still answered.
fn patient_chain() -> (tempfile::TempDir, String) {
    support::chain_with(&[
        (support::LADDER, NO_LADDER),
        ("queue_sweeps = 4", "queue_sweeps = 40"),
        ("allowed_age_ms = 1000.0", "allowed_age_ms = 60000.0"),
    ])
}

fn at_pace(source: &[&str], pace: &[&str]) -> Finished {
    let (_dir, chain) = patient_chain();
    let run = Run::new(&[source, pace, &["--chain", &chain]].concat()).with_all_rows().finish().expect_code(0);
    assert_eq!(run.missing(), 0, "{}", run.stdout());
    run
}

#[test]
fn at_the_sensors_pace_at_another_rate_and_as_fast_as_it_goes_the_bytes_are_the_same() {
    let scene = ["--from", "config/scenes/default.toml", "--sweeps", "20"];
    let fast = at_pace(&scene, &["--pace", "fast"]);
    assert_eq!(fast.sweeps().len(), 20);
    for pace in [&[][..], &["--rate", "2.5"]] {
        let run = at_pace(&scene, pace);
        assert!(run.has_rows_of(&fast), "{pace:?}");
    }
    let Some(capture) = support::recorded("vlp16/veloview_vlp16.pcap") else { return };
    let capture = ["--from", capture.to_str().unwrap(), "--sensor", "vlp-16", "--sweeps", "20"];
    let fast = at_pace(&capture, &["--pace", "fast"]);
    for pace in [&[][..], &["--rate", "0.5"]] {
        let run = at_pace(&capture, pace);
        assert!(run.has_rows_of(&fast), "{pace:?}");
    }
}

#[test]
fn a_rate_is_kept() {
    let started = runtime::clock::now_ns();
    let run = at_pace(&["--sweeps", "20"], &["--rate", "4"]);
    let took_s = (runtime::clock::now_ns() - started) as f64 / 1e9;
    // Twenty sweeps are 2 s of sensor time. Faster than that is 0.5 s; slower only a busy machine can be.
    assert!(took_s > 0.5);
    assert!(run.report["duration_s"].as_f64().unwrap() < 2.0, "{}", run.report["duration_s"]);
}

#[test]
fn a_sweep_at_a_time_the_bytes_are_the_same_and_nothing_comes_unasked() {
    let scene = ["--from", "config/scenes/default.toml", "--sweeps", "3"];
    let fast = Run::new(&[&scene[..], &["--pace", "fast"]].concat()).finish().expect_code(0);
    let run = Run::new(&[&scene[..], &["--pace", "step"]].concat());
    let child = run.start();
    run.wait_for(|status| status["stages"][0]["state"] == "running");
    let step = |sweep| {
        assert_eq!(run.answered(), sweep);
        let step = support::encke().args(["ctl", "step", "--instance", &run.instance]).status().unwrap();
        assert!(step.success());
        run.wait_for(|_| run.answered() > sweep);
    };
    step(0);
    // Longer than the supervisor's patience with a chain in which nothing moves.
    std::thread::sleep(std::time::Duration::from_secs(6));
    step(1);
    let step = support::encke().args(["ctl", "step", "--instance", &run.instance]).status().unwrap();
    assert!(step.success());
    let run = run.collect(child).expect_code(0);
    assert!(run.bytes == fast.bytes);
}

#[test]
fn on_one_core_the_bytes_are_those_of_all_cores() {
    let args = ["--from", "config/scenes/default.toml", "--sweeps", "20", "--pace", "fast"];
    let all = Run::new(&args).with_all_rows().finish().expect_code(0);
    let run = Run::new(&args).with_all_rows();
    let child = run.start_with(|encke| {
        let mut command = Command::new("taskset");
        command.args(["-c", "0"]).arg(encke.get_program()).args(encke.get_args());
        command
    });
    let one = run.collect(child).expect_code(0);
    assert!(one.has_rows_of(&all));
}

#[test]
fn a_run_in_which_stages_die_at_fast_pace_ends_like_one_without() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "300", "--pace", "fast"];
    let plain = Run::new(&args).with_all_rows().finish().expect_code(0);
    for stage in STAGES {
        let run = Run::new(&args).with_all_rows();
        let mut child = run.start();
        run.wait_for_sweeps(5);
        // Makes the run long enough to die in; it changes no byte.
        run.inject(&["slow", "classifier", "--by", "5ms"]);
        let mut deaths = 0;
        for _ in 0..5 {
            let kill = ["inject", "kill", stage, "--instance", &run.instance];
            deaths += u64::from(support::encke().args(kill).output().unwrap().status.success());
            let before = run.answered();
            run.wait_for_or_end(&mut child, |_| run.answered() >= before + 3);
        }
        let run = run.collect(child).expect_code(0);
        assert!(deaths >= 3, "{deaths} deaths are no test");
        assert!(run.is_closed(), "{}", run.stdout());
        assert_eq!(run.process(stage)["restarts"], deaths);
        assert_eq!((run.missing(), run.report["sweeps"].as_u64()), (0, Some(300)), "{}", run.stdout());
        assert!(run.bytes == plain.bytes && run.labels == plain.labels, "{stage}");
        // A tracker begins anew; its tracks were in its memory alone.
        assert!(stage == "tracker" || run.tracks == plain.tracks, "{stage}");
        for hop in &STAGES[1..] {
            assert_eq!(support::sum(&run.hop(hop)["dropped"]), 0, "the window holds through deaths");
        }
        if stage != "recorder" {
            // What the recorder had counted dies with it, up to a second of it.
            assert_eq!(run.report["detections"], plain.report["detections"]);
        }
    }
}

#[test]
fn all_stages_killed_at_once_at_fast_pace_cost_nothing() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "200", "--pace", "fast"];
    let plain = Run::new(&args).finish().expect_code(0);
    let run = Run::new(&args);
    let child = run.start();
    run.wait_for_sweeps(5);
    run.inject(&["slow", "classifier", "--by", "5ms"]);
    let status = run.status().unwrap();
    for stage in status["stages"].as_array().unwrap() {
        support::kill(stage["pid"].as_u64().unwrap());
    }
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed() && run.missing() == 0, "{}", run.stdout());
    assert!(run.bytes == plain.bytes);
}
