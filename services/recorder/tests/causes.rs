//! Each cause of a miss, from traces worked out by hand. Sweeps are due every 100 ms from 1 s on.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::collections::BTreeMap;

use common::{settings, start};
use messages::{Detections, Hop, Part, Trace, Verdict};
use recorder::Snapshot;
use zerocopy::FromZeros;

const MS: u64 = 1_000_000;

/// A hop with times in ms: free, received, started, finished.
fn hop(ms: [u64; 4]) -> Hop {
    let [free_ns, received_ns, started_ns, finished_ns] = ms.map(|ms| ms * MS);
    Hop { free_ns, received_ns, started_ns, finished_ns, incarnation: 1, ..Hop::default() }
}

/// What was taken of a hop, before and in `process` [ms].
fn taken(hop: Hop, before_ms: u32, busy_ms: u32) -> Hop {
    Hop { taken_before_ns: before_ms * 1_000_000, taken_busy_ns: busy_ms * 1_000_000, ..hop }
}

fn life(hop: Hop, incarnation: u32) -> Hop {
    Hop { incarnation, ..hop }
}

/// A whole sweep with these hops.
fn sweep(sweep: u64, hops: &[Hop]) -> Trace {
    let part = Part { ordinal: sweep, sweep, sectors: 1, ..Part::default() };
    let mut trace = Trace { part, due_ns: (1_000 + 100 * sweep) * MS, ..Trace::default() };
    hops.iter().for_each(|&hop| trace.push(hop));
    trace
}

fn found(traces: &[Trace]) -> Snapshot {
    let mut recorder = start(settings()).unwrap();
    let mut message = Detections::new_box_zeroed().unwrap();
    message.header.period_ns = 100 * MS;
    message.header.complete = 1;
    for trace in traces {
        recorder.accept(trace, &message);
    }
    let mut snapshot = Snapshot::default();
    recorder.snapshot_into(&mut snapshot);
    snapshot
}

fn check(traces: &[Trace], expected: &[(&str, u64)]) {
    let found = found(traces).deadline;
    let causes: BTreeMap<_, _> = expected.iter().map(|&(cause, misses)| (cause.to_owned(), misses)).collect();
    assert_eq!(found.causes, causes);
    assert_eq!(found.misses, causes.values().sum::<u64>(), "each miss has one cause");
}

/// The source at work on sweep 0, in time.
const SOURCE: [u64; 4] = [0, 900, 900, 1_000];

// verifies REC-013
#[test]
fn exactly_on_the_deadline_is_no_miss() {
    check(&[sweep(0, &[hop(SOURCE), hop([0, 1_001, 1_001, 1_100])])], &[]);
}

// verifies REC-013
#[test]
fn a_source_that_sends_after_the_last_return_was_due_is_late() {
    let hops = [hop([0, 900, 900, 1_090]), hop([0, 1_091, 1_091, 1_111])];
    check(&[sweep(0, &hops)], &[("simulator late", 1)]);
}

// verifies REC-013
#[test]
fn a_source_that_had_no_core_is_not_called_late() {
    let hops = [taken(hop([0, 900, 900, 1_090]), 0, 60), hop([0, 1_091, 1_091, 1_111])];
    check(&[sweep(0, &hops)], &[("simulator cpu taken", 1)]);
}

// verifies REC-013
#[test]
fn a_stage_that_was_free_and_did_not_begin_was_slow_to_wake_up() {
    let hops = [hop(SOURCE), hop([0, 1_080, 1_110, 1_130])];
    check(&[sweep(0, &hops)], &[("clusterer wake-up", 1)]);
}

// verifies REC-013
#[test]
fn a_stage_that_worked_for_most_of_the_time_computed() {
    let hops = [hop(SOURCE), hop([0, 1_001, 1_001, 1_020]), hop([0, 1_030, 1_040, 1_111])];
    check(&[sweep(0, &hops)], &[("extractor compute", 1)]);
}

