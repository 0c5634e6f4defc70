//! Faults on purpose: what dies is restarted, what is lost is named, what is swallowed is found out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::process::Child;

use runtime::clock;
use support::{Finished, Run};

const STAGES: [&str; 6] = ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"];

#[test]
fn a_killed_stage_is_back_and_the_ledger_names_what_was_lost() {
    for stage in STAGES {
        let run = Run::new(&["--duration", "forever"]);
        let child = run.start();
        run.wait_for_sweeps(5);
        run.inject(&["kill", stage]);
        run.wait_for(|status| {
            let stages = status["stages"].as_array().unwrap();
            let killed = stages.iter().find(|s| s["stage"] == stage).unwrap();
            killed["restarts"] == 1 && killed["state"] == "running"
        });
        run.wait_for_more(5);
        let run = stop_with_every_sweep_accounted_for(run, child);
        assert_eq!(run.process(stage)["restarts"], 1);
        assert_eq!(run.process(stage)["pids"].as_array().unwrap().len(), 2);
    }
}

#[test]
fn a_stage_that_swallows_a_part_leaves_the_ledger_open() {
    for stage in STAGES {
        let run = Run::new(&["--duration", "forever"]);
        let child = run.start();
        run.wait_for_sweeps(5);
        run.inject(&["swallow", stage]);
        let now = run.status().unwrap()["sweep"].as_u64().unwrap();
        run.wait_for_sweeps(now + 5);
        super_stop(&run);
        let run = run.collect(child).expect_code(1);
        assert!(!run.is_closed());
        // What the source swallows is missing on the first hop.
        let hop = if stage == "source" { "clusterer" } else { stage };
        assert_eq!(run.hop(hop)["open"], 1, "{stage}");
        assert!(run.stdout().contains("ledger OPEN"));
    }
}

#[test]
fn a_slow_stage_loses_nothing_at_fast_pace_and_changes_no_byte() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "200", "--pace", "fast"];
    let plain = Run::new(&args).finish().expect_code(0);
    let run = Run::new(&args);
    let child = run.start();
    run.wait_for_sweeps(1);
    run.inject(&["slow", "classifier", "--by", "20ms"]);
    let slow = run.collect(child).expect_code(0);
    assert_eq!(slow.missing(), 0);
    assert_eq!(plain.bytes, slow.bytes);
}

#[test]
fn a_stopped_stage_is_charged_with_every_sweep_that_it_held_up() {
    // One obstacle, so that no other stage has much to catch up with.
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(10);
    run.inject(&["stop", "clusterer", "--for", "600ms"]);
    let now = run.status().unwrap()["sweep"].as_u64().unwrap();
    run.wait_for_sweeps(now + 5);
    let run = stop_with_every_sweep_accounted_for(run, child);
    // Six sweeps come due while it stands still. The first two do not fit into the queue of four; of the others at least
    // three wait for more than the deadline of 100 ms, whatever the phase. A clock that started with each sweep's
    // processing would have seen one.
    let deadline = &run.report["deadline"];
    assert!(deadline["misses"].as_u64().unwrap() >= 5, "{deadline}");
    let causes = deadline["causes"].as_object().unwrap().iter();
    let charged: u64 =
        causes.filter(|(cause, _)| cause.starts_with("clusterer")).map(|(_, n)| n.as_u64().unwrap()).sum();
    assert!(charged >= 5, "{deadline}");
    let worst = &run.report["worst_sweeps"][0];
    assert!(worst["end_to_end_ms"].as_f64().unwrap() > 200.0, "{worst}");
    assert!(worst["cause"].as_str().unwrap().starts_with("clusterer"), "{worst}");
}

