//! The stage as the shell sees it: messages in, messages out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use classifier::{Classifier, Params};
use common::{
    fit, fitted_message, histograms, message, naive_bayes_params, svm_params, text_of, trained, trees_params,
    trees_text,
};
use lidar::ObstacleClass;
use messages::{Bin, Descriptors, Detections, Part, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

fn process(room: &mut Classifier, input: &Descriptors) -> (Verdict, Box<Detections>) {
    let mut output = Detections::new_box_zeroed().unwrap();
    let verdict = room.process(Part::default(), input, &mut output);
    (verdict, output)
}

fn rooms() -> [Params; 2] {
    [naive_bayes_params(), svm_params(&text_of(&trained(4, 400, 10.0, true)))]
}

// verifies CLA-001
#[test]
fn posteriors_sum_to_one_and_made_up_classes_are_told_apart() {
    for params in rooms() {
        let mut sut = Classifier::init(params).unwrap();
        let examples = histograms(200, 5);
        let entries: Vec<(u32, Vec<Bin>)> = examples.iter().map(|(_, bins)| (6, bins.clone())).collect();
        let (verdict, output) = process(&mut sut, &message(&entries));
        assert_eq!(verdict, Verdict::Complete);
        let mut right = 0;
        for (detection, (label, _)) in output.detections.iter().zip(&examples) {
            assert!((detection.posterior.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            assert!(detection.posterior.iter().all(|p| (0.0..=1.0).contains(p)));
            right += usize::from(detection.class as i32 == *label);
        }
        assert!(right > 180, "{right} of 200");
    }
}

// verifies CLA-002
#[test]
fn clusters_without_bins_stay_unclassified() {
    for params in rooms() {
        let mut sut = Classifier::init(params).unwrap();
        let bins = histograms(1, 1).remove(0).1;
        let input = message(&[(4, vec![]), (9, bins), (1, vec![])]);
        let (verdict, output) = process(&mut sut, &input);
        assert_eq!(verdict, Verdict::Complete);
        assert_eq!((output.header, &output.members[..]), (input.header, &input.members[..]));
        assert_eq!(output.detections.len(), 3);
        for (detection, descriptor) in output.detections.iter().zip(&input.descriptors) {
            assert_eq!(detection.summary, descriptor.summary);
            let without = descriptor.bins == 0;
            assert_eq!(detection.class == ObstacleClass::Unclassified, without);
            assert_eq!(detection.posterior == [0.0; 4], without);
        }
    }
}

#[test]
fn a_cluster_is_judged_the_same_alone_and_among_others() {
    for params in rooms() {
        let mut sut = Classifier::init(params).unwrap();
        let entries: Vec<(u32, Vec<Bin>)> = histograms(9, 8).into_iter().map(|(_, bins)| (7, bins)).collect();
        let (_, among) = process(&mut sut, &message(&entries));
        for (entry, together) in entries.iter().zip(&among.detections) {
            let (_, alone) = process(&mut sut, &message(std::slice::from_ref(entry)));
            assert_eq!(alone.detections[0].posterior, together.posterior);
            assert_eq!(alone.detections[0].class, together.class);
        }
    }
}

// verifies CLA-006
#[test]
fn a_message_that_contradicts_itself_is_rejected_and_gives_nothing() {
    let mut sut = Classifier::init(naive_bayes_params()).unwrap();
    let spoils: [fn(&mut Descriptors); 10] = [
        |m| m.descriptors[1].first_bin += 1,
        |m| m.descriptors[1].bins = u32::MAX,
        |m| m.descriptors[1].summary.first_member = 0,
        |m| m.descriptors[0].summary.points = u32::MAX,
        |m| m.bins.truncate(1),
        |m| m.members.truncate(1),
        |m| m.bins[0].index = 1_728,
        |m| m.bins[1].index = m.bins[0].index,
        |m| m.bins[0].weight = f32::NAN,
        |m| m.bins[0].weight = -0.5,
    ];
    for (number, spoil) in spoils.into_iter().enumerate() {
        let entries: Vec<(u32, Vec<Bin>)> = histograms(2, 3).into_iter().map(|(_, bins)| (5, bins)).collect();
        let mut input = message(&entries);
        assert_eq!(process(&mut sut, &input).0, Verdict::Complete);
        spoil(&mut input);
        let (verdict, output) = process(&mut sut, &input);
        assert_eq!(verdict, Verdict::RejectedMalformed, "spoil {number}");
        assert!(output.detections.is_empty() && output.members.is_empty());
    }
}

// verifies CLA-009
#[test]
fn fitted_clusters_are_judged_and_carry_the_solid_of_their_class() {
    let mut sut = Classifier::init(trees_params(&trees_text())).unwrap();
    let entries = [(9, Some(fit(2, 1.0))), (3, None), (30, Some(fit(0, 1.0))), (8, Some(fit(3, 0.5)))];
    let input = fitted_message(&entries);
    let (verdict, output) = process(&mut sut, &input);
    assert_eq!(verdict, Verdict::Complete);
    let classes: Vec<_> = output.detections.iter().map(|detection| detection.class).collect();
    let [rectangular, _, cylindrical, conical] = ObstacleClass::SOLIDS;
    assert_eq!(classes, [cylindrical, ObstacleClass::Unclassified, rectangular, conical]);
    let places: Vec<_> = output.detections.iter().map(|detection| detection.solid_place()).collect();
    assert_eq!(places, [Some(0), None, Some(1), Some(2)]);
    for (solid, (fit, class)) in output.solids.iter().zip([(0, 2), (2, 0), (3, 3)]) {
        assert_eq!(*solid, entries[fit].1.unwrap().solids[class].solid);
    }
    let posterior = output.detections[0].posterior;
    assert!((posterior.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    assert!((posterior[2] / posterior[1] - 3.0_f32.exp()).abs() < 1e-3);
}

// verifies CLA-010
#[test]
fn a_cluster_that_no_solid_explains_is_none_of_the_four() {
    let mut sut = Classifier::init(trees_params(&trees_text())).unwrap();
    // The card allows 5 a hit.
    let input = fitted_message(&[(9, Some(fit(1, 4.9_f32.sqrt()))), (9, Some(fit(1, 5.1_f32.sqrt())))]);
    let (_, output) = process(&mut sut, &input);
    assert_eq!(output.detections[0].class, ObstacleClass::Ellipsoidal);
    assert_eq!((output.detections[1].class, output.detections[1].posterior), (ObstacleClass::Unclassified, [0.0; 4]));
    assert_eq!((output.solids.len(), output.detections[1].solid_place()), (1, None));
}

// verifies CLA-011
#[test]
fn a_class_less_likely_than_the_least_posterior_is_not_claimed() {
    // Its own e³ against three times 1: 0.870.
    let input = fitted_message(&[(9, Some(fit(2, 1.0)))]);
    for (least_posterior, claimed) in [(0.0, true), (0.86, true), (0.88, false), (1.0, false)] {
        let params = Params { least_posterior, ..trees_params(&trees_text()) };
        let (_, output) = process(&mut Classifier::init(params).unwrap(), &input);
        assert_eq!(output.detections[0].class == ObstacleClass::Cylindrical, claimed, "{least_posterior}");
        assert_eq!(output.solids.len(), usize::from(claimed));
    }
    for least_posterior in [-0.1, 1.1, f32::NAN] {
        let refused = Classifier::init(Params { least_posterior, ..trees_params(&trees_text()) }).unwrap_err();
        assert!(refused.to_string().starts_with("least_posterior is"), "{refused}");
    }
}

// verifies CLA-006
#[test]
fn fits_that_do_not_belong_to_their_descriptors_are_rejected() {
    let mut sut = Classifier::init(trees_params(&trees_text())).unwrap();
    let spoils: [fn(&mut Descriptors); 5] = [
        |m| m.descriptors[1].first_fit += 1,
        |m| m.descriptors[0].fits = 2,
        |m| m.descriptors[1].fits = 0,
        |m| m.fits.truncate(1),
        |m| m.fits[0].solids[3].hit_cost = f32::NAN,
    ];
    for (number, spoil) in spoils.into_iter().enumerate() {
        let mut input = fitted_message(&[(5, Some(fit(0, 1.0))), (5, Some(fit(1, 1.0)))]);
        assert_eq!(process(&mut sut, &input).0, Verdict::Complete);
        spoil(&mut input);
        let (verdict, output) = process(&mut sut, &input);
        assert_eq!(verdict, Verdict::RejectedMalformed, "spoil {number}");
        assert!(output.detections.is_empty() && output.solids.is_empty());
    }
}

#[test]
fn judges_of_histograms_leave_fitted_clusters_alone_and_the_other_way_round() {
    let fits = fitted_message(&[(9, Some(fit(2, 1.0)))]);
    let bins = message(&[(9, histograms(1, 1).remove(0).1)]);
    for (params, input) in [(naive_bayes_params(), &fits), (trees_params(&trees_text()), &bins)] {
        let (verdict, output) = process(&mut Classifier::init(params).unwrap(), input);
        assert_eq!((verdict, output.detections[0].class), (Verdict::Complete, ObstacleClass::Unclassified));
    }
}