// verifies REC-013
#[test]
fn a_stage_whose_core_was_taken_neither_slept_nor_computed() {
    let before = [hop(SOURCE), taken(hop([0, 1_080, 1_110, 1_130]), 90, 0)];
    let within = [hop(SOURCE), taken(hop([0, 1_001, 1_001, 1_130]), 0, 80)];
    // 60 ms of each is less than 69 ms of work, and together more.
    let both = [hop(SOURCE), taken(hop([0, 1_061, 1_061, 1_190]), 60, 60)];
    for hops in [before, within, both] {
        check(&[sweep(0, &hops)], &[("clusterer cpu taken", 1)]);
    }
}

// verifies REC-013
#[test]
fn a_queue_behind_nothing_that_is_known_is_queueing() {
    let hops = [hop(SOURCE), hop([1_080, 1_080, 1_080, 1_130])];
    check(&[sweep(0, &hops)], &[("clusterer queueing", 1)]);
}

/// A sweep 0 that held the clusterer until 1.4 s, as `own`; sweeps 1 to 3 that queued behind it and took 5 ms each.
fn held_up_by(own: Hop) -> [Trace; 4] {
    assert_eq!(own.finished_ns, 1_400 * MS);
    let behind = |number: u64| {
        let (due_ms, free_ms) = (1_000 + 100 * number, 1_400 + 5 * (number - 1));
        sweep(number, &[hop([0, due_ms - 50, due_ms - 50, due_ms]), hop([free_ms, free_ms, free_ms, free_ms + 5])])
    };
    [sweep(0, &[hop(SOURCE), own]), behind(1), behind(2), behind(3)]
}

// verifies REC-013
#[test]
fn a_queue_is_charged_to_what_the_stage_did_with_the_parts_before() {
    check(&held_up_by(hop([0, 1_001, 1_001, 1_400])), &[("clusterer compute", 4)]);
    check(&held_up_by(hop([0, 1_390, 1_390, 1_400])), &[("clusterer wake-up", 4)]);
    check(&held_up_by(taken(hop([0, 1_390, 1_390, 1_400]), 385, 0)), &[("clusterer cpu taken", 4)]);
}

// verifies REC-013
#[test]
fn a_queue_is_charged_to_the_longest_of_what_happened_in_it_not_before() {
    // The clusterer slept until 1.26 s and worked until 1.4 s: when sweep 2 came to wait, most of the sleep was over.
    let traces = held_up_by(hop([0, 1_260, 1_260, 1_400]));
    check(&traces, &[("clusterer wake-up", 2), ("clusterer compute", 2)]);
}

// verifies REC-013
#[test]
fn the_stage_that_held_up_a_sweep_is_the_cause_not_the_one_that_worked_off_the_rush_behind_it() {
    // The clusterer stood still until 1.3 s; then all three came to the extractor at once, which takes 50 ms for each.
    let held = |number: u64| {
        let (due_ms, at_ms) = (1_000 + 100 * number, 1_300 + number);
        let free_ms = if number == 0 { 0 } else { at_ms };
        let begin_ms = 1_301 + 50 * number;
        let extractor_free_ms = if number == 0 { 0 } else { begin_ms };
        sweep(
            number,
            &[
                hop([0, due_ms - 50, due_ms - 50, due_ms]),
                hop([free_ms, at_ms, at_ms, at_ms + 1]),
                hop([extractor_free_ms, begin_ms, begin_ms, begin_ms + 50]),
            ],
        )
    };
    // The last one waited for 102 ms for the clusterer and 98 ms for the extractor, and for another 50 ms of its work.
    check(&[held(0), held(1), held(2)], &[("clusterer wake-up", 3)]);
}

// verifies REC-013
#[test]
fn a_backlog_of_many_short_parts_is_their_work() {
    // Four sectors come at once (a torn recording): the last waits for the work on the others, 40 ms each.
    let part = |sector: u64| {
        let begin = 1_000 + 40 * sector;
        let free = if sector == 0 { 0 } else { begin };
        let mut trace = sweep(0, &[hop(SOURCE), hop([free, begin, begin, begin + 40])]);
        trace.part = Part { ordinal: sector, sector: sector as u32, sectors: 4, ..trace.part };
        trace
    };
    check(&[part(0), part(1), part(2), part(3)], &[("clusterer compute", 1)]);
}