/// Kills a stage whenever it runs, until it is built so or the run has ended; how often.
fn crash_loop(run: &Run, child: &mut Child, stage: usize, until: &str) -> u64 {
    for kills in 0..50 {
        let mut there = false;
        run.wait_for_or_end(child, |status| {
            let stage = &status["stages"][stage];
            stage["restarts"].as_u64() == Some(kills) && stage["state"] == "running"
        });
        if let Some(status) = run.status() {
            there = status["stages"][stage]["tier"] == until;
        }
        if there || child.try_wait().unwrap().is_some() {
            return kills;
        }
        let kill = ["inject", "kill", STAGES[stage], "--instance", &run.instance];
        let _ = support::encke().args(kill).output().unwrap();
    }
    panic!("an endless restart loop");
}

#[test]
fn a_stage_that_keeps_dying_is_stood_in_for_in_safe_mode_until_it_gets_another_chance() {
    let (_dir, chain) =
        support::chain_with(&[("restarts = 10", "restarts = 2"), (support::LADDER, support::NO_LADDER)]);
    for stage in 1..STAGES.len() {
        let run = Run::new(&["--duration", "forever", "--chain", &chain]);
        let mut child = run.start();
        run.wait_for_sweeps(2);
        // Two restarts as configured, then three lives with what is built in.
        assert_eq!(crash_loop(&run, &mut child, stage, "stand-in"), 6);
        run.wait_for_mode("safe");
        assert_eq!(run.status().unwrap()["stages"][stage]["tier"], "stand-in");
        // Four may have waited in queues, begun by a life before it.
        run.wait_for_more(12);
        let said: Vec<String> = run.events().iter().map(|event| event["name"].as_str().unwrap().to_owned()).collect();
        for name in ["stage_died", "stage_restarted", "budget_spent", "safe_entered", "stand_in", "mode_entered"] {
            assert!(said.iter().any(|said| said == name), "{name} of {said:?}");
        }
        run.ctl(&["resume"]);
        run.wait_for_mode("nominal");
        run.wait_for(|status| {
            let stage = &status["stages"][stage];
            stage["tier"] == "configured" && stage["restarts"] == 7 && stage["state"] == "running"
        });
        run.wait_for_more(5);
        super_stop(&run);
        let run = run.collect(child).expect_code(1);
        assert!(run.is_closed(), "{}", run.stdout());
        let says = format!("safe mode was entered: stage {:?} died more than 2 times", STAGES[stage]);
        assert!(run.stderr().contains(&says), "{}", run.stderr());
        assert_eq!(run.report["safe_entered"]["by"], "executive");
        if STAGES[stage] == "recorder" {
            // Its stand-in counts and writes nothing.
            let is_gap = |pair: &[u64]| pair[1] - pair[0] > 5;
            assert!(run.sweeps().windows(2).any(is_gap), "{:?}", run.sweeps());
            continue;
        }
        run.expect_every_sweep_accounted_for();
        // While it was stood in for, each sweep was answered: with nothing in it, or what the tracker only hands on.
        let hands_on = STAGES[stage] == "tracker";
        assert!(run.hop(STAGES[stage])["rejected"]["down"].as_u64().unwrap() >= 4 * 36, "{}", run.stdout());
        let is_bare = |line: &&serde_json::Value| {
            line["rejected_sectors"] == 36
                && line["complete"] == false
                && line["detections"].as_array().unwrap().is_empty() != hands_on
        };
        assert!(run.detections.iter().filter(is_bare).count() >= 4);
        let last_bare = run.detections.iter().rposition(|line| is_bare(&line)).unwrap();
        let classified = |line: &serde_json::Value| {
            line["detections"].as_array().unwrap().iter().any(|detection| detection["class"] != "unclassified")
        };
        assert!(run.detections[last_bare..].iter().any(classified), "classes are back");
    }
}

#[test]
fn a_source_that_keeps_dying_ends_the_run() {
    let run = Run::new(&["--duration", "forever"]);
    let mut child = run.start();
    run.wait_for_sweeps(2);
    // Ten restarts, then three lives with what is built in.
    assert_eq!(crash_loop(&run, &mut child, 0, "stand-in"), 14);
    let run = run.collect(child).expect_code(1);
    assert!(run.is_closed(), "{}", run.stdout());
    assert!(run.stderr().contains("stage \"source\" died 3 times more, built-in"), "{}", run.stderr());
    assert_eq!(run.process("source")["pids"].as_array().unwrap().len(), 14);
}

