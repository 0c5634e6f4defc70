//! The supervisor dies: its stages go on, and a successor adopts them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::process::Child;
use std::time::Duration;

use runtime::clock;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use support::{Finished, Run};
use transport::Instance;

const STAGES: [&str; 6] = ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"];

/// What the pages of an instance say, whether or not it has a supervisor.
fn status(run: &Run) -> supervisor::Status {
    supervisor::status(&Instance::named(&run.instance).unwrap()).unwrap()
}

fn pids(run: &Run) -> Vec<u64> {
    status(run).stages.iter().map(|stage| stage.pid).collect()
}

fn kill_supervisor(mut child: Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

fn adopt(run: &Run) -> Child {
    run.start_with(|mut encke| {
        encke.arg("--adopt");
        encke
    })
}

/// Waits until so many more sweeps are answered, whether or not there is a supervisor.
fn await_more(run: &Run, sweeps: u64) {
    let answered = || {
        let now = status(run);
        now.stages.last().unwrap().received / u64::from(now.sectors)
    };
    let before = answered();
    assert!(clock::wait_for(30_000_000_000, || answered() >= before + sweeps), "no more sweeps are answered");
}

/// Waits until process `child` supervises the instance.
fn await_supervisor(run: &Run, child: &Child) {
    let instance = Instance::named(&run.instance).unwrap();
    let is_there = || supervisor::Running::of(&instance).is_some_and(|running| running.pid == child.id());
    assert!(clock::wait_for(30_000_000_000, is_there), "the successor did not take the instance");
}

fn events(run: &Run) -> Vec<Value> {
    let path = runtime::Plan::events_path(&Instance::named(&run.instance).unwrap());
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Waits for the event of an adoption by the `count`-th successor; gives the time of it.
fn await_adoption(run: &Run, count: usize) -> u64 {
    let adoptions = || -> Vec<u64> {
        let events = events(run).into_iter().filter(|event| event["name"] == "supervisor_adopted");
        events.map(|event| event["time_ns"].as_u64().unwrap()).collect()
    };
    assert!(clock::wait_for(30_000_000_000, || adoptions().len() >= count), "not adopted: {:?}", events(run));
    adoptions()[count - 1]
}

/// Stops the chain: the ledger is closed, and each sweep has a line or is named as missing.
fn stop(run: Run, child: Child) -> Finished {
    let numbers: Vec<u64> = events(&run).iter().map(|event| event["number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, (0..numbers.len() as u64).collect::<Vec<_>>(), "the events' numbers go on");
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}{}", run.stdout(), run.stderr());
    run.expect_every_sweep_accounted_for();
    run
}

fn lost(run: &Finished) -> u64 {
    run.report["ledger"]["hops"].as_array().unwrap().iter().map(|hop| hop["lost"].as_u64().unwrap()).sum()
}

/// A copy of the configuration in which stages go on for so long without a supervisor.
fn with_orphan_s(seconds: &str) -> (tempfile::TempDir, String) {
    let (dir, chain) = support::chain_with(&[]);
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/executive.toml")).unwrap();
    let changed = text.replace("orphan_s = 10.0", &format!("orphan_s = {seconds}"));
    assert_ne!(changed, text);
    std::fs::write(dir.path().join("executive.toml"), changed).unwrap();
    (dir, chain)
}

#[test]
fn sweeps_are_answered_without_a_supervisor_and_its_successor_adopts_the_stages() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    let before = pids(&run);
    kill_supervisor(child);
    await_more(&run, 5);
    let started_ns = clock::now_ns();
    let child = adopt(&run);
    println!("adopted {} ms after the successor's start", (await_adoption(&run, 1) - started_ns) / 1_000_000);
    await_more(&run, 5);
    assert_eq!(pids(&run), before);
    let run = stop(run, child);
    assert_eq!(lost(&run), 0);
    for stage in STAGES {
        assert_eq!(run.process(stage)["restarts"], 0);
    }
    let first = run.report["duration_s"].as_f64().unwrap();
    assert!(first * 10.0 >= run.sweeps().len() as f64 - 2.0, "the report is of the whole run, not of {first} s");
}

#[test]
fn successors_may_die_in_a_row_at_any_moment() {
    let run = Run::new(&["--duration", "forever"]);
    let mut child = run.start();
    run.wait_for_sweeps(3);
    let before = pids(&run);
    for wait_ms in [0, 7, 20, 45, 90] {
        kill_supervisor(child);
        child = adopt(&run);
        await_supervisor(&run, &child);
        std::thread::sleep(Duration::from_millis(wait_ms));
    }
    run.wait_for_more(3);
    assert_eq!(pids(&run), before);
    assert_eq!(lost(&stop(run, child)), 0);
}

#[test]
fn a_stage_that_dies_with_the_supervisor_or_after_it_is_settled_by_the_successor() {
    for stage in STAGES {
        for later_ms in [0, 300] {
            let run = Run::new(&["--duration", "forever"]);
            let child = run.start();
            run.wait_for_sweeps(4);
            let position = STAGES.iter().position(|name| *name == stage).unwrap();
            let pid = pids(&run)[position];
            kill_supervisor(child);
            std::thread::sleep(Duration::from_millis(later_ms));
            support::kill(pid);
            let child = adopt(&run);
            await_adoption(&run, 1);
            run.wait_for(|status| {
                status["stages"][position]["restarts"] == 1 && status["stages"][position]["state"] == "running"
            });
            run.wait_for_more(3);
            let run = stop(run, child);
            assert_eq!(run.process(stage)["restarts"], 1, "{stage}");
        }
    }
}

#[test]
fn an_adopted_stage_that_dies_is_restarted() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    kill_supervisor(child);
    let child = adopt(&run);
    await_adoption(&run, 1);
    for stage in ["classifier", "source"] {
        run.inject(&["kill", stage]);
        run.wait_for(|status| {
            let stages = status["stages"].as_array().unwrap();
            let killed = stages.iter().find(|s| s["stage"] == stage).unwrap();
            killed["restarts"] == 1 && killed["state"] == "running"
        });
    }
    run.wait_for_more(3);
    stop(run, child);
}

#[test]
fn a_supervisor_killed_during_start_up_is_followed_by_a_running_chain() {
    for wait_ms in [2, 8, 16, 25, 35, 50, 70, 100] {
        let run = Run::new(&["--duration", "forever"]);
        let child = run.start();
        std::thread::sleep(Duration::from_millis(wait_ms));
        kill_supervisor(child);
        let child = adopt(&run);
        run.wait_for_sweeps(3);
        run.wait_for_more(2);
        stop(run, child);
    }
}

#[test]
fn stages_that_nobody_adopts_leave_drained_and_the_next_start_is_clean() {
    let (_dir, chain) = with_orphan_s("1.0");
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let before = pids(&run);
    kill_supervisor(child);
    let is_gone = |pid: &u64| std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default().is_empty();
    assert!(clock::wait_for(30_000_000_000, || before.iter().all(is_gone)), "stages stay for ever");
    let left = status(&run);
    for pair in left.stages.windows(2) {
        assert_eq!(
            pair[1].received + pair[1].dropped,
            pair[0].published,
            "{} left before it was drained",
            pair[1].stage
        );
    }
    assert!(left.stages.iter().all(|stage| stage.state == "stopped"), "{left:?}");
    // Nothing to adopt: it starts as usual.
    let child = adopt(&run);
    run.wait_for_sweeps(3);
    stop(run, child);
}

#[test]
fn a_supervisor_that_is_only_stopped_keeps_its_stages() {
    let (_dir, chain) = with_orphan_s("0.2");
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let (before, pid) = (pids(&run), Pid::from_child(&child));
    kill_process(pid, Signal::STOP).unwrap();
    await_more(&run, 10);
    let rival = adopt(&run).wait_with_output().unwrap();
    assert_eq!(rival.status.code(), Some(2));
    assert!(support::text(&rival.stderr).contains("is running"), "{}", support::text(&rival.stderr));
    kill_process(pid, Signal::CONT).unwrap();
    run.wait_for_more(2);
    assert_eq!(pids(&run), before);
    stop(run, child);
}

#[test]
fn a_chain_that_was_started_otherwise_is_ended_and_started_anew() {
    let old = Run::new(&["--duration", "forever"]);
    let child = old.start();
    old.wait_for_sweeps(3);
    let before = pids(&old);
    kill_supervisor(child);
    let report = old.dir.path().join("anew.json");
    let anew = support::encke()
        .args(["run", "--sweeps", "20", "--pace", "fast", "--adopt", "--instance", &old.instance, "--report"])
        .arg(&report)
        .output()
        .unwrap();
    let said = support::text(&anew.stderr);
    assert_eq!(anew.status.code(), Some(0), "{said}");
    assert!(said.contains("not adopted") && said.contains("pace") && said.contains("sweeps"), "{said}");
    let report: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    assert_eq!(report["sweeps"], 20);
    assert!(support::leftovers(&old.instance).is_empty());
    for pid in before {
        assert!(std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default().is_empty());
    }
}

#[test]
fn without_the_option_the_stages_of_a_dead_supervisor_are_ended() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let before = pids(&run);
    kill_supervisor(child);
    let child = run.start();
    await_supervisor(&run, &child);
    run.wait_for_sweeps(3);
    assert!(pids(&run).iter().all(|pid| !before.contains(pid)));
    stop(run, child);
}

