//! `process` takes no memory from the heap. Alone in its file: the counter sees every thread.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::alloc::System;

use common::{Seen, fill, moving, params, part};
use messages::{Detections, EgoMotion, Message, Part, Tracks};
use stage::Stage;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use tracker::Tracker;
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Allocations, reallocations and deallocations in `process`, of a tracker from its first sweep on.
fn counted() -> (usize, usize, usize) {
    let mut sut = Tracker::init(params()).unwrap();
    let mut input = Detections::new_box_zeroed().unwrap();
    let mut output = Tracks::new_box_zeroed().unwrap();
    let mut counted = (0, 0, 0);
    // More sweeps than snapshots; then the last ones again; some obstacles come and go, and two share a cluster.
    for (sweep, attempt) in (0..40).map(|sweep| (sweep, 0)).chain((30..45).map(|sweep| (sweep, 1))) {
        let seen: Vec<(u32, Seen)> = (0..60)
            .filter(|place| (sweep + place) % 9 > 0)
            .map(|place| {
                let from = [5.0 + place as f64, if place % 2 == 0 { 8.0 } else { -8.0 }, 0.0];
                (place as u32, Seen { fitted: place % 4 > 0, ..moving(from, [0.1, 0.2, 0.0], sweep) })
            })
            .collect();
        fill(&mut input, sweep, EgoMotion::default(), &seen);
        output.clear();
        let region = Region::new(GLOBAL);
        sut.process(Part { attempt, ..part(sweep, 0, 1) }, &input, &mut output);
        let change = region.change();
        counted.0 += change.allocations;
        counted.1 += change.reallocations;
        counted.2 += change.deallocations;
    }
    assert!(output.table.tracks.len() >= 50);
    counted
}

// verifies TRA-021
#[test]
fn processing_allocates_nothing() {
    // On a busy machine the harness's own thread is still at work, and counted too: what `process` takes, it takes each time.
    let rounds: Vec<_> = (0..5).map(|_| counted()).collect();
    assert!(rounds.contains(&(0, 0, 0)), "{rounds:?}");
}
