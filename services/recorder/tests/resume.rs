//! A recorder that was killed goes on with its files, whatever it left torn.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::fs;
use std::path::Path;

use common::{HandMade, lines, rows, settings, settings_in, start};
use messages::Verdict;
use recorder::{RecorderError, Settings};
use stage::Sink;

/// In memory where there is such a place: some disks flush a file that was cut when it is closed.
fn memory_folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

fn run(settings: Settings, sweeps: std::ops::Range<u64>) {
    // One stage: fewer histograms to clear at each of some hundred starts.
    let mut recorder = start(Settings { stages: vec!["replay".into()], ..settings }).unwrap();
    for sweep in sweeps {
        let (trace, detections) = HandMade::interleaved(sweep, 8, 1, 4).whole();
        assert!(!recorder.accept(&trace, &detections).is_rejected());
    }
    recorder.finish().unwrap();
}

/// Both files after `sweeps`.
fn files(sweeps: std::ops::Range<u64>) -> (Vec<u8>, Vec<u8>) {
    let folder = memory_folder();
    run(settings_in(folder.path()), sweeps);
    read(folder.path())
}

fn read(folder: &Path) -> (Vec<u8>, Vec<u8>) {
    (fs::read(folder.join("detections.jsonl")).unwrap(), fs::read(folder.join("labels.csv")).unwrap())
}

/// Goes on with sweep 3 after a crash that left these files.
fn go_on(detections: &[u8], labels: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let folder = memory_folder();
    fs::write(folder.path().join("detections.jsonl"), detections).unwrap();
    fs::write(folder.path().join("labels.csv"), labels).unwrap();
    run(Settings { resume: true, ..settings_in(folder.path()) }, 3..4);
    read(folder.path())
}

// verifies REC-006
#[test]
fn a_restart_between_sweeps_changes_nothing() {
    let (detections, labels) = files(0..3);
    assert!(go_on(&detections, &labels) == files(0..4));
}

// verifies REC-006
#[test]
fn a_line_torn_at_any_byte_is_cut_and_its_labels_with_it() {
    let (before, labels_before) = files(0..2);
    let (after, labels_after) = files(0..3);
    let expected = {
        let folder = memory_folder();
        run(settings_in(folder.path()), 0..2);
        run(Settings { resume: true, ..settings_in(folder.path()) }, 3..4);
        read(folder.path())
    };
    assert!(expected.0.starts_with(&before) && expected.1.starts_with(&labels_before));
    for length in before.len()..after.len() {
        assert!(go_on(&after[..length], &labels_after) == expected, "torn after {length} bytes");
    }
}

// verifies REC-006
#[test]
fn labels_torn_at_any_byte_are_cut_to_the_sweep_before() {
    let (before, labels_before) = files(0..2);
    let (_, labels_after) = files(0..3);
    let expected = go_on(&before, &labels_before);
    for length in labels_before.len() + 1..=labels_after.len() {
        let mut torn = labels_after[..length].to_vec();
        torn[labels_before.len()] = 0; // the first byte of a sweep is written last
        assert!(go_on(&before, &torn) == expected, "torn after {length} bytes");

        let folder = memory_folder();
        let path = folder.path().join("labels.csv");
        fs::write(&path, &torn).unwrap();
        run(Settings { labels: Some(path.clone()), resume: true, ..settings() }, 3..4);
        assert!(fs::read(&path).unwrap() == expected.1, "labels alone, torn after {length} bytes");
    }
}

// verifies REC-023
#[test]
fn what_is_in_the_files_is_not_written_again() {
    let folder = memory_folder();
    run(settings_in(folder.path()), 0..3);
    // Its page did not say yet that sweep 2 was written.
    let settings = Settings { resume: true, in_order_from: Some(2), ..settings_in(folder.path()) };
    let mut recorder = start(Settings { stages: vec!["replay".into()], ..settings }).unwrap();
    let mut accept = |sweep| {
        let (trace, detections) = HandMade::interleaved(sweep, 8, 1, 4).whole();
        recorder.accept(&trace, &detections)
    };
    assert_eq!([2, 4, 3].map(&mut accept), [Verdict::RejectedDouble, Verdict::RejectedAhead, Verdict::Complete]);
    assert_eq!(recorder.wanted_attempt(), 1);
    recorder.finish().unwrap();
    assert_eq!(read(folder.path()), files(0..4));
}

