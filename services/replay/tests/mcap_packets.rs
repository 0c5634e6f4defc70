//! Velodyne packets in MCAP files made for it: compressions, torn chunks, hostile lengths, other topics.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use messages::Sweep;
use proptest::prelude::*;
use replay::{Fault, Format, Options, Recording, ReplayError, open};
use support::{all, assert_true, opened, sensors};

const SCHEMA: &str = "velodyne_msgs/msg/VelodyneScan";
/// Packets of a message, and messages of a file.
const PACKETS: usize = 40;
const MESSAGES: usize = 12;

/// The `number`th packet of an HDL-32E that turns at nearly 10 Hz.
fn packet(number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for block in 0..12 {
        let azimuth = (number * 12 + block) * 16 % 36_000;
        bytes.extend([0xFF, 0xEE]);
        bytes.extend((azimuth as u16).to_le_bytes());
        for channel in 0..32_u16 {
            // Not all alike, so that chunks do not shrink to nothing.
            let distance = 1_000 + 50 * channel + ((number * 7_919 + block * 104_729) % 997) as u16;
            bytes.extend(distance.to_le_bytes());
            bytes.push(channel as u8);
        }
    }
    bytes.extend(((number as f64 * 552.96) as u32).to_le_bytes());
    bytes.extend([0x37, 0x21]);
    bytes
}

