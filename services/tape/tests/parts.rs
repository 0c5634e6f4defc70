//! Parts that are missing, come twice, too late, or in another order.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{Made, UTC_NS, give, made, read, sequences, settings, shipped, start};
use messages::{Message, Trace};
use tape::{Tape, Topic};

const SECTORS: u32 = 3;

fn sweep(tape: &mut Tape, made: &Made, sectors: &[u32]) {
    let parts = made.sweep_parts(SECTORS);
    for &sector in sectors {
        let (trace, piece) = &parts[sector as usize];
        tape.sweep(UTC_NS, trace, piece);
    }
}

fn detections(tape: &mut Tape, made: &Made, sectors: &[u32]) {
    let parts = made.detection_parts(SECTORS);
    for &sector in sectors {
        let (trace, piece) = &parts[sector as usize];
        tape.detections(UTC_NS, trace, piece);
        tape.tracks(UTC_NS, trace, &made.tracks_with(trace));
    }
}

/// Numbers of the sweeps written and lost, of sweeps, detections, clusters and tracks.
#[derive(Debug, PartialEq)]
struct Outcome {
    sweeps: (Vec<u32>, u64),
    detections: (Vec<u32>, u64),
    clusters: (Vec<u32>, u64),
    tracks: (Vec<u32>, u64),
}

fn outcome(hold_sweeps: usize, feed: impl FnOnce(&mut Tape)) -> (Outcome, tape::Counts) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let settings = tape::TapeFile { hold_sweeps, ..shipped() }.checked().unwrap();
    let mut tape = start(settings, &path, SECTORS);
    feed(&mut tape);
    tape.finish(UTC_NS).unwrap();
    let (read, counts) = (read(&path), tape.counts());
    let both = |raw: Topic, shown: Topic| {
        let (raw, shown) = (
            (sequences(&read, raw), counts.of(raw).unwrap().lost),
            (sequences(&read, shown), counts.of(shown).unwrap().lost),
        );
        assert_eq!(raw, shown);
        raw
    };
    let outcome = Outcome {
        sweeps: both(Topic::RawSweep, Topic::Sweep),
        detections: both(Topic::RawDetections, Topic::Detections),
        clusters: both(Topic::Clusters, Topic::Clusters),
        tracks: both(Topic::RawTracks, Topic::Tracks),
    };
    (outcome, counts)
}

const ALL: [u32; 3] = [0, 1, 2];

#[test]
fn a_sweep_that_lacks_a_sector_is_lost_and_its_detections_are_not() {
    for missing in ALL {
        let rest: Vec<u32> = ALL.into_iter().filter(|&sector| sector != missing).collect();
        let (outcome, _) = outcome(8, |tape| {
            for number in 0..3 {
                let made = made(number);
                sweep(tape, &made, if number == 1 { &rest } else { &ALL });
                detections(tape, &made, &ALL);
            }
        });
        let all = || (vec![0, 1, 2], 0);
        let expected = Outcome { sweeps: (vec![0, 2], 1), detections: all(), clusters: (vec![0, 2], 1), tracks: all() };
        assert_eq!(outcome, expected, "sector {missing}");
    }
}

#[test]
fn detections_that_lack_a_sector_are_lost_and_their_sweep_is_not() {
    for missing in ALL {
        let rest: Vec<u32> = ALL.into_iter().filter(|&sector| sector != missing).collect();
        let (outcome, _) = outcome(8, |tape| {
            for number in 0..3 {
                let made = made(number);
                sweep(tape, &made, &ALL);
                detections(tape, &made, if number == 2 { &rest } else { &ALL });
            }
        });
        let (all, but_one) = (|| (vec![0, 1, 2], 0), || (vec![0, 1], 1));
        // Tracks are whole with the last sector; that a sweep began is seen by its first.
        let tracks = if missing == 1 { all() } else { but_one() };
        let expected = Outcome { sweeps: all(), detections: but_one(), clusters: but_one(), tracks };
        assert_eq!(outcome, expected, "sector {missing}");
    }
}

#[test]
fn detections_may_come_sweeps_later_or_before_the_last_sector_of_their_sweep() {
    let (outcome, _) = outcome(8, |tape| {
        (0..4).for_each(|number| sweep(tape, &made(number), &ALL));
        (0..4).for_each(|number| detections(tape, &made(number), &ALL));
        sweep(tape, &made(4), &[0, 1]);
        detections(tape, &made(4), &ALL);
        detections(tape, &made(5), &ALL);
        sweep(tape, &made(4), &[2]);
        sweep(tape, &made(5), &ALL);
    });
    let all = || ((0..6).collect::<Vec<u32>>(), 0);
    assert_eq!(outcome, Outcome { sweeps: all(), detections: all(), clusters: all(), tracks: all() });
}

#[test]
fn detections_that_never_come_are_given_up_with_later_ones_and_at_the_end() {
    let (outcome, counts) = outcome(8, |tape| {
        (0..6).for_each(|number| sweep(tape, &made(number), &ALL));
        detections(tape, &made(3), &ALL);
    });
    let one = || (vec![3], 5);
    let expected = Outcome { sweeps: ((0..6).collect(), 0), detections: one(), clusters: one(), tracks: one() };
    assert_eq!(outcome, expected);
    assert_eq!(counts.failure, None);
}

