//! Disks that are full, pipes that nobody reads: the chain goes on, and what is lost is said.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::Command;

use common::{HandMade, Sut, lines, settings, start};
use messages::Verdict;
use recorder::{Recorder, Settings, Snapshot};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat};
use stage::Sink;

fn accept(recorder: &mut Sut, sweep: u64) -> Verdict {
    let (trace, detections) = HandMade::interleaved(sweep, 4_000, 100, 100).whole();
    recorder.accept(&trace, &detections)
}

fn lost(recorder: &Recorder) -> (u64, u64) {
    let mut snapshot = Snapshot::default();
    recorder.snapshot_into(&mut snapshot);
    (snapshot.lost_sweeps.detections, snapshot.lost_sweeps.labels)
}

fn fifo(path: &Path) {
    mkfifoat(CWD, path, Mode::from_raw_mode(0o600)).unwrap();
}

/// Opens a pipe for reading without waiting for its writer, and without reading.
fn silent_reader(path: &Path) -> File {
    let flags = OFlags::NONBLOCK.bits();
    OpenOptions::new().read(true).custom_flags(flags as i32).open(path).unwrap()
}

/// Ends an idle wait for another thread when it takes absurdly long.
fn until(what: &str, mut happened: impl FnMut() -> bool) {
    for _ in 0..6_000 {
        if happened() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    panic!("waited in vain: {what}");
}

// verifies REC-008
#[test]
fn a_full_disk_costs_its_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let labels = folder.path().join("labels.csv");
    let full = Some("/dev/full".into());
    let mut recorder = start(Settings { detections: full, labels: Some(labels.clone()), ..settings() }).unwrap();
    for sweep in 0..3 {
        assert_eq!(accept(&mut recorder, sweep), Verdict::Complete);
    }
    let error = recorder.finish().unwrap_err().to_string();
    assert!(error.contains("/dev/full") && error.contains("3 sweeps lost") && !error.contains("labels"), "{error}");
    assert_eq!((recorder.settled(), lost(&recorder)), (3, (3, 0)));
    assert_eq!(fs::read_to_string(labels).unwrap().lines().count(), 1 + 3 * 4_000);
}

// verifies REC-008
#[test]
fn two_full_disks_are_both_named() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("labels.csv");
    std::os::unix::fs::symlink("/dev/full", &link).unwrap();
    let mut recorder =
        start(Settings { detections: Some("/dev/full".into()), labels: Some(link), ..settings() }).unwrap();
    assert_eq!(accept(&mut recorder, 0), Verdict::Complete);
    let error = recorder.finish().unwrap_err().to_string();
    assert!(error.contains("labels.csv") && error.contains("/dev/full: "), "{error}");
    assert_eq!(lost(&recorder), (1, 1));
}

// verifies REC-008
#[test]
fn a_disk_that_fills_up_keeps_whole_sweeps() {
    const FOLDER: &str = "RECORDER_TEST_SMALL_DISK";
    if let Some(folder) = std::env::var_os(FOLDER) {
        return fill_the_disk(Path::new(&folder));
    }
    // In a process of its own, whose files may hold no more than 64 blocks of 512 or 1024 bytes.
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 64; exec \"$0\" --exact a_disk_that_fills_up_keeps_whole_sweeps"])
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    for (name, per_sweep) in [("detections.jsonl", 1), ("labels.csv", 400)] {
        let bytes = fs::read(folder.path().join(name)).unwrap();
        assert!(bytes.ends_with(b"\n") && !bytes.contains(&0), "{name} ends in a torn sweep");
        let count = bytes.iter().filter(|&&byte| byte == b'\n').count();
        assert!(count > per_sweep && (count - usize::from(per_sweep > 1)) % per_sweep == 0, "{name}: {count} lines");
    }
    let numbers: Vec<u64> = lines(&folder.path().join("detections.jsonl")).iter().map(|line| line.sweep).collect();
    assert_eq!(numbers, (0..numbers.len() as u64).collect::<Vec<_>>());
    assert!(numbers.len() < 100, "the limit was not reached");
}

