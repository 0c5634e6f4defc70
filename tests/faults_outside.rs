//! Faults from outside: disks, deleted files, everything killed, other programs, and commands that make no sense.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use serde_json::Value;
use support::{Run, encke, text};

fn stop(run: &Run) {
    let stop = encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
}

/// What an injection is refused with, as for a chain that cannot start: exit code 2.
fn refused(args: &[&str]) -> String {
    let output = encke().arg("inject").args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output.stderr));
    text(&output.stderr)
}

#[test]
fn every_fault_has_its_line_of_help_and_what_cannot_be_is_refused_with_what_can() {
    let help = text(&encke().args(["inject", "--help"]).output().unwrap().stdout);
    let said = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for entry in faults::CATALOGUE {
        assert!(said.contains(&format!("- {}: {}", entry.name, entry.help)), "{}", entry.name);
    }
    assert!(refused(&["joy"]).contains("giant-cluster"), "the words that there are");
    assert!(refused(&["panic"]).contains("panic hits a stage: name one"));
    assert!(refused(&["dust", "recorder"]).contains("dust hits the source"));
    assert!(refused(&["cpu-hog", "source"]).contains("cpu-hog hits the machine: no name"));
    assert!(refused(&["dust", "--by", "4"]).contains("level is 4, must be 1 to 3"));
    assert!(refused(&["slow", "source", "--by", "5"]).contains("--by 5"));
    assert!(refused(&["kill", "source", "--for", "1s"]).contains("kill does not last for a time"));
    assert!(refused(&["stop", "source", "--times", "2"]).contains("stop is not had a number of times"));

    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(2);
    let refused = |args: &[&str]| refused(&[args, &["--instance", &run.instance]].concat());
    assert!(refused(&["kill", "telescope"]).contains("no stage \"telescope\"; there are source, clusterer"));
    assert!(refused(&["disk-full", "clusterer"]).contains("disk-full cannot hit \"clusterer\"; it can hit recorder"));
    assert!(
        refused(&["config-corruption", "source"]).contains("it can hit classifier, clusterer, extractor"),
        "who has parameters"
    );
    stop(&run);
    run.collect(child).expect_code(0);
}

#[test]
fn a_full_disk_costs_the_recorder_its_file_and_the_chain_nothing() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    let before = run.status().unwrap();
    run.inject(&["disk-full", "--for", "1s"]);
    run.wait_for_more(5);
    let now = run.status().unwrap();
    for place in 0..5 {
        assert_eq!(now["stages"][place]["pid"], before["stages"][place]["pid"]);
    }
    stop(&run);
    let run = run.collect(child);
    assert!(run.is_closed(), "{}", run.stdout());
    assert!(!run.detections.is_empty(), "what was written before stays, whole");
    assert!(run.stderr().contains("d.jsonl"), "{}", run.stderr());
    assert!(run.sweeps().windows(2).all(|pair| pair[0] < pair[1]));
}

#[test]
fn all_processes_killed_in_any_order_leave_nothing_that_hinders_the_next_start() {
    for seed in ["1", "2", "3"] {
        let run = Run::new(&["--duration", "forever"]);
        let mut child = run.start();
        run.wait_for_sweeps(2);
        run.inject(&["kill-all", "--seed", seed]);
        child.wait().unwrap();
        // By the same name: a stage that was started again while the others died waits for a supervisor, and is ended by one
        // that begins anew.
        let again = ["run", "--sweeps", "3", "--pace", "fast", "--instance", &run.instance];
        let again = support::encke().args(again).output().unwrap();
        assert_eq!(again.status.code(), Some(0), "{}", support::text(&again.stderr));
        assert!(support::leftovers(&run.instance).is_empty());
    }
}

/// Waits until every stage runs in its life of this number, as configured.
fn wait_for_lives(run: &Run, lives: u64) {
    run.wait_for(|status| {
        let stages = status["stages"].as_array().unwrap();
        stages.iter().all(|stage| {
            (&stage["restarts"], &stage["state"], &stage["tier"])
                == (&(lives - 1).into(), &"running".into(), &"configured".into())
        })
    });
}

#[test]
fn deleted_shared_memory_is_made_anew_without_a_loss_and_beyond_the_budget_the_chain_stops_in_order() {
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    let instance = transport::Instance::named(&run.instance).unwrap();
    // The shipped chain may be restarted twice within ten minutes.
    for life in [2, 3] {
        let before = instance.shared_memory();
        let deleted_ns = runtime::clock::now_ns();
        run.inject(&["shared-memory-gone"]);
        wait_for_lives(&run, life);
        let took_s = (runtime::clock::now_ns() - deleted_ns) as f64 / 1e9;
        println!("noticed, and all processes back, after {took_s:.1} s");
        run.wait_for_more(3);
        let now = instance.shared_memory();
        assert!(!now.is_empty() && !now.iter().any(|name| before.contains(name)), "{before:?}, {now:?}");
    }
    let named = |id: &str| run.events().iter().filter(|event| event["name"] == id).count();
    assert_eq!([named("shared_memory_gone"), named("chain_restarted"), named("run_began")], [2, 2, 1]);
    assert_eq!(named("stage_died"), 0, "all left in order");
    run.inject(&["shared-memory-gone"]);
    let run = run.collect(child).expect_code(1);
    assert!(run.is_closed(), "{}", run.stdout());
    assert_eq!(run.missing(), 0, "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    let said = run.stderr();
    assert!(said.contains("files of the chain in shared memory were deleted"), "{said}");
    assert!(said.contains("may be restarted 2 times within 600 s, and was"), "{said}");
    Run::new(&["--sweeps", "3", "--pace", "fast"]).finish().expect_code(0);
}

#[test]
fn a_lossless_run_whose_shared_memory_is_deleted_ends_with_the_same_bytes() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "120", "--pace", "fast"];
    let plain = Run::new(&args).finish().expect_code(0);
    let run = Run::new(&args);
    let child = run.start();
    run.wait_for_sweeps(1);
    run.inject(&["slow", "classifier", "--by", "20ms"]);
    run.inject(&["shared-memory-gone"]);
    wait_for_lives(&run, 2);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    assert!(run.bytes == plain.bytes);
}

