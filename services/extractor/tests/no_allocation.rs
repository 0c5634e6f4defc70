//! `process` takes no memory from the heap. Alone in its file: the counter sees every thread.

mod common;

use std::alloc::System;

use common::{add_cells, message, params, sphere};
use extractor::Extractor;
use messages::{Cell, CellKind, Descriptors, Message, Part};
use stage::Stage;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

// verifies EXT-011
#[test]
fn processing_allocates_nothing() {
    let clusters: Vec<_> =
        (1..30).map(|i| sphere([3.0 + f64::from(i) * 0.7, 0.3, 0.1], 0.9, 0.18, 0.02, i as u64)).collect();
    let mut input = message(&clusters, 0.18_f32.to_radians());
    input.ring_elevation_rad.extend_from_slice(&[0.1; 32]).unwrap();
    let cell = Cell { kind: CellKind::Miss, ..Cell::default() };
    add_cells(&mut input, &[cell; 1_000]);
    let mut sut = Extractor::init(params()).unwrap();
    let mut output = Descriptors::new_box_zeroed().unwrap();
    let region = Region::new(GLOBAL);
    for _ in 0..3 {
        output.clear();
        sut.process(Part::default(), &input, &mut output);
    }
    let change = region.change();
    assert!(!output.bins.is_empty() && !output.fits.is_empty());
    assert_eq!((change.allocations, change.reallocations, change.deallocations), (0, 0, 0));
}