// verifies REC-006
#[test]
fn labels_alone_lose_no_whole_sweep() {
    let folder = memory_folder();
    let path = folder.path().join("labels.csv");
    let labels = Settings { labels: Some(path.clone()), ..settings() };
    run(labels.clone(), 0..3);
    run(Settings { resume: true, ..labels }, 3..4);
    assert!(fs::read(path).unwrap() == files(0..4).1);
}

#[test]
fn a_first_write_torn_at_any_byte_is_begun_again() {
    let (detections, labels) = files(0..1);
    let expected = files(3..4);
    let header = b"sweep,return,cluster\n";
    assert!(labels.starts_with(header));
    for length in 0..=header.len() {
        let mut torn = header[..length].to_vec();
        assert!(go_on(b"", &torn) == expected);
        if let Some(first) = torn.first_mut() {
            *first = 0;
            assert!(go_on(b"", &torn) == expected);
        }
    }
    for length in 0..detections.len() {
        assert!(go_on(&detections[..length], header) == expected);
        assert!(go_on(&detections[..length], &labels) == expected, "labels of the sweep under way");
    }
}

#[test]
fn labels_that_outlived_failed_detections_are_kept() {
    let (detections, _) = files(0..1);
    let (_, labels) = files(0..3);
    let (found, found_labels) = go_on(&detections, &labels);
    assert!(found_labels == files(0..4).1, "two sweeps ahead: the detections' file had failed");
    assert!(found.starts_with(&detections));
}

#[test]
fn detections_that_outlived_failed_labels_are_kept() {
    let (detections, _) = files(0..3);
    let (_, labels) = files(0..1);
    let (found, found_labels) = go_on(&detections, &labels);
    assert!(found == files(0..4).0);
    assert!(found_labels.starts_with(&labels));
}

#[test]
fn files_longer_than_one_reading_are_repaired() {
    let folder = memory_folder();
    let sweep = |sweep| HandMade::interleaved(sweep, 60_000, 700, 1_000).whole();
    let mut recorder = start(settings_in(folder.path())).unwrap();
    for number in 0..2 {
        let (trace, detections) = sweep(number);
        recorder.accept(&trace, &detections);
    }
    recorder.finish().unwrap();
    let (detections, labels) = read(folder.path());
    assert!(detections.len() > 2 << 16 && labels.len() > 2 << 16);
    // The second line is torn; the labels of its sweep were whole.
    fs::write(folder.path().join("detections.jsonl"), &detections[..detections.len() - 2]).unwrap();
    run(Settings { resume: true, ..settings_in(folder.path()) }, 5..6);
    let numbers: Vec<_> = lines(&folder.path().join("detections.jsonl")).iter().map(|line| line.sweep).collect();
    assert_eq!(numbers, [0, 5]);
    let rows = rows(&folder.path().join("labels.csv"));
    assert_eq!(rows.len(), 60_000 + 8);
    assert!(rows.iter().all(|&(sweep, ..)| sweep == 0 || sweep == 5));
}

// verifies REC-010
#[test]
fn a_file_of_somebody_else_is_refused_and_left_alone() {
    let folder = memory_folder();
    for (text, other) in [("# notes\n", "x,y,z\n1,2,3\n"), ("notes", "sweep,return,cluster\nnotes\n")] {
        for resumed in [settings_in(folder.path()), Settings { detections: None, ..settings_in(folder.path()) }] {
            fs::write(folder.path().join("detections.jsonl"), text).unwrap();
            fs::write(folder.path().join("labels.csv"), other).unwrap();
            let error = start(Settings { resume: true, ..resumed }).err().unwrap();
            assert!(matches!(error, RecorderError::Foreign { .. }), "{error}");
            assert!(error.to_string().contains(&*folder.path().to_string_lossy()), "{error}");
            assert_eq!(read(folder.path()), (text.as_bytes().to_vec(), other.as_bytes().to_vec()));
        }
    }
}