// verifies REC-013
#[test]
fn a_restart_wins_over_all_and_what_queued_behind_it_is_charged_to_it() {
    // The clusterer died with sweep 1, its successor was up at 1.45 s and took 10 ms for each of the others.
    let on_time = sweep(0, &[hop(SOURCE), hop([0, 1_001, 1_001, 1_010])]);
    let after = |number: u64| {
        let (due_ms, free_ms) = (1_000 + 100 * number, 1_450 + 10 * (number - 2));
        let own = life(hop([free_ms, free_ms, free_ms, free_ms + 10]), 2);
        sweep(number, &[hop([0, due_ms - 50, due_ms - 50, due_ms]), own])
    };
    check(&[on_time, after(2), after(3)], &[("clusterer restart", 2)]);
    // Even where most of the time went elsewhere.
    let source = hop([0, 1_000, 1_000, 1_190]);
    let late = sweep(1, &[source, life(hop([1_150, 1_190, 1_190, 1_210]), 2)]);
    check(&[on_time, late], &[("clusterer restart", 1)]);
    // But once.
    let late_again = sweep(2, &[hop([0, 1_100, 1_100, 1_300]), life(hop([1_210, 1_300, 1_300, 1_310]), 2)]);
    check(&[on_time, late, late_again], &[("clusterer restart", 1), ("simulator late", 1)]);
}

// verifies REC-013
#[test]
fn a_rejected_sweep_is_a_miss_by_its_first_verdict_unless_on_purpose() {
    let rejected = |number: u64, verdicts: [Verdict; 2]| {
        let due_ms = 1_000 + 100 * number;
        let mut trace = sweep(
            number,
            &[hop([0, due_ms, due_ms, due_ms]), hop([0, due_ms, due_ms, due_ms]), hop([0, due_ms, due_ms, due_ms])],
        );
        (trace.hops[1].verdict, trace.hops[2].verdict) = (verdicts[0], verdicts[1]);
        trace
    };
    let traces = [
        rejected(0, [Verdict::RejectedStale, Verdict::RejectedIncomplete]),
        rejected(1, [Verdict::PartialCells, Verdict::RejectedMalformed]),
        rejected(2, [Verdict::RejectedShed, Verdict::Complete]),
        rejected(3, [Verdict::RejectedIncomplete, Verdict::Complete]),
        rejected(4, [Verdict::Complete, Verdict::Complete]),
    ];
    check(&traces, &[("clusterer stale", 1), ("extractor malformed", 1), ("clusterer restart", 1)]);
}

// verifies REC-018
#[test]
fn the_ten_worst_sweeps_are_kept_with_every_hop() {
    let traces: Vec<Trace> = (0..12)
        .map(|number| {
            let due_ms = 1_000 + 100 * number;
            sweep(
                number,
                &[hop([0, due_ms - 9, due_ms - 9, due_ms]), hop([0, due_ms + 1, due_ms + 1, due_ms + 2 + number])],
            )
        })
        .collect();
    let worst = found(&traces).worst;
    assert_eq!(worst.iter().map(|worst| worst.sweep).collect::<Vec<_>>(), [11, 10, 9, 8, 7, 6, 5, 4, 3, 2]);
    assert_eq!((worst[0].cause.as_str(), worst[0].step.as_str()), ("clusterer compute", "nominal"));
    let hop = &worst[0].hops[1];
    assert_eq!((hop.stage.as_str(), hop.wake_ms, hop.busy_ms, hop.queued_ms), ("clusterer", 1.0, 12.0, 0.0));
    assert_eq!((hop.started_after_due_ms, hop.finished_after_due_ms), (1.0, 13.0));
}
