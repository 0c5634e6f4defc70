//! Faults that a stage's own process has: the chain answers again, its neighbours never notice, and the ledger is closed.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::process::{Child, Command};
use std::time::Duration;

use runtime::Plan;
use runtime::page::{Heard, PageMap};
use serde_json::Value;
use support::{Finished, Run, chain_with};

const STAGES: [&str; 6] = ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"];

/// A chain that runs for as long as the test wants.
struct Endless {
    run: Run,
    child: Child,
    /// Processes before anything happened, in flow order.
    pids: Vec<u64>,
    _config: tempfile::TempDir,
}

impl Endless {
    /// With some lines of chain.toml changed; stages may die as often as they like.
    fn start(changes: &[(&str, &str)]) -> Self {
        Self::start_on("config/scenes/default.toml", changes)
    }

    fn start_on(scene: &str, changes: &[(&str, &str)]) -> Self {
        let endless = ("restarts = 10", "restarts = 1000");
        let (config, chain) = chain_with(&[&[endless], changes].concat());
        let run = Run::new(&["--duration", "forever", "--from", scene, "--chain", &chain]);
        // What is said of thousands of deaths does not fit into a pipe that nobody reads meanwhile.
        let child = run.start_with(|encke| {
            let mut shell = Command::new("sh");
            shell.args(["-c", "exec \"$@\" 2>/dev/null", "sh"]).arg(encke.get_program()).args(encke.get_args());
            shell
        });
        run.wait_for_sweeps(5);
        let pids = pids(&run.status().unwrap());
        Self { run, child, pids, _config: config }
    }

    fn stage(&self, name: &str) -> Value {
        let status = self.run.status().unwrap();
        status["stages"].as_array().unwrap().iter().find(|stage| stage["stage"] == name).unwrap().clone()
    }

    /// Waits until a stage has been restarted so often and runs.
    fn wait_for_restarts(&self, name: &str, restarts: u64) {
        self.run.wait_for(|_| {
            let stage = self.stage(name);
            stage["restarts"].as_u64().unwrap() >= restarts && stage["state"] == "running"
        });
    }

    /// Asserts that nobody but `name` has another process than before.
    fn expect_same_neighbours(&self, name: &str) {
        let now = pids(&self.run.status().unwrap());
        for (place, stage) in STAGES.iter().enumerate().filter(|(_, stage)| **stage != name) {
            assert_eq!(now[place], self.pids[place], "{stage} is another process after a fault of {name}");
        }
    }

    /// Stops it: the ledger is closed, every sweep is accounted for, and nothing is left behind.
    fn stop(self) -> Finished {
        let run = self.stop_with_unnamed_gaps();
        run.expect_every_sweep_accounted_for();
        run
    }

    /// The same after so many losses that the oldest are counted only.
    fn stop_with_unnamed_gaps(self) -> Finished {
        let stop = support::encke().args(["ctl", "stop", "--instance", &self.run.instance]).status().unwrap();
        assert!(stop.success());
        let run = self.run.collect(self.child).expect_code(0);
        assert!(run.is_closed(), "{}", run.stdout());
        run
    }
}

fn pids(status: &Value) -> Vec<u64> {
    status["stages"].as_array().unwrap().iter().map(|stage| stage["pid"].as_u64().unwrap()).collect()
}

/// Panics of each stage in the test below; `ENCKE_PANICS=1000` makes a campaign of it.
fn panics() -> u64 {
    std::env::var("ENCKE_PANICS").map_or(20, |panics| panics.parse().unwrap())
}

#[test]
fn a_stage_that_panics_with_messages_in_hand_many_times_leaks_none() {
    let chain = Endless::start(&[]);
    let panics = panics();
    for stage in STAGES {
        chain.run.inject(&["panic", stage, "--times", &panics.to_string()]);
        for seen in 1..=panics {
            chain.wait_for_restarts(stage, seen);
        }
        // Whoever leaked would have no message left to loan long before: there are as many as queues hold, and a few.
        chain.run.wait_for_more(5);
        chain.wait_for_restarts(stage, panics);
    }
    let run = chain.stop_with_unnamed_gaps();
    for stage in STAGES {
        assert_eq!(run.process(stage)["restarts"].as_u64(), Some(panics), "{stage}");
    }
}

#[test]
fn a_stage_whose_heap_is_exhausted_ends_alone() {
    let chain = Endless::start(&[]);
    for stage in ["clusterer", "recorder"] {
        let before = pids(&chain.run.status().unwrap());
        chain.run.inject(&["heap-exhaustion", stage]);
        chain.wait_for_restarts(stage, 1);
        chain.run.wait_for_more(3);
        let now = pids(&chain.run.status().unwrap());
        let changed: Vec<&str> =
            STAGES.into_iter().zip(before.iter().zip(&now)).filter(|(_, (a, b))| a != b).map(|(s, _)| s).collect();
        assert_eq!(changed, [stage]);
    }
    chain.stop();
}

