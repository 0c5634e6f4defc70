//! Who judges at each step of overload.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use classifier::{Classifier, OverloadParams, Params};
use common::{fit, fitted_message, histograms, message, naive_bayes_params, trees_params, trees_text};
use lidar::ObstacleClass;
use messages::{Descriptors, Detections, Part, Step, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

/// At which steps the cluster of a message is given a class.
fn judged(params: Params, input: &Descriptors) -> [bool; 5] {
    let mut sut = Classifier::init(params).unwrap();
    Step::ALL.map(|step| {
        let mut output = Detections::new_box_zeroed().unwrap();
        let verdict = sut.process(Part { step: step as u32, ..Part::default() }, input, &mut output);
        assert_eq!((verdict, output.detections.len()), (Verdict::Complete, 1), "{step:?}");
        output.detections[0].class != ObstacleClass::Unclassified
    })
}

fn standby() -> Option<OverloadParams> {
    let Params { method, model, files, .. } = naive_bayes_params();
    Some(OverloadParams { method, model, files })
}

// verifies CLA-012
#[test]
fn solids_are_judged_while_they_are_fitted_and_histograms_by_the_standby_alone() {
    let solid = fitted_message(&[(6, Some(fit(0, 0.5)))]);
    let histogram = message(&[(6, histograms(1, 1).remove(0).1)]);
    let with = || Params { overload: standby(), ..trees_params(&trees_text()) };
    assert_eq!(judged(with(), &solid), [true, true, false, false, false]);
    assert_eq!(judged(with(), &histogram), [false, false, true, false, false]);
    assert_eq!(judged(trees_params(&trees_text()), &histogram), [false; 5], "nobody is standing by");
    assert_eq!(judged(naive_bayes_params(), &histogram), [true, true, true, false, false]);
}

#[test]
fn a_standby_that_needs_solids_or_has_no_files_is_refused() {
    let refused = |overload| Classifier::init(Params { overload, ..naive_bayes_params() }).unwrap_err().to_string();
    let Params { method, model, files, .. } = trees_params(&trees_text());
    let trees = Some(OverloadParams { method, model, files });
    assert!(refused(trees).contains("overload.method is boosted-trees, must be svm or naive-bayes"));
    let without = standby().map(|standby| OverloadParams { files: None, ..standby });
    assert!(refused(without).contains("files of model \"test\" were not given"));
}
