//! Once it runs, replaying a capture takes no memory. Without test harness: its threads allocate when they like.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use messages::Truth;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<std::alloc::System> = &INSTRUMENTED_SYSTEM;

// verifies RPL-018
fn main() {
    let Some(capture) = support::data("hdl32e/monterey_hdl32e.pcap") else { return };
    let mut recording = support::opened(&capture).unwrap();
    let (mut sweep, mut truth) = (support::new_sweep(), Truth::new_box_zeroed().unwrap());
    assert!(support::next(&mut recording, &mut sweep, &mut truth));
    let region = Region::new(GLOBAL);
    for _ in 0..17 {
        assert!(support::next(&mut recording, &mut sweep, &mut truth));
    }
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0), "a sweep takes none after the first");
    println!("a_sweep_of_a_capture_takes_no_allocation_after_the_first ... ok");
}