#[test]
fn a_stage_that_hangs_or_spins_is_replaced_and_the_chain_answers_again() {
    for fault in ["deadlock", "spin"] {
        let chain = Endless::start(&[]);
        chain.run.inject(&[fault, "extractor"]);
        // Its heartbeat stands still, whoever acts on that.
        chain.run.wait_for(|_| {
            let stage = chain.stage("extractor");
            stage["heartbeat_age_ms"].as_f64().unwrap() > 200.0 || stage["restarts"].as_u64().unwrap() > 0
        });
        let mut looks = 0;
        while chain.stage("extractor")["restarts"] == 0 {
            std::thread::sleep(Duration::from_millis(50));
            looks += 1;
            if looks == 100 {
                println!("{fault}: nobody acted within 5 s; killed by the test");
                chain.run.inject(&["kill", "extractor"]);
            }
        }
        chain.wait_for_restarts("extractor", 1);
        chain.run.wait_for_more(5);
        chain.expect_same_neighbours("extractor");
        chain.stop();
    }
}

#[test]
fn a_stage_that_dies_at_its_start_again_and_again_comes_back_when_it_no_longer_does() {
    let chain = Endless::start(&[]);
    chain.run.inject(&["crash-loop", "classifier", "--times", "4"]);
    // With the part in hand, and at four starts.
    chain.wait_for_restarts("classifier", 5);
    chain.run.wait_for_more(5);
    chain.expect_same_neighbours("classifier");
    let run = chain.stop();
    assert_eq!(run.process("classifier")["restarts"], 5);
}

#[test]
fn a_stage_that_computes_twenty_times_as_long_is_seen_to_and_recovers() {
    let chain = Endless::start(&[]);
    chain.run.inject(&["slow-times", "extractor", "--by", "20", "--for", "2s"]);
    chain.run.wait_for_more(5);
    let run = chain.stop();
    assert!(run.report["overload"]["overruns"]["extractor"].as_u64().unwrap() > 0, "{}", run.report["overload"]);
    assert_eq!(run.process("extractor")["restarts"], 0);
}

#[test]
fn a_storm_of_events_says_as_many_as_it_should_and_hinders_nobody() {
    let chain = Endless::start(&[]);
    let instance = transport::Instance::named(&chain.run.instance).unwrap();
    for stage in ["source", "classifier"] {
        let page = PageMap::open(&Plan::page_path(&instance, stage)).unwrap();
        let count = || {
            let (mut heard, mut told) = (Heard::default(), 0);
            page.hear(&mut heard, |_| told += 1);
            told + heard.missed
        };
        let before = count();
        chain.run.inject(&["event-storm", stage, "--for", "500ms"]);
        chain.run.wait_for(|_| page.fault.get() == 0);
        let said = count() - before;
        assert!((5_000..6_000).contains(&said), "{stage} said {said}");
        chain.run.wait_for_more(3);
    }
    chain.expect_same_neighbours("");
    chain.stop();
}

#[test]
fn nothing_older_than_allowed_is_answered_though_its_stage_had_looked_at_its_age_before() {
    // The tracker computes on after it has looked and answered: what it then sends is old, and the sink says so.
    // One obstacle, so that what comes to it is young, however busy the machine is.
    let younger = ("allowed_age_ms = 1000.0", "allowed_age_ms = 400.0");
    let chain = Endless::start_on("config/scenes/single.toml", &[younger]);
    chain.run.inject(&["slow", "tracker", "--by", "800ms", "--for", "3s"]);
    chain.run.wait_for_more(5);
    let run = chain.stop();
    let stale = run.hop("recorder")["rejected"]["stale"].as_u64().unwrap_or(0);
    assert!(stale > 0, "{}", run.hop("recorder"));
    let incomplete = run.detections.iter().filter(|line| line["complete"] != true).count();
    assert!(incomplete > 0);
    for line in run.detections.iter().filter(|line| line["rejected_sectors"].as_u64().unwrap_or(0) > 0) {
        assert_eq!(line["complete"], false, "{line}");
    }
    let causes = run.report["deadline"]["causes"].as_object().unwrap();
    assert!(causes.keys().any(|cause| cause == "recorder stale"), "{causes:?}");
    // Of three digits.
    let oldest_ms = run.report["latency_ms"]["end_to_end"]["max"].as_f64().unwrap();
    assert!(oldest_ms <= 400.4, "{oldest_ms} ms");
}
