//! Statistics do not grow with the run. One test in a file of its own: the allocator counts for the whole process.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::alloc::System;

use common::{HandMade, settings, start};
use recorder::{Settings, Snapshot};
use stage::Sink;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Sweeps of 10 Hz until nearly every bucket of time is in use for the first time, and long after.
const FILLED: u64 = 1_490;
const LATER: u64 = 6_000;

// verifies REC-025
#[test]
fn ten_minutes_of_ever_new_latencies_take_no_more_memory_than_the_first_two_and_a_half() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("statistics.json");
    let mut recorder = start(Settings { statistics: Some(path.clone()), ..settings() }).unwrap();
    let mut sweep = 0;
    let mut go_on = |until: u64| {
        while sweep < until {
            let (mut trace, message) = HandMade::interleaved(sweep, 100, 5, 10).whole();
            // From 5 to 45 ms, each a bit different from all before.
            let longer_ns = sweep.wrapping_mul(2_654_435_761) % 40_000_000;
            trace.hops[3].finished_ns += longer_ns;
            recorder.accept(&trace, &message);
            sweep += 1;
            if sweep.is_multiple_of(100) {
                recorder.checkpoint().unwrap();
            }
        }
    };
    go_on(FILLED);
    let region = Region::new(GLOBAL);
    go_on(LATER);
    let change = region.change();
    let taken = change.bytes_allocated as i64 - change.bytes_deallocated as i64;
    assert!(taken <= 0, "{taken} bytes more than after {FILLED} sweeps");
    let snapshot = Snapshot::read(&path).unwrap();
    assert_eq!(snapshot.sweeps, LATER);
    assert!(snapshot.end_to_end.values_ns.len() > 1_000, "latencies did differ");
}