/// Message `message` with packets of the row.
fn scan(message: usize, is_ros1: bool) -> Vec<u8> {
    let mut bytes = if is_ros1 { vec![0; 4] } else { vec![0, 1, 0, 0] };
    let pad = |bytes: &mut Vec<u8>| {
        if !is_ros1 {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
    };
    bytes.extend([0; 8]);
    bytes.extend(5_u32.to_le_bytes());
    bytes.extend(b"lidar");
    pad(&mut bytes);
    bytes.extend((PACKETS as u32).to_le_bytes());
    for number in message * PACKETS..(message + 1) * PACKETS {
        pad(&mut bytes);
        let host_us = (number as f64 * 552.96) as u32 + 600;
        bytes.extend([host_us / 1_000_000, host_us % 1_000_000 * 1_000].iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend(packet(number));
    }
    bytes
}

fn options(compression: Option<Compression>) -> WriteOptions {
    // Some three messages a chunk.
    WriteOptions::new().compression(compression).chunk_size(Some(150_000)).profile("ros2")
}

fn written(options: WriteOptions, schema: &str, is_ros1: bool, others: &[(&str, &str)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = options.create(Cursor::new(&mut bytes)).unwrap();
    let encoding = if is_ros1 { ("ros1msg", "ros1") } else { ("ros2msg", "cdr") };
    let id = writer.add_schema(schema, encoding.0, b"").unwrap();
    let channel = writer.add_channel(id, "/packets", encoding.1, &BTreeMap::new()).unwrap();
    let mut channels = vec![(channel, true)];
    for (topic, schema) in others {
        let id = writer.add_schema(schema, encoding.0, b"").unwrap();
        channels.push((writer.add_channel(id, topic, encoding.1, &BTreeMap::new()).unwrap(), false));
    }
    for message in 0..MESSAGES {
        for &(channel_id, is_ours) in &channels {
            let time = message as u64 * 22_000_000 + 1;
            let header = MessageHeader { channel_id, sequence: message as u32, log_time: time, publish_time: time };
            let data = if is_ours { scan(message, is_ros1) } else { vec![0xAB; 1_000] };
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    bytes
}

fn plain() -> Vec<u8> {
    written(options(Some(Compression::Zstd)), SCHEMA, false, &[])
}

fn file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mcap");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn replayed(bytes: &[u8]) -> Result<(Vec<Box<Sweep>>, Recording), ReplayError> {
    let (_folder, path) = file(bytes);
    let mut recording = opened(&path)?;
    let sweeps = all(&mut recording);
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    Ok((sweeps, recording))
}

fn faults(recording: &Recording) -> Vec<(Fault, u64)> {
    recording.faults().found().collect()
}

fn received(sweeps: &[Box<Sweep>]) -> usize {
    sweeps.iter().flat_map(|sweep| sweep.columns.iter()).filter(|column| column.valid == 1).count()
}

const ALL_COLUMNS: usize = 12 * PACKETS * MESSAGES;

/// Offset and length of each chunk's record.
fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 < bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        found.extend((bytes[at] == 6).then_some((at, 9 + length)));
        at += 9 + length;
    }
    found
}

// verifies RPL-027
#[test]
fn every_compression_and_both_encodings_give_the_same_sweeps() {
    let (expected, recording) = replayed(&plain()).unwrap();
    assert_eq!((received(&expected), faults(&recording)), (ALL_COLUMNS, vec![]));
    assert_eq!((recording.format(), recording.sensor_name()), (Format::Mcap, "hdl-32e"));
    assert_eq!(expected.iter().filter(|sweep| sweep.header.is_complete()).count(), 2);
    let cases = [
        (options(Some(Compression::Lz4)), SCHEMA, false),
        (options(None), SCHEMA, false),
        (options(None).use_chunks(false), SCHEMA, false),
        (options(Some(Compression::Zstd)), "velodyne_msgs/VelodyneScan", true),
    ];
    for (number, (options, schema, is_ros1)) in cases.into_iter().enumerate() {
        let (sweeps, recording) = replayed(&written(options, schema, is_ros1, &[])).unwrap();
        assert_eq!(faults(&recording), [], "case {number}");
        assert_eq!(sweeps.len(), expected.len(), "case {number}");
        for (sweep, expected) in sweeps.iter().zip(&expected) {
            assert_eq!((sweep.header, &sweep.returns[..]), (expected.header, &expected.returns[..]), "case {number}");
        }
    }
}

// verifies RPL-027
#[test]
fn other_topics_are_passed_over_and_of_two_sensors_the_first_is_read() {
    let others = [("/imu", "sensor_msgs/msg/Imu"), ("/rear/packets", SCHEMA)];
    let (sweeps, recording) = replayed(&written(options(Some(Compression::Zstd)), SCHEMA, false, &others)).unwrap();
    assert_eq!((received(&sweeps), faults(&recording)), (ALL_COLUMNS, vec![]));
}

// verifies RPL-027
#[test]
fn a_file_without_packets_is_refused_in_one_line() {
    let bytes = written(options(None), "sensor_msgs/msg/Imu", false, &[]);
    let error = replayed(&bytes).err().unwrap().to_string();
    assert!(error.contains("x.mcap: ") && !error.contains('\n'), "{error}");
}

// verifies RPL-027
#[test]
fn a_chunk_with_a_wrong_checksum_is_left_out_and_named() {
    let whole = plain();
    let chunks = chunks(&whole);
    assert!(chunks.len() >= 3, "{chunks:?}");
    let (at, length) = chunks[1];
    // Its checksum, its compressed bytes, its length before compression.
    for spoiled in [at + 9 + 24, at + length - 40, at + 9 + 16] {
        let mut bytes = whole.clone();
        bytes[spoiled] ^= 0x01;
        let (sweeps, recording) = replayed(&bytes).unwrap();
        assert_eq!(recording.faults().count(Fault::TornCapture), 1, "byte {spoiled}");
        let missing = ALL_COLUMNS - received(&sweeps);
        // Four messages, and the packet that decides whether the jump is one.
        assert!(missing > 0 && missing <= 4 * 12 * PACKETS + 12, "byte {spoiled}: {missing}");
        assert!([0, 12].contains(&(missing % (12 * PACKETS))), "byte {spoiled}: {missing}");
    }
}

// verifies RPL-027
#[test]
fn a_file_torn_anywhere_is_used_up_to_there() {
    for compression in [Some(Compression::Zstd), None] {
        let whole = written(options(compression), SCHEMA, false, &[]);
        let chunks = chunks(&whole);
        let (first, first_length) = chunks[0];
        let mut before = 0;
        for cut in (first + first_length + 1..whole.len()).step_by(whole.len() / 40) {
            let (sweeps, recording) = replayed(&whole[..cut]).unwrap();
            assert_eq!(recording.faults().count(Fault::TornCapture), 1, "cut at {cut}");
            let found = received(&sweeps);
            assert!(found >= before, "cut at {cut}: {found} after {before}");
            // Four messages a chunk; of the last, those before the tear but for what compression holds back.
            let whole_chunks = chunks.iter().filter(|(at, length)| at + length <= cut).count();
            assert!(found >= (whole_chunks * 4).min(MESSAGES) * 12 * PACKETS, "cut at {cut}: {found}");
            before = found;
        }
        let held_back = if compression.is_some() { 4 } else { 1 };
        assert!(before >= ALL_COLUMNS - held_back * 12 * PACKETS, "{before}");
    }
}

// verifies RPL-027
#[test]
fn lengths_beyond_all_bounds_are_harmless() {
    let whole = plain();
    let chunks = chunks(&whole);
    for (at, _) in chunks {
        // The record's length, the chunk's length before compression, its name's and its compressed length.
        for place in [at + 1, at + 9 + 16, at + 9 + 28, at + 9 + 36] {
            let mut bytes = whole.clone();
            bytes[place..place + 4].fill(0xFF);
            // The first chunk may be all that tells what the file holds.
            if let Ok((sweeps, recording)) = replayed(&bytes) {
                assert!(recording.faults().count(Fault::TornCapture) > 0, "byte {place}");
                assert!(received(&sweeps) < ALL_COLUMNS);
            }
        }
    }
}

fn mutated(bytes: &[u8], changes: &[(f64, u8)]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (share, value) in changes {
        let at = (share * bytes.len() as f64) as usize;
        bytes[at] = *value;
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    // verifies RPL-017
    #[test]
    fn no_bytes_break_it(changes in proptest::collection::vec((0.0..1.0_f64, any::<u8>()), 1..6), cut in 0.0..1.5_f64, is_plain in any::<bool>()) {
        let compression = if is_plain { None } else { Some(Compression::Zstd) };
        let mut bytes = mutated(&written(options(compression), SCHEMA, false, &[]), &changes);
        bytes.truncate((cut * bytes.len() as f64) as usize + 8);
        let (_folder, path) = file(&bytes);
        let options = Options { format: Some(Format::Mcap), ..Options::default() };
        if let Ok(mut recording) = open(&path, &options, &sensors) {
            for sweep in all(&mut recording) {
                assert_true(&sweep);
            }
        }
    }
}