#[test]
fn adoption_needs_the_name_of_the_instance() {
    let output = support::encke().args(["run", "--adopt"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(support::text(&output.stderr).contains("--instance"));
}

/// Times that everything is killed in the test below; `ENCKE_ALL_KILLS=100` makes a campaign of it.
fn all_kills() -> u64 {
    std::env::var("ENCKE_ALL_KILLS").map_or(3, |kills| kills.parse().unwrap())
}

#[test]
fn everything_killed_in_random_order_is_followed_by_a_clean_start() {
    let mut state = 7_u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let mut run = Run::new(&["--duration", "forever"]);
    for _ in 0..all_kills() {
        let child = run.start();
        run.wait_for_sweeps(1 + random(4));
        let mut all = pids(&run);
        all.push(u64::from(child.id()));
        for last in (1..all.len()).rev() {
            all.swap(last, random(last as u64 + 1) as usize);
        }
        for pid in all {
            // A stage whose supervisor still lives has a successor by now, whose process is another.
            support::kill(pid);
            std::thread::sleep(Duration::from_millis(random(3)));
        }
        kill_supervisor(child);
        // Those that were restarted meanwhile.
        for pid in pids(&run) {
            let _ = kill_process(Pid::from_raw(pid as i32).unwrap(), Signal::KILL);
        }
        if random(2) == 0 {
            let next = Run::new(&["--sweeps", "3", "--pace", "fast"]);
            assert_eq!(next.finish().expect_code(0).sweeps(), [0, 1, 2]);
        }
        // The same name again, by the same command as ever.
        let child = adopt(&run);
        await_supervisor(&run, &child);
        run.wait_for_sweeps(2);
        drop(stop(run, child));
        run = Run::new(&["--duration", "forever"]);
    }
}

#[test]
fn the_tape_outlives_the_supervisor_and_its_file_is_whole() {
    let run = Run::new(&["--duration", "forever"]).with_file("--record", "run.mcap");
    let child = run.start();
    run.wait_for_sweeps(4);
    kill_supervisor(child);
    await_more(&run, 4);
    let child = adopt(&run);
    await_adoption(&run, 1);
    await_more(&run, 4);
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    let (run, dir) = run.collect_and_keep(child);
    let run = run.expect_code(0);
    let recording = &run.report["recording"];
    assert_eq!(recording["restarts"], 0, "{recording}");
    let bytes = std::fs::read(dir.path().join("run.mcap")).unwrap();
    // With an index at its end, all of it readable.
    mcap::Summary::read(&bytes).unwrap().unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
    assert!(messages > 0);
    assert_eq!(recording["sweeps"].as_u64().unwrap_or(run.sweeps().len() as u64), run.sweeps().len() as u64);
}

#[test]
fn at_fast_pace_nothing_is_lost_and_no_byte_changes() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "600", "--pace", "fast"];
    let plain = Run::new(&args).finish().expect_code(0);
    for with_stage in [None, Some(0), Some(2), Some(4)] {
        let run = Run::new(&args);
        let child = run.start();
        run.wait_for_sweeps(5);
        let pid = with_stage.map(|position| pids(&run)[position]);
        kill_supervisor(child);
        pid.into_iter().for_each(support::kill);
        let child = adopt(&run);
        let run = run.collect(child).expect_code(0);
        assert!(run.is_closed());
        assert_eq!(run.missing(), 0);
        assert_eq!(plain.bytes, run.bytes, "{with_stage:?}");
    }
}