#[test]
fn a_stage_that_cannot_start_again_goes_on_with_what_is_built_in() {
    let (dir, chain) = support::chain_with(&[]);
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(3);
    let model = dir.path().join("models/solids");
    std::fs::create_dir_all(&model).unwrap();
    std::fs::write(model.join("card.toml"), "no card").unwrap();
    run.inject(&["kill", "classifier"]);
    run.wait_for(|status| status["stages"][3]["tier"] == "built-in" && status["stages"][3]["state"] == "running");
    run.wait_for_mode("safe");
    run.wait_for_more(3);
    // Mended, it may go on as configured.
    std::fs::remove_dir_all(&model).unwrap();
    run.ctl(&["resume"]);
    run.wait_for_mode("nominal");
    run.wait_for(|status| status["stages"][3]["tier"] == "configured" && status["stages"][3]["state"] == "running");
    run.wait_for_more(3);
    super_stop(&run);
    let run = run.collect(child).expect_code(1);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    assert!(run.stderr().contains("stage \"classifier\" could not start again"), "{}", run.stderr());
}

#[test]
fn restarts_by_command_count_against_no_budget() {
    let (_dir, chain) = support::chain_with(&[("restarts = 10", "restarts = 0")]);
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(2);
    for restarts in 1..4 {
        run.ctl([["restart", "extractor"].as_slice(), &["restart-chain"], &["restart", "source"]][restarts - 1]);
        run.wait_for_more(2);
    }
    let status = run.status().unwrap();
    let restarts: Vec<u64> =
        status["stages"].as_array().unwrap().iter().map(|stage| stage["restarts"].as_u64().unwrap()).collect();
    assert_eq!((restarts, status["mode"].as_str()), (vec![2, 1, 2, 1, 1, 1], Some("nominal")));
    stop_with_every_sweep_accounted_for(run, child);
}

fn super_stop(run: &Run) {
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
}

#[test]
fn what_a_killed_supervisor_leaves_is_removed() {
    let run = Run::new(&["--duration", "forever"]);
    let mut child = run.start();
    run.wait_for_sweeps(3);
    let stages = run.status().unwrap()["stages"].as_array().unwrap().clone();
    child.kill().unwrap();
    child.wait().unwrap();
    // The next chain, whatever its name, leaves alone what lives and cleans up after the dead.
    Run::new(&["--sweeps", "2", "--pace", "fast"]).finish().expect_code(0);
    for stage in &stages {
        let line = std::fs::read(format!("/proc/{}/cmdline", stage["pid"])).unwrap();
        assert!(support::text(&line).contains(&run.instance), "a stage did not wait to be adopted: {stage}");
        support::kill(stage["pid"].as_u64().unwrap());
    }
    for stage in stages {
        let path = format!("/proc/{}/cmdline", stage["pid"]);
        assert!(clock::wait_for(5_000_000_000, || std::fs::read(&path).unwrap_or_default().is_empty()));
    }
    Run::new(&["--sweeps", "2", "--pace", "fast"]).finish().expect_code(0);
    assert!(support::leftovers(&run.instance).is_empty());
}

/// Kills of each stage in the test below; `ENCKE_KILLS=50` makes a campaign of it.
fn kills() -> u32 {
    std::env::var("ENCKE_KILLS").map_or(6, |kills| kills.parse().unwrap())
}

