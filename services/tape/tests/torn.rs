//! Recordings of killed processes.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{UTC_NS, about, files, give, made, read, read_bytes, settings, shipped, start};
use tape::{Tape, Topic};

#[test]
fn a_file_torn_anywhere_reads_up_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::RawSweep, Topic::Detections]), &path, 2);
    let mut ends = vec![std::fs::metadata(&path).unwrap().len()];
    for number in 0..6 {
        give(&mut tape, &made(number), 2);
        tape.checkpoint(UTC_NS);
        ends.push(std::fs::metadata(&path).unwrap().len());
    }
    tape.finish(UTC_NS).unwrap();
    let (whole, bytes) = (read(&path), std::fs::read(&path).unwrap());
    for length in (0..bytes.len()).step_by(53).chain(ends.iter().map(|&end| end as usize)).chain([bytes.len() - 1]) {
        let (read, torn) = read_bytes(&bytes[..length]);
        assert!(torn, "{length}");
        assert!(whole.starts_with(&read), "{length}");
        let checkpoints = ends.iter().filter(|&&end| end <= length as u64).count();
        assert!(read.len() >= 2 * checkpoints.saturating_sub(1), "{length}: {} messages", read.len());
    }
}

#[test]
fn a_kill_loses_what_came_after_the_latest_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(settings(&[Topic::RawSweep]), &path, 2);
    (0..3).for_each(|number| give(&mut tape, &made(number), 2));
    tape.checkpoint(UTC_NS);
    give(&mut tape, &made(3), 2);
    std::mem::forget(tape);
    assert_eq!(read_bytes(&std::fs::read(&path).unwrap()).0.len(), 3);
}

#[test]
fn a_successor_leaves_what_is_torn_and_begins_the_next_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut all = Vec::new();
    let mut done = None;
    for life in 0..3_u64 {
        let settings = settings(&[Topic::RawSweep, Topic::Detections]);
        let mut tape = Tape::start(settings, &path, about(2), done, UTC_NS).unwrap();
        (2 * life..2 * life + 2).for_each(|number| give(&mut tape, &made(number), 2));
        tape.checkpoint(UTC_NS);
        give(&mut tape, &made(2 * life + 2), 2);
        done = Some(tape.done_sweeps());
        assert_eq!(done, Some(2 * life + 2));
        std::mem::forget(tape);
        let (read, _) = read_bytes(&std::fs::read(files(folder.path()).pop().unwrap()).unwrap());
        all.extend(read.into_iter().filter(|read| read.topic == Topic::RawSweep.name()).map(|read| read.sequence));
    }
    let names: Vec<String> =
        files(folder.path()).iter().map(|path| path.file_name().unwrap().to_str().unwrap().to_owned()).collect();
    assert_eq!(names, ["run.mcap", "run_0001.mcap", "run_0002.mcap"]);
    assert_eq!(all, [0, 1, 2, 3, 4, 5]);
}

#[test]
fn a_successor_counts_what_its_predecessor_did_not_leave_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = Tape::start(shipped().checked().unwrap(), &path, about(2), Some(10), UTC_NS).unwrap();
    (9..15).filter(|&number| number != 11).for_each(|number| give(&mut tape, &made(number), 2));
    tape.finish(UTC_NS).unwrap();
    let of_sweeps = shipped().topics.into_iter().filter(|topic| !matches!(topic, Topic::Events | Topic::Status));
    for topic in of_sweeps {
        let counts = tape.counts();
        let of_topic = counts.of(topic).unwrap();
        assert_eq!((of_topic.messages, of_topic.lost), (4, 1), "{topic:?}");
    }
    assert_eq!(tape.counts().doubles, 5);
}

#[test]
fn a_new_run_clears_numbered_files_of_the_one_before_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    for resume in [None, Some(0), Some(0)] {
        Tape::start(settings(&[Topic::Sweep]), &path, about(1), resume, UTC_NS).unwrap().finish(UTC_NS).unwrap();
    }
    std::fs::write(folder.path().join("run_two.mcap"), "mine").unwrap();
    assert_eq!(files(folder.path()).len(), 4);
    start(settings(&[Topic::Sweep]), &path, 1).finish(UTC_NS).unwrap();
    assert_eq!(files(folder.path()), [path, folder.path().join("run_two.mcap")]);
}