#[test]
fn a_stage_that_dies_while_there_is_no_shared_memory_to_join_comes_back_as_configured() {
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    run.inject(&["shared-memory-gone"]);
    run.inject(&["kill", "extractor"]);
    wait_for_lives(&run, 2);
    run.wait_for_more(3);
    // What a death leaves in the new files is settled and cleaned as ever.
    run.inject(&["kill", "classifier"]);
    run.wait_for(|status| {
        let classifier = &status["stages"][3];
        (&classifier["restarts"], &classifier["state"]) == (&2.into(), &"running".into())
    });
    run.wait_for_more(3);
    assert_ne!(run.status().unwrap()["mode"], "safe");
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
}

#[test]
fn damaged_parameters_and_models_are_refused_by_name_and_put_right_again() {
    for (fault, stage, file) in
        [("config-corruption", "clusterer", "clusterer.toml"), ("model-corruption", "classifier", "solids")]
    {
        let run = Run::new(&["--duration", "forever"]).with_file("--events", "e.jsonl");
        let mut child = run.start();
        run.wait_for_sweeps(5);
        let instance = transport::Instance::named(&run.instance).unwrap();
        let before = runtime::Plan::read(&instance).unwrap();
        run.inject(&[fault, stage, "--for", "300ms"]);
        // Where less trusted parts stand in, the chain goes on; else it ends by itself.
        for _ in 0..200 {
            if child.try_wait().unwrap().is_some() {
                break;
            }
            if let Ok(plan) = runtime::Plan::read(&instance) {
                assert_eq!((&plan.parameters, &plan.config_dirs), (&before.parameters, &before.config_dirs), "{fault}");
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        if child.try_wait().unwrap().is_none() {
            run.wait_for_more(3);
            stop(&run);
        }
        // In safe mode, or ended: a damaged table is no ordinary run.
        let (run, dir) = run.collect_and_keep(child);
        let run = run.expect_code(1);
        assert!(run.is_closed(), "{}", run.stdout());
        assert!(run.stderr().contains(file), "{fault}: {}", run.stderr());
        // One that was refused died by its own number, not by that of the life before it.
        let events = std::fs::read_to_string(dir.path().join("e.jsonl")).unwrap();
        let events: Vec<Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let deaths = events.iter().filter(|event| event["name"] == "stage_died" && event["stage"] == stage);
        let texts: Vec<&str> = deaths.map(|event| event["text"].as_str().unwrap()).collect();
        let pids: Vec<u64> = run.process(stage)["pids"].as_array().unwrap().iter().filter_map(Value::as_u64).collect();
        let told: Vec<u64> = texts.iter().map(|text| text.split([' ', ':']).nth(1).unwrap().parse().unwrap()).collect();
        assert!(told.len() > 1 && pids.starts_with(&told), "{texts:?} of {pids:?}");
    }
}

#[test]
fn programs_that_take_cores_memory_and_disk_end_with_their_time_and_the_ledger_closes() {
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    for (hog, workers) in [("cpu-hog", "3"), ("memory-hog", "1"), ("io-hog", "1")] {
        let output = encke().args(["inject", hog, "--for", "500ms", "--workers", workers]).output().unwrap();
        assert!(output.status.success(), "{hog}: {}", text(&output.stderr));
        run.wait_for_more(2);
    }
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
}

#[test]
fn a_hog_ends_with_whoever_started_it() {
    let mut hog = encke().args(["inject", "cpu-hog", "--for", "60s"]).spawn().unwrap();
    let children = format!("/proc/{0}/task/{0}/children", hog.id());
    let worker = loop {
        let found = std::fs::read_to_string(&children).unwrap();
        // It must have come so far as to ask for the signal.
        let Some(worker) = found.split_whitespace().next().map(str::to_owned) else { continue };
        let line = std::fs::read(format!("/proc/{worker}/cmdline")).unwrap_or_default();
        let stat = std::fs::read_to_string(format!("/proc/{worker}/stat")).unwrap_or_default();
        let cpu_ticks: u64 = stat.split(' ').nth(13).and_then(|ticks| ticks.parse().ok()).unwrap_or(0);
        if text(&line).contains("--as-worker") && cpu_ticks > 5 {
            break worker;
        }
    };
    hog.kill().unwrap();
    hog.wait().unwrap();
    let stat = format!("/proc/{worker}/stat");
    let is_gone =
        || std::fs::read_to_string(&stat).is_ok_and(|stat| stat.contains(") Z ")) || !std::fs::exists(&stat).unwrap();
    assert!(runtime::clock::wait_for(5_000_000_000, is_gone), "the worker outlived its starter");
}
