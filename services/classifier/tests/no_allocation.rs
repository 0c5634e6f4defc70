//! `process` takes no memory from the heap. Alone in its file: the counter sees every thread.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::alloc::System;

use classifier::Classifier;
use common::{
    fit, fitted_message, histograms, message, naive_bayes_params, svm_params, text_of, trained, trees_params,
    trees_text,
};
use messages::{Detections, Message, Part};
use stage::Stage;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

// verifies CLA-007
#[test]
fn processing_allocates_nothing() {
    let entries: Vec<_> = histograms(50, 4).into_iter().map(|(_, bins)| (8, bins)).collect();
    let histograms = message(&entries);
    let fits: Vec<_> = (0..50).map(|place| (8, Some(fit(place % 4, 1.0)))).collect();
    let fits = fitted_message(&fits);
    let svm = svm_params(&text_of(&trained(4, 200, 1.0, true)));
    for (params, input) in
        [(naive_bayes_params(), &histograms), (svm, &histograms), (trees_params(&trees_text()), &fits)]
    {
        let mut sut = Classifier::init(params).unwrap();
        let mut output = Detections::new_box_zeroed().unwrap();
        let region = Region::new(GLOBAL);
        for _ in 0..3 {
            output.clear();
            sut.process(Part::default(), input, &mut output);
        }
        let change = region.change();
        assert_eq!(output.detections.len(), 50);
        assert_eq!((change.allocations, change.reallocations, change.deallocations), (0, 0, 0));
    }
}