fn fill_the_disk(folder: &Path) {
    let mut recorder = start(common::settings_in(folder)).unwrap();
    for sweep in 0..100 {
        let (trace, detections) = HandMade::interleaved(sweep, 400, 10, 10).whole();
        assert_eq!(recorder.accept(&trace, &detections), Verdict::Complete);
    }
    assert!(recorder.finish().is_err());
    let (detections, labels) = lost(&recorder);
    assert!(detections > 0 && detections < 100 && labels > 0 && labels < 100);
}

// verifies REC-007
#[test]
fn a_pipe_that_nobody_reads_makes_parts_be_rejected_and_nobody_wait() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe");
    fifo(&path);
    let of = Settings { detections: Some(path.clone()), lossless: false, queue_parts: 3, ..settings() };
    let mut recorder = start(of).unwrap();
    let verdicts: Vec<_> = (0..8).map(|sweep| accept(&mut recorder, sweep)).collect();
    // The writer hangs in opening the pipe, with the first part in its hands.
    assert_eq!(verdicts[..3], [Verdict::Complete; 3]);
    assert_eq!(verdicts[3..], [Verdict::RejectedSinkFull; 5]);
    assert_eq!(recorder.settled(), 0);
    let mut snapshot = Snapshot::default();
    recorder.snapshot_into(&mut snapshot);
    assert_eq!(snapshot.verdicts.get("sink_full"), Some(&5));
    assert_eq!(snapshot.end_to_end.count(), 8, "the chain has done its part");

    // Now somebody reads: what was accepted arrives, and there is room again.
    let reader = std::thread::Builder::new().spawn(move || {
        let mut text = String::new();
        File::open(path).unwrap().read_to_string(&mut text).unwrap();
        text
    });
    until("the three sweeps", || recorder.settled() == 3);
    assert_eq!(accept(&mut recorder, 8), Verdict::Complete);
    recorder.finish().unwrap();
    let text = reader.unwrap().join().unwrap();
    let numbers: Vec<u64> =
        text.lines().map(|line| serde_json::from_str::<common::Line>(line).unwrap().sweep).collect();
    assert_eq!(numbers, [0, 1, 2, 8]);
}

// verifies REC-008
#[test]
fn a_pipe_whose_reader_went_away_is_closed_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe");
    fifo(&path);
    let reader = silent_reader(&path);
    let mut recorder = start(Settings { detections: Some(path.clone()), ..settings() }).unwrap();
    let (trace, detections) = HandMade::interleaved(0, 20, 2, 10).whole();
    recorder.accept(&trace, &detections);
    until("the first sweep", || recorder.settled() == 1);
    drop(reader);
    for sweep in 1..6 {
        assert_eq!(accept(&mut recorder, sweep), Verdict::Complete);
    }
    let error = recorder.finish().unwrap_err().to_string();
    assert!(error.contains("pipe") && error.contains("5 sweeps lost"), "{error}");
}

// verifies REC-007
#[test]
fn a_lossless_recorder_waits_for_a_buffer_instead_of_rejecting() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe");
    fifo(&path);
    let mut recorder = start(Settings { detections: Some(path.clone()), queue_parts: 1, ..settings() }).unwrap();
    let reader = std::thread::Builder::new().spawn(move || {
        let mut text = String::new();
        File::open(path).unwrap().read_to_string(&mut text).unwrap();
        text
    });
    for sweep in 0..50 {
        assert_eq!(accept(&mut recorder, sweep), Verdict::Complete);
    }
    recorder.finish().unwrap();
    assert_eq!(reader.unwrap().join().unwrap().lines().count(), 50);
}

#[test]
fn dropping_a_recorder_does_not_wait_for_a_pipe_that_nobody_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe");
    fifo(&path);
    let mut recorder = start(Settings { detections: Some(path), ..settings() }).unwrap();
    assert_eq!(accept(&mut recorder, 0), Verdict::Complete);
    drop(recorder);
}

#[test]
fn after_finish_parts_are_rejected_and_finishing_again_is_nothing() {
    let mut recorder = start(Settings { detections: Some("/dev/null".into()), ..settings() }).unwrap();
    assert_eq!(accept(&mut recorder, 0), Verdict::Complete);
    recorder.finish().unwrap();
    recorder.finish().unwrap();
    assert_eq!(accept(&mut recorder, 1), Verdict::RejectedSinkFull);
    assert_eq!(recorder.settled(), 1);
}