#[test]
fn no_more_sweeps_than_configured_wait_for_their_detections() {
    let (outcome, _) = outcome(2, |tape| {
        (0..5).for_each(|number| sweep(tape, &made(number), &ALL));
        (0..5).for_each(|number| detections(tape, &made(number), &ALL));
    });
    let all = || ((0..5).collect::<Vec<u32>>(), 0);
    assert_eq!(outcome, Outcome { sweeps: all(), detections: all(), clusters: (vec![3, 4], 3), tracks: all() });
}

#[test]
fn a_sweep_that_is_sent_again_from_its_first_sector_is_written_once() {
    let (outcome, counts) = outcome(8, |tape| {
        sweep(tape, &made(0), &[0, 1, 0, 1, 2]);
        detections(tape, &made(0), &[0, 0, 1, 2]);
        sweep(tape, &made(0), &ALL);
        detections(tape, &made(0), &ALL);
        sweep(tape, &made(1), &ALL);
        detections(tape, &made(1), &ALL);
    });
    let all = || (vec![0, 1], 0);
    assert_eq!(outcome, Outcome { sweeps: all(), detections: all(), clusters: all(), tracks: all() });
    assert_eq!(counts.doubles, 6);
}

#[test]
fn a_successor_takes_sweeps_that_are_sent_again_though_the_rest_of_later_ones_came_before() {
    let (outcome, counts) = outcome(8, |tape| {
        sweep(tape, &made(2), &[1, 2]);
        detections(tape, &made(1), &[2]);
        (0..3).for_each(|number| sweep(tape, &made(number), &ALL));
        (0..3).for_each(|number| detections(tape, &made(number), &ALL));
    });
    let all = || (vec![0, 1, 2], 0);
    assert_eq!(outcome, Outcome { sweeps: all(), detections: all(), clusters: all(), tracks: all() });
    assert_eq!(counts.doubles, 0);
}

#[test]
fn detections_whose_members_are_no_returns_of_the_sweep_cost_the_clusters_alone() {
    let (outcome, _) = outcome(8, |tape| {
        let mut odd = made(0);
        sweep(tape, &odd, &ALL);
        odd.detections.members[0] = 1_000_000;
        detections(tape, &odd, &ALL);
        give(tape, &made(1), SECTORS);
    });
    let both = || (vec![0, 1], 0);
    let expected = Outcome { sweeps: both(), detections: both(), clusters: (vec![1], 1), tracks: both() };
    assert_eq!(outcome, expected);
}

#[test]
fn a_sweep_is_done_when_all_of_it_is_in_the_systems_hands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(shipped().checked().unwrap(), &path, SECTORS);
    sweep(&mut tape, &made(0), &ALL);
    tape.checkpoint(UTC_NS);
    assert_eq!(tape.done_sweeps(), 0, "its detections have not come");
    detections(&mut tape, &made(0), &ALL);
    assert_eq!(tape.done_sweeps(), 0, "they wait in the open chunk");
    tape.checkpoint(UTC_NS);
    assert_eq!(tape.done_sweeps(), 1);
    let torn = std::fs::read(&path).unwrap();
    assert_eq!(common::read_bytes(&torn).0.len(), 7);
    sweep(&mut tape, &made(2), &ALL);
    detections(&mut tape, &made(2), &[0]);
    tape.checkpoint(UTC_NS);
    assert_eq!(tape.done_sweeps(), 2, "what was given up is done with");
    tape.finish(UTC_NS).unwrap();
    assert_eq!(tape.done_sweeps(), 3);
}

#[test]
fn what_is_done_depends_on_what_is_written_of_a_sweep() {
    let folder = tempfile::tempdir().unwrap();
    for (topics, done) in
        [(&[Topic::RawSweep][..], 1), (&[Topic::Detections], 0), (&[Topic::Clusters], 0), (&[Topic::Tracks], 0)]
    {
        let mut tape = start(settings(topics), &folder.path().join("run.mcap"), SECTORS);
        sweep(&mut tape, &made(0), &ALL);
        tape.checkpoint(UTC_NS);
        assert_eq!(tape.done_sweeps(), done, "{topics:?}");
    }
}

#[test]
fn a_sweep_without_a_table_is_written_so_and_is_no_loss() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::Tracks, Topic::RawTracks]), &path, SECTORS);
    let mut unanswered = made(0);
    unanswered.tracks.clear();
    detections(&mut tape, &unanswered, &ALL);
    tape.checkpoint(UTC_NS);
    assert_eq!(tape.done_sweeps(), 1);
    tape.finish(UTC_NS).unwrap();
    let read = read(&path);
    let raw = common::of(&read, Topic::RawTracks);
    let (trace, rest) = Trace::read_raw(&raw[0].data).unwrap();
    assert_eq!((trace, rest), (unanswered.trace(2, SECTORS), &common::bytes(&*unanswered.tracks)[..]));
    // To people nothing is said: what they saw before stays until it is no longer valid.
    assert!(common::of(&read, Topic::Tracks)[0].data.is_empty());
    assert_eq!(tape.counts().lost(), 0);
}
