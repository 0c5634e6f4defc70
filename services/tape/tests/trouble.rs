//! Rotation, quota, and disks that do not take what they are given.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::path::Path;

use common::{UTC_NS, about, files, give, give_many, made, of, read, sequences, settings, shipped, start};
use tape::{Settings, Tape, TapeError, TapeFile, Topic, WhenFull};

/// Raw sweeps in chunks of one, uncompressed, so that files grow as they are told to.
fn growing(change: impl FnOnce(&mut TapeFile)) -> Settings {
    let mut file = TapeFile {
        topics: vec![Topic::RawSweep],
        compression: tape::Compression::None,
        chunk_kib: 1,
        rotate_mib: 0,
        rotate_s: 0.0,
        ..shipped()
    };
    change(&mut file);
    file.checked().unwrap()
}

fn all_sequences(folder: &Path) -> Vec<u32> {
    files(folder).iter().flat_map(|path| sequences(&read(path), Topic::RawSweep)).collect()
}

#[test]
fn files_turn_over_by_size_and_each_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut tape = start(growing(|file| file.rotate_mib = 1), &path, 1);
    give_many(&mut tape, 0..400);
    tape.finish(UTC_NS).unwrap();
    let files = files(folder.path());
    assert!(files.len() > 2, "{}", files.len());
    assert_eq!((files[0].clone(), tape.counts().files), (path, files.len() as u64));
    for (part, file) in files.iter().enumerate() {
        let bytes = std::fs::read(file).unwrap();
        assert!(part + 1 == files.len() || (1 << 20..(1 << 20) + 20_000).contains(&bytes.len()), "{}", bytes.len());
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.channels.len(), 1);
        let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
        assert_eq!(metadata.metadata["part"], part.to_string());
    }
    assert_eq!(all_sequences(folder.path()), (0..400).collect::<Vec<u32>>());
    let bytes: u64 = files.iter().map(|file| std::fs::metadata(file).unwrap().len()).sum();
    assert_eq!(tape.counts().bytes, bytes);
}

#[test]
fn files_turn_over_by_age() {
    let folder = tempfile::tempdir().unwrap();
    let mut tape = start(growing(|file| file.rotate_s = 1.0), &folder.path().join("run.mcap"), 1);
    // Ten sweeps a second.
    give_many(&mut tape, 0..35);
    tape.finish(UTC_NS).unwrap();
    let lengths: Vec<usize> = files(folder.path()).iter().map(|file| read(file).len()).collect();
    assert_eq!(lengths, [10, 10, 10, 5]);
}

#[test]
fn at_the_quota_the_oldest_files_go_and_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let settings = growing(|file| (file.rotate_mib, file.quota_mib) = (1, 3));
    let mut tape = start(settings, &folder.path().join("run.mcap"), 1);
    give_many(&mut tape, 0..900);
    tape.finish(UTC_NS).unwrap();
    let bytes: u64 = files(folder.path()).iter().map(|file| std::fs::metadata(file).unwrap().len()).sum();
    assert!(bytes <= (3 << 20) + 40_000, "{bytes}");
    let kept = all_sequences(folder.path());
    assert_eq!(kept, (900 - kept.len() as u32..900).collect::<Vec<u32>>());
    let counts = tape.counts();
    let of_topic = counts.of(Topic::RawSweep).unwrap();
    assert_eq!((of_topic.messages, of_topic.removed), (kept.len() as u64, 900 - kept.len() as u64));
    assert_eq!((of_topic.lost, counts.failure), (0, None));
    assert_eq!(counts.files - counts.removed_files, files(folder.path()).len() as u64);
}

