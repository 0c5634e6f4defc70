//! The running chain against the clock: overload, misses and their causes, a machine that others use.
//!
//! One test at a time, because each uses the whole machine; verdicts are ratios, causes and the ledger.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::process::{Child, Command};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde_json::Value;
use support::{Finished, LADDER, NO_LADDER, Run, chain_with};

static MACHINE: Mutex<()> = Mutex::new(());

fn whole_machine() -> MutexGuard<'static, ()> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn stop(run: &Run) {
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
}

/// Misses whose cause ends with `kind`, and all.
fn misses(run: &Finished, kind: &str) -> (u64, u64) {
    let deadline = &run.report["deadline"];
    let causes = deadline["causes"].as_object().unwrap().iter().filter(|(cause, _)| cause.ends_with(kind));
    (causes.map(|(_, count)| count.as_u64().unwrap()).sum(), deadline["misses"].as_u64().unwrap())
}

/// Steps of degradation of the lines, each once per change.
fn steps_of(lines: &[Value]) -> Vec<&str> {
    let mut steps: Vec<&str> = lines.iter().map(|line| line["step"].as_str().unwrap_or("nominal")).collect();
    steps.dedup();
    steps
}

#[test]
fn a_stage_over_its_budget_takes_the_chain_down_the_ladder_and_back_step_by_step() {
    let _machine = whole_machine();
    let (_dir, chain) = chain_with(&[]);
    let run = Run::new(&["--duration", "forever", "--chain", &chain, "--from", "config/scenes/reference.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    run.inject(&["slow", "extractor", "--by", "70ms"]);
    run.wait_for(|status| status["step"] == "every-second-sweep");
    run.wait_for_more(6);
    run.inject(&["slow", "extractor", "--by", "0ms"]);
    run.wait_for(|status| status["step"] == "nominal");
    run.wait_for_more(3);
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();

    let names = ["nominal", "fewer-starts", "paper-features", "clusters-only", "every-second-sweep"];
    let moves = run.report["overload"]["moves"].as_array().unwrap();
    let down: Vec<&str> = moves.iter().take(4).map(|step| step["to"].as_str().unwrap()).collect();
    assert_eq!(down, names[1..], "{}", run.report["overload"]);
    assert!(moves[0]["reason"].as_str().unwrap().contains("overruns"), "{}", moves[0]);
    assert!(run.report["overload"]["overruns"]["extractor"].as_u64().unwrap() >= 12);
    assert!(run.hop("clusterer")["rejected"]["shed"].as_u64().unwrap() >= 2, "{}", run.hop("clusterer"));
    assert!(run.stdout().contains("overload: nominal to fewer-starts"), "{}", run.stdout());

    // Each line says at which step it was made, and holds what that step leaves.
    let steps = steps_of(&run.detections);
    assert_eq!(steps[..5], names, "{steps:?}");
    assert_eq!(steps.last(), Some(&"nominal"), "{steps:?}");
    for line in &run.detections {
        let detections = line["detections"].as_array().unwrap();
        let classified = detections.iter().any(|detection| detection["class"] != "unclassified");
        let fitted = detections.iter().any(|detection| !detection["centre_m"].is_null());
        match line["step"].as_str() {
            None | Some("fewer-starts") => assert!(classified && fitted, "{line}"),
            Some("paper-features") => assert!(classified && !fitted, "{line}"),
            Some(_) => assert!(!classified && !fitted, "{line}"),
        }
    }
}

#[test]
fn a_slow_stage_is_the_cause_of_its_misses_and_a_strict_run_fails_by_them() {
    let _machine = whole_machine();
    let (_dir, chain) = chain_with(&[(LADDER, NO_LADDER)]);
    let run = Run::new(&["--sweeps", "40", "--strict", "--chain", &chain, "--from", "config/scenes/reference.toml"]);
    let child = run.start();
    run.wait_for_sweeps(1);
    run.inject(&["slow", "extractor", "--by", "150ms"]);
    let run = run.collect(child).expect_code(1);
    assert!(run.is_closed(), "{}", run.stdout());
    let causes = run.report["deadline"]["causes"].as_object().unwrap().iter();
    let extractors: u64 =
        causes.filter(|(cause, _)| cause.starts_with("extractor")).map(|(_, count)| count.as_u64().unwrap()).sum();
    let (_, all) = misses(&run, "");
    assert!(all >= 20 && 10 * extractors >= 9 * all, "{}", run.report["deadline"]);
    assert_eq!(run.report["overload"]["move_count"], 0, "a ladder without steps");
}

/// A process that does nothing but use a core.
struct Hog(Child);

impl Hog {
    fn start() -> Self {
        Self(Command::new("sh").args(["-c", "while :; do :; done"]).spawn().unwrap())
    }
}

impl Drop for Hog {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn misses_beside_hogs_are_charged_to_those_who_took_the_cores_and_end_with_them() {
    let _machine = whole_machine();
    // A deadline that an idle machine meets, and eight hogs on two cores do not leave.
    let (_dir, chain) = chain_with(&[
        ("deadline_ms = 100.0", "deadline_ms = 6.0"),
        ("budget_ms = 10.0", "budget_ms = 2.0"),
        ("budget_ms = 60.0", "budget_ms = 2.0"),
        ("budget_ms = 20.0", "budget_ms = 1.0"),
        ("budget_ms = 5.0", "budget_ms = 1.0"),
        (LADDER, NO_LADDER),
    ]);
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(10);
    let hogs: Vec<Hog> = (0..8).map(|_| Hog::start()).collect();
    run.wait_for_more(40);
    drop(hogs);
    let ended = run.status().unwrap()["sweep"].as_u64().unwrap();
    run.wait_for_more(40);
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    let (taken, all) = misses(&run, "cpu taken");
    assert!(all >= 5, "{}", run.stdout());
    println!("{taken} of {all} misses by cpu taken: {}", run.report["deadline"]);
    assert!(2 * taken >= all, "{taken} of {all}: {}", run.report["deadline"]);
    let worst = run.report["worst_sweeps"].as_array().unwrap();
    let after = worst.iter().filter(|sweep| sweep["sweep"].as_u64().unwrap() > ended + 10).count();
    assert!(2 * after < worst.len(), "{after} of the worst after the hogs had ended: {}", run.stdout());
}

#[test]
fn one_core_alone_keeps_up_and_loses_nothing_silently() {
    let _machine = whole_machine();
    // Children inherit the cores of the thread that starts them.
    let before = sched_getaffinity(None).unwrap();
    let mut one = CpuSet::new();
    one.set((0..CpuSet::MAX_CPU).find(|&core| before.is_set(core)).unwrap());
    sched_setaffinity(None, &one).unwrap();
    let run = Run::new(&["--sweeps", "60"]);
    let child = run.start();
    sched_setaffinity(None, &before).unwrap();
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    let load = &run.report["machine_load"];
    let p99_ms = run.report["latency_ms"]["end_to_end"]["p99"].as_f64().unwrap();
    // Where others use the core too, it is their doing.
    let shared = load["foreign_cpu_worst_pct"].as_f64().unwrap() > 20.0;
    assert!(shared || p99_ms <= 200.0, "p99 {p99_ms} ms of two periods: {}", run.stdout());
}
