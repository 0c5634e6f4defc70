//! A sweep allocates nothing.

mod common;

use std::alloc::System;

use messages::{Sweep, Truth};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

// verifies SIM-012
#[test]
fn no_sweep_allocates_with_solids_meshes_motion_noise_and_dropouts() {
    let mut simulators = ["default", "spacecraft", "ring-crossing"]
        .map(|name| common::simulator(&common::config(&format!("scenes/{name}.toml"))));
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    let mut truth = Truth::new_box_zeroed().unwrap();
    let region = Region::new(GLOBAL);
    for simulator in &mut simulators {
        for number in [0, 1, 100, 1_000_000] {
            simulator.sweep(number, &mut sweep, &mut truth);
        }
    }
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0));
    drop(Box::new(sweep.returns.len())); // the counter counts
    assert_eq!(region.change().allocations, 1);
}
