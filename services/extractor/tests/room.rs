//! The stage as the shell sees it: messages in, messages out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{histogram_params, message, scattered, sphere};
use extractor::Extractor;
use lidar::Return;
use messages::{Clusters, Descriptors, Message, Part, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

fn room() -> Extractor {
    Extractor::init(histogram_params()).unwrap()
}

fn process(room: &mut Extractor, input: &Clusters) -> (Verdict, Box<Descriptors>) {
    let mut output = Descriptors::new_box_zeroed().unwrap();
    let verdict = room.process(Part::default(), input, &mut output);
    (verdict, output)
}

fn cluster(count: usize, seed: u64) -> Vec<Return> {
    scattered(count, seed, None).iter().map(|&[x, y, z]| Return { x, y, z, ..Return::default() }).collect()
}

const STEP_RAD: f32 = 0.012_566_37;

// verifies EXT-008
#[test]
fn every_cluster_passes_on_and_small_ones_without_bins() {
    let input = message(&[cluster(4, 1), cluster(5, 2), cluster(1, 3), cluster(60, 4)], STEP_RAD);
    let (verdict, output) = process(&mut room(), &input);
    assert_eq!(verdict, Verdict::Complete);
    assert_eq!(output.header, input.header);
    assert_eq!(output.members[..], input.members[..]);
    let bins: Vec<u32> = output.descriptors.iter().map(|d| d.bins).collect();
    assert!(bins[0] == 0 && bins[1] > 0 && bins[2] == 0 && bins[3] > bins[1], "{bins:?}");
    let mut next = 0;
    for (descriptor, cluster) in output.descriptors.iter().zip(&input.clusters) {
        assert_eq!(descriptor.summary, cluster.summary);
        assert_eq!(descriptor.first_bin, next);
        next += descriptor.bins;
    }
    assert_eq!(output.bins.len(), next as usize);
}

#[test]
fn a_sweep_without_clusters_gives_an_empty_message() {
    let (verdict, output) = process(&mut room(), &message(&[], STEP_RAD));
    assert_eq!(verdict, Verdict::Complete);
    assert!(output.descriptors.is_empty() && output.members.is_empty() && output.bins.is_empty());
}

// verifies EXT-009
#[test]
fn a_clusters_bins_do_not_depend_on_the_clusters_beside_it() {
    let mut sut = room();
    let wanted = sphere([6.0, 0.5, 0.2], 1.0, 0.72, 0.02, 4);
    let (_, alone) = process(&mut sut, &message(std::slice::from_ref(&wanted), STEP_RAD));
    let (_, among) = process(&mut sut, &message(&[cluster(700, 1), wanted, cluster(80, 2)], STEP_RAD));
    assert_eq!(among.bins[among.descriptors[1].bin_places()], alone.bins[..]);
}

// verifies EXT-010
#[test]
fn a_message_that_contradicts_itself_is_rejected_and_gives_nothing() {
    let mut sut = room();
    let spoils: [fn(&mut Clusters); 8] = [
        |m| m.clusters[1].summary.first_member += 1,
        |m| m.clusters[1].summary.points += 1,
        |m| m.clusters[1].summary.points = u32::MAX,
        |m| m.clusters[0].summary.points = 0,
        |m| m.clusters[0].summary.first_member = u32::MAX,
        |m| m.members.truncate(3),
        |m| m.returns.truncate(3),
        |m| m.returns[2].y = f32::NAN,
    ];
    for (number, spoil) in spoils.into_iter().enumerate() {
        let mut input = message(&[cluster(20, 1), cluster(9, 2)], STEP_RAD);
        assert_eq!(process(&mut sut, &input).0, Verdict::Complete);
        spoil(&mut input);
        let (verdict, output) = process(&mut sut, &input);
        assert_eq!(verdict, Verdict::RejectedMalformed, "spoil {number}");
        assert!(output.descriptors.is_empty() && output.members.is_empty() && output.bins.is_empty());
    }
}

#[test]
fn the_largest_sweep_as_one_cluster_is_served() {
    let returns: Vec<Return> = (0..lidar::MAX_RETURNS)
        .map(|i| Return {
            x: 10.0 + (i % 384) as f32 * 0.01,
            y: (i / 384) as f32 * 0.01,
            z: ((i * 7_919) % 101) as f32 * 0.001,
            ..Return::default()
        })
        .collect();
    let (verdict, output) = process(&mut room(), &message(&[returns], STEP_RAD));
    assert_eq!(verdict, Verdict::Complete);
    let sum: f64 = output.bins.iter().map(|bin| f64::from(bin.weight)).sum();
    assert!((sum - 1.0).abs() < 1e-5);
}

#[test]
fn coordinates_at_the_ends_of_their_range_do_no_harm() {
    let far = f32::MAX;
    let returns: Vec<Return> = (0..12)
        .map(|i| Return { x: [far, -far, 1e-40, 0.0][i % 4], y: far / (1 + i) as f32, z: -far, ..Return::default() })
        .collect();
    let (verdict, output) = process(&mut room(), &message(&[returns], STEP_RAD));
    assert_eq!(verdict, Verdict::Complete);
    assert!(output.bins.iter().all(|bin| bin.index < 1_728 && bin.weight.is_finite()));
}

#[test]
fn an_output_used_before_is_as_good_as_a_new_one() {
    let mut sut = room();
    let input = message(&[cluster(40, 5)], STEP_RAD);
    let (_, fresh) = process(&mut sut, &input);
    let mut used = Descriptors::new_box_zeroed().unwrap();
    sut.process(Part::default(), &message(&[cluster(900, 6), cluster(30, 7)], STEP_RAD), &mut used);
    used.clear();
    sut.process(Part::default(), &input, &mut used);
    assert_eq!(used.bins[..], fresh.bins[..]);
    assert_eq!(used.descriptors[..], fresh.descriptors[..]);
}
