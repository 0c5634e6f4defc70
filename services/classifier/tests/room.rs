//! The stage as the shell sees it: messages in, messages out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use classifier::{Classifier, Params};
use common::{histograms, message, naive_bayes_params, svm_params, text_of, trained};
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
