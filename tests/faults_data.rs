//! Sweeps as they should not be, through the real chain: every one is answered, and the next as ever.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use serde_json::Value;
use support::{Finished, Run};

const SWEEP_FAULTS: [(&str, &[&str]); 19] = [
    ("beams-missing", &["--by", "3"]),
    ("crosstalk", &["--by", "3"]),
    ("dust", &["--by", "3"]),
    ("motion-blur", &["--by", "3"]),
    ("incomplete-echo", &["--by", "3"]),
    ("dust", &["--level", "1", "--times", "3", "--seed", "9"]),
    ("empty-sweep", &["--times", "2"]),
    ("one-point", &[]),
    ("all-nan", &["--times", "2"]),
    ("duplicate-points", &[]),
    ("giant-cluster", &[]),
    ("duplicated-sweep", &[]),
    ("skipped-sweep", &["--times", "2"]),
    ("reordered-sweeps", &[]),
    ("clock-step", &["--by", "1h"]),
    ("clock-step", &["--by=-1h"]),
    ("clock-step", &["--by", "-250ms"]),
    ("empty-sweep", &[]),
    ("oversized-sweep", &[]),
];

fn stop(run: &Run) {
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
}

fn refused(run: &Finished, reason: &str) -> u64 {
    run.detections.iter().map(|line| line["refused"][reason].as_u64().unwrap_or(0)).sum()
}

#[test]
fn every_spoiled_sweep_is_answered_where_nothing_may_be_lost() {
    // A hundred sweeps a second at most, so that the file of detections stays small.
    let run = Run::new(&["--duration", "forever", "--pace", "fast"]);
    let child = run.start();
    run.inject_when_up(&["slow", "source", "--by", "10ms"]);
    run.wait_for_sweeps(5);
    for (fault, args) in SWEEP_FAULTS {
        run.inject(&[&[fault], args].concat());
        run.wait_for_more(30);
    }
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    assert_eq!(run.missing(), 0, "nothing is lost or dropped");
    // One more may have been under way.
    let sweeps = run.report["sweeps"].as_u64().unwrap();
    let lines: Vec<u64> = run.sweeps().into_iter().take_while(|sweep| *sweep < sweeps).collect();
    assert_eq!(lines, (0..sweeps).collect::<Vec<_>>());
    for process in run.report["processes"].as_array().unwrap() {
        assert_eq!(process["restarts"], 0, "{process}");
    }
    assert_eq!(refused(&run, "over_capacity"), 1, "what does not fit is counted");
    let empty = run.detections.iter().filter(|line| line["returns"] == 0 && line["complete"] == true).count();
    assert_eq!(empty, 3, "a sweep without a return is a sweep");
    let rejected = run.detections.iter().filter(|line| line["rejected_sectors"].as_u64().unwrap_or(0) > 0).count();
    assert_eq!(rejected, 2, "two of which no coordinate is a number");
    let is_late = |pair: &[Value]| time_ns(&pair[1]) <= time_ns(&pair[0]);
    let back = run.detections.windows(2).filter(|pair| is_late(pair)).count();
    assert_eq!(back, 4, "one came twice, two changed places, the clock went back twice");
}

fn time_ns(line: &Value) -> u64 {
    line["sensor_time_ns"].as_u64().unwrap()
}

#[test]
fn a_clock_that_steps_by_an_hour_stops_nobody_and_ends_no_run() {
    for by in ["--by=1h", "--by=-1h"] {
        let run = Run::new(&["--duration", "4s", "--from", "config/scenes/single.toml"]);
        let child = run.start();
        run.wait_for_sweeps(10);
        run.inject(&["clock-step", by]);
        let run = run.collect(child).expect_code(0);
        assert!(run.is_closed(), "{}", run.stdout());
        let sweeps = run.report["sweeps"].as_u64().unwrap();
        assert!((38..=41).contains(&sweeps), "{sweeps} sweeps in 4 s of sensor time, {by}");
        // An hour late, or early, would be refused, or never come.
        let answered = run.detections.iter().filter(|line| line["complete"] == true).count();
        assert!(answered >= 20, "{answered} of {sweeps}: {}", run.stdout());
        let step = run.detections.windows(2).map(|pair| time_ns(&pair[1]).abs_diff(time_ns(&pair[0]))).max();
        assert!(step.unwrap() > 500_000_000, "the step is in the data");
    }
}

#[test]
fn a_spoiled_sensor_at_its_own_rate_is_answered_and_the_chain_recovers() {
    let run = Run::new(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    for fault in ["dust", "crosstalk", "giant-cluster", "all-nan"] {
        run.inject(&[fault, "--times", "2"]);
        run.wait_for_more(5);
    }
    stop(&run);
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    let last = run.detections.last().unwrap();
    assert_eq!(last["rejected_sectors"], Value::Null, "{last}");
}