#[test]
fn kills_at_random_moments_start_up_included_keep_the_ledger_closed() {
    let chain = endless_restarts();
    for (seed, stage) in STAGES.iter().enumerate() {
        let run = Run::new(&["--duration", "forever", "--chain", chain.path().join("chain.toml").to_str().unwrap()]);
        let child = run.start();
        run.wait_for_sweeps(1);
        let mut state = seed as u64 + 1;
        let mut deaths = 0;
        let mut back_after_ms = Vec::new();
        while deaths < kills() {
            let killed_ns = clock::now_ns();
            // Refused while no process of the stage has taken its page: then there was no death to count.
            let kill = ["inject", "kill", stage, "--instance", &run.instance];
            if !support::encke().args(kill).output().unwrap().status.success() {
                continue;
            }
            deaths += 1;
            if deaths % 2 == 0 {
                // Two sweeps: one may have been on its way.
                run.wait_for_more(2);
                back_after_ms.push((clock::now_ns() - killed_ns) / 1_000_000);
            }
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            std::thread::sleep(std::time::Duration::from_millis(state >> 57));
        }
        println!("{stage}: {deaths} deaths, output again after at most {:?} ms", back_after_ms.iter().max());
        run.wait_for_more(3);
        let run = stop_with_every_sweep_accounted_for(run, child);
        assert_eq!(run.process(stage)["restarts"].as_u64().unwrap(), u64::from(kills()));
    }
}

/// Stops the chain: the ledger is closed, and each sweep has a line or is named as missing.
fn stop_with_every_sweep_accounted_for(run: Run, child: Child) -> Finished {
    super_stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    run
}

#[test]
fn a_death_in_doubt_is_settled_once() {
    // The reader stands still while its writer dies: nobody can say whether the last part was sent.
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    for stage in ["clusterer", "extractor"] {
        let next = STAGES[STAGES.iter().position(|name| *name == stage).unwrap() + 1];
        std::thread::scope(|scope| {
            scope.spawn(|| run.inject(&["stop", next, "--for", "900ms"]));
            std::thread::sleep(std::time::Duration::from_millis(150));
            run.inject(&["kill", stage]);
        });
        run.wait_for_more(3);
    }
    stop_with_every_sweep_accounted_for(run, child);
}

#[test]
fn all_stages_killed_at_once_come_back_and_the_ledger_closes() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    let status = run.status().unwrap();
    for stage in status["stages"].as_array().unwrap() {
        support::kill(stage["pid"].as_u64().unwrap());
    }
    run.wait_for_more(3);
    stop_with_every_sweep_accounted_for(run, child);
}

#[test]
fn parts_swallowed_at_fast_pace_end_the_run_instead_of_hanging_it() {
    // Half a queue of four whole sweeps is in flight at most: with two swallowed the window stays shut.
    let run = Run::new(&["--sectors", "1", "--sweeps", "100000", "--pace", "fast"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    for _ in 0..2 {
        run.inject(&["swallow", "extractor"]);
    }
    let run = run.collect(child).expect_code(1);
    assert!(!run.is_closed());
    assert_eq!(run.hop("extractor")["open"], 2);
}

#[test]
fn duration_counts_from_the_runs_first_sweep_whoever_made_it() {
    let run = Run::new(&["--duration", "3s"]);
    let child = run.start();
    run.wait_for_sweeps(15);
    run.inject(&["kill", "source"]);
    let run = run.collect(child).expect_code(0);
    let sweeps = run.report["sweeps"].as_u64().unwrap();
    assert!(sweeps <= 30, "3 s of sensor time are 30 sweeps, not {sweeps}");
}

#[test]
fn stages_that_somebody_else_starts_may_come_in_any_order() {
    let run = Run::new(&["--no-spawn", "--sweeps", "30", "--pace", "fast"]);
    let child = run.start();
    let mut stages: Vec<_> = STAGES
        .iter()
        .map(|stage| support::encke().args(["stage", stage, "--instance", &run.instance]).spawn().unwrap())
        .collect();
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed());
    assert_eq!(run.missing(), 0);
    assert_eq!(run.sweeps().len(), 30);
    for stage in &mut stages {
        assert!(stage.wait().unwrap().success());
    }
}

/// A copy of the configuration in which stages may die as often as they like.
fn endless_restarts() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let shipped = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/chain.toml")).unwrap();
    let text = shipped.replace("restarts = 10", "restarts = 1000");
    assert_ne!(text, shipped);
    std::fs::write(dir.path().join("chain.toml"), text).unwrap();
    dir
}