#[test]
fn a_successor_counts_its_predecessors_files_into_the_quota() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let settings = || growing(|file| (file.rotate_mib, file.quota_mib) = (1, 3));
    let mut removed = 0;
    for life in 0..4_u64 {
        let resume = (life > 0).then_some(200 * life);
        let mut tape = Tape::start(settings(), &path, about(1), resume, UTC_NS).unwrap();
        (200 * life..200 * life + 200).for_each(|number| give(&mut tape, &made(number), 1));
        tape.checkpoint(UTC_NS);
        removed += tape.counts().removed_files;
        std::mem::forget(tape);
    }
    let bytes: u64 = files(folder.path()).iter().map(|file| std::fs::metadata(file).unwrap().len()).sum();
    assert!(bytes <= (3 << 20) + 40_000, "{bytes}");
    assert!(removed > 0 && !path.exists());
}

#[test]
fn at_the_quota_recording_may_stop_instead_and_what_follows_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let settings = growing(|file| (file.quota_mib, file.when_full) = (1, WhenFull::Stop));
    let mut tape = start(settings, &folder.path().join("run.mcap"), 1);
    give_many(&mut tape, 0..400);
    tape.finish(UTC_NS).unwrap();
    let kept = all_sequences(folder.path());
    assert_eq!(kept, (0..kept.len() as u32).collect::<Vec<u32>>());
    let counts = tape.counts();
    let of_topic = counts.of(Topic::RawSweep).unwrap();
    assert_eq!((of_topic.messages, of_topic.lost), (kept.len() as u64, 400 - kept.len() as u64));
    assert!(of_topic.lost > 100);
    assert_eq!(tape.done_sweeps(), 400, "nobody waits for what is lost");
}

#[test]
fn a_full_device_costs_messages_which_are_counted_and_nothing_else() {
    if !Path::new("/dev/full").exists() {
        return;
    }
    let mut tape = start(shipped().checked().unwrap(), Path::new("/dev/full"), 2);
    (0..3).for_each(|number| give(&mut tape, &made(number), 2));
    tape.checkpoint(UTC_NS + 3_600_000_000_000);
    assert_eq!(tape.done_sweeps(), 3);
    let error = tape.finish(UTC_NS).unwrap_err().to_string();
    assert!(error.starts_with("the recording /dev/full lacks 24 messages: /dev/full: "), "{error}");
    let of_sweeps = shipped().topics.into_iter().filter(|topic| !matches!(topic, Topic::Events | Topic::Status));
    for topic in of_sweeps {
        let counts = tape.counts();
        let of_topic = counts.of(topic).unwrap();
        assert_eq!((of_topic.messages, of_topic.lost), (0, 3), "{topic:?}");
    }
    assert!(!Path::new("/dev/full_0001").exists());
}

#[test]
fn what_cannot_be_opened_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |path: &Path| {
        Tape::start(settings(&[Topic::Sweep]), path, about(1), None, UTC_NS).err().map(|error| error.to_string())
    };
    let missing = folder.path().join("missing/run.mcap");
    let error = refused(&missing).unwrap();
    assert!(error.starts_with(&format!("cannot write {}: No such file", missing.display())), "{error}");
    assert!(refused(folder.path()).unwrap().contains("directory"));
    assert!(refused(Path::new("")).is_some());
}

#[test]
fn a_strangers_file_in_the_way_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let stranger = folder.path().join("run_0003.mcap");
    std::fs::write(&stranger, "thesis").unwrap();
    for resume in [None, Some(0)] {
        let refused = Tape::start(settings(&[Topic::Sweep]), &path, about(1), resume, UTC_NS).err();
        assert!(matches!(refused, Some(TapeError::Foreign { other, .. }) if other == stranger));
    }
    assert_eq!(std::fs::read(&stranger).unwrap(), b"thesis");
    assert!(!path.exists());
}

#[test]
fn an_earlier_recording_of_the_same_name_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    for sweeps in [5, 2] {
        let mut tape = start(settings(&[Topic::Sweep]), &path, 1);
        give_many(&mut tape, 0..sweeps);
        tape.finish(UTC_NS).unwrap();
    }
    assert_eq!(of(&read(&path), Topic::Sweep).len(), 2);
}
