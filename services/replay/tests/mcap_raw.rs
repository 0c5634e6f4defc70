//! Encke's own recordings: the sweeps that were recorded come back to the bit.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use messages::{Message, Refusal, Sweep};
use replay::{Fault, Format, Options, open};
use support::container::{CLOUD, PACKINGS, PLAIN, Packing, RAW, container, point_cloud2, raw};
use support::{all, assert_true, new_sweep, opened, sensors};

/// A sweep of `columns` columns with a return each, some of them refused.
fn made(turn: u64, columns: u16) -> Box<Sweep> {
    let mut sweep = new_sweep();
    let sensor = support::hdl_32e();
    sensor.rings().iter().for_each(|&ring| sweep.rings.push(ring).unwrap());
    for index in 0..columns {
        let azimuth_rad = 3.1 - f32::from(index) * (6.0 / f32::from(columns)).min(0.01);
        let column = lidar::Column { azimuth_rad, offset_ns: u32::from(index) * 46_080, valid: 1 };
        sweep.columns.push(column).unwrap();
        let (sin, cos) = azimuth_rad.sin_cos();
        let range_m = 5.0 + (u64::from(index) * 7_919 + turn * 104_729).pow(2).rem_euclid(1_009) as f32 / 200.0;
        let x = range_m * cos;
        let found =
            lidar::Return { x, y: sin, z: -0.1, column: index, ring: (index % 32) as u8, intensity: turn as u8 };
        sweep.returns.push(found).unwrap();
        sweep.recorded_index.push(2 * u32::from(index)).unwrap();
    }
    let header = &mut sweep.header;
    header.sensor_time_ns = 1_000_000_000 + turn * 100_000_000;
    header.period_ns = 100_000_000;
    header.recorded = 2 * u32::from(columns);
    header.refused[Refusal::AtOrigin as usize] = u32::from(columns);
    (header.complete, header.organised) = (u32::from(turn != 0), 1);
    (header.column_step_rad, header.range_sigma_m, header.reach_m, header.stray_rad) = (0.01, 0.02, 100.0, 0.003);
    assert_true(&sweep);
    sweep
}

fn sweeps(columns: u16) -> Vec<Box<Sweep>> {
    (0..6).map(|turn| made(turn, columns)).collect()
}

fn recorded(packing: Packing, chunk_bytes: u64, sweeps: &[Box<Sweep>]) -> Vec<u8> {
    let messages: Vec<_> = sweeps.iter().map(|sweep| (0, sweep.header.sensor_time_ns, raw(sweep))).collect();
    container(packing, chunk_bytes, &[RAW], &messages)
}

fn same(found: &[Box<Sweep>], known: &[Box<Sweep>]) -> bool {
    found.len() == known.len() && found.iter().zip(known).all(|(found, known)| raw(found) == raw(known))
}

// verifies RPL-021
#[test]
fn sweeps_come_back_to_the_bit_from_every_packing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known = sweeps(300);
    for packing in PACKINGS {
        for chunk_bytes in [1, 20_000, 1 << 20] {
            std::fs::write(&path, recorded(packing, chunk_bytes, &known)).unwrap();
            let mut recording = opened(&path).unwrap();
            assert_eq!(recording.format(), Format::Mcap);
            assert!(same(&all(&mut recording), &known), "{packing:?}, {chunk_bytes}");
            assert_eq!(recording.faults().found().count(), 0, "{packing:?}, {chunk_bytes}");
        }
    }
}

// verifies RPL-021, RPL-023
#[test]
fn the_raw_topic_is_preferred_to_clouds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known = sweeps(50);
    let cloud = point_cloud2(PLAIN, [1, 0], &["x", "y", "z"].map(|name| (name, 7, vec![1.0])));
    let mut messages = vec![(0, 0, cloud)];
    messages.extend(known.iter().map(|sweep| (1, sweep.header.sensor_time_ns, raw(sweep))));
    std::fs::write(&path, container(Packing::Lz4, 1, &[CLOUD, RAW], &messages)).unwrap();
    assert!(same(&all(&mut opened(&path).unwrap()), &known));
    let options = Options { topic: Some(CLOUD.0.to_owned()), ..Options::default() };
    assert_eq!(all(&mut open(&path, &options, &sensors).unwrap())[0].returns.len(), 1);
}

// verifies RPL-021, RPL-008
#[test]
fn files_of_a_run_follow_one_another_and_loop() {
    let folder = tempfile::tempdir().unwrap();
    let known = sweeps(20);
    for (part, sweeps) in known.chunks(2).enumerate() {
        std::fs::write(folder.path().join(format!("run-{part}.mcap")), recorded(Packing::Zstd, 1, sweeps)).unwrap();
    }
    assert!(same(&all(&mut opened(folder.path()).unwrap()), &known));
    let options = Options { repeat: true, ..Options::default() };
    let mut recording = open(folder.path(), &options, &sensors).unwrap();
    let (mut sweep, mut truth) = (new_sweep(), zerocopy::FromZeros::new_box_zeroed().unwrap());
    for turn in 0..15 {
        assert!(support::next(&mut recording, &mut sweep, &mut truth));
        assert_eq!(sweep.header.sensor_time_ns, 1_000_000_000 + turn * 100_000_000);
    }
}

// verifies RPL-021, RPL-013
#[test]
fn a_file_torn_at_any_byte_gives_the_sweeps_before_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known: Vec<_> = (0..3).map(|turn| made(turn, 2)).collect();
    for packing in PACKINGS {
        let whole = recorded(packing, 1_200, &known);
        let mut before = 0;
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let options = Options { format: Some(Format::Mcap), ..Options::default() };
            let Ok(mut recording) = open(&path, &options, &sensors) else {
                assert_eq!(before, 0, "{packing:?}, {length}");
                continue;
            };
            let found = all(&mut recording);
            assert!(same(&found, &known[..found.len()]), "{packing:?}, {length}");
            assert!(found.len() >= before, "{packing:?}, {length}");
            before = found.len();
            let is_whole = found.len() == known.len();
            assert!(is_whole || recording.faults().count(Fault::TornMcap) == 1, "{packing:?}, {length}");
        }
        assert_eq!(before, known.len(), "{packing:?}");
    }
}

// verifies RPL-021, RPL-013
#[test]
fn a_chunk_that_is_cut_off_gives_the_sweeps_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known = sweeps(4_000);
    for packing in [Packing::Zstd, Packing::Lz4, Packing::Plain] {
        let whole = recorded(packing, 1 << 24, &known);
        std::fs::write(&path, &whole[..whole.len() / 10 * 9]).unwrap();
        let mut recording = opened(&path).unwrap();
        let found = all(&mut recording);
        assert!(!found.is_empty() && found.len() < known.len(), "{packing:?}: {}", found.len());
        assert!(same(&found, &known[..found.len()]), "{packing:?}");
        let faults: Vec<_> = recording.faults().found().collect();
        assert_eq!(faults, [(Fault::TornMcap, 1)], "{packing:?}");
    }
}

// verifies RPL-021, RPL-013
#[test]
fn a_chunk_with_a_wrong_checksum_is_passed_over_and_the_rest_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known = sweeps(40);
    for packing in [Packing::Zstd, Packing::Lz4, Packing::Plain] {
        let mut bytes = recorded(packing, 1, &known);
        // The first chunk holds the first sweep: a bit of its contents is turned, beyond its head of 52 bytes at most.
        let mut at = 8;
        while bytes[at] != mcap::records::op::CHUNK {
            at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        }
        bytes[at + 9 + 52 + 300] ^= 4;
        std::fs::write(&path, bytes).unwrap();
        let mut recording = opened(&path).unwrap();
        let found = all(&mut recording);
        assert!(same(&found, &known[1..]), "{packing:?}: {} sweeps", found.len());
        assert_eq!(recording.faults().count(Fault::BadChunk), 1, "{packing:?}");
    }
}

// verifies RPL-021, RPL-017
#[test]
fn sweeps_that_no_stage_could_take_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    type Spoil = fn(&mut Sweep);
    let spoils: [(&str, Spoil); 14] = [
        ("a column that is not there", |sweep| sweep.returns[3].column = 40),
        ("a ring that is not there", |sweep| sweep.returns[3].ring = 32),
        ("columns out of order", |sweep| sweep.returns[3].column = 1),
        ("not finite", |sweep| sweep.returns[3].y = f32::NAN),
        ("counts that do not add up", |sweep| sweep.header.recorded += 1),
        ("numbers that fall", |sweep| sweep.recorded_index[3] = 0),
        ("numbers beyond the sweep", |sweep| sweep.recorded_index[39] = 80),
        ("azimuths beyond a turn", |sweep| sweep.columns[3].azimuth_rad = 4.0),
        ("time that falls", |sweep| sweep.columns[3].offset_ns = 0),
        ("no period", |sweep| sweep.header.period_ns = 0),
        ("a second sector", |sweep| sweep.first_column = 3),
        ("rings that do not rise", |sweep| sweep.rings[3].elevation_rad = f32::NAN),
        ("a step that is none", |sweep| sweep.header.column_step_rad = f32::INFINITY),
        ("unorganised with columns", |sweep| sweep.header.organised = 0),
    ];
    for (name, spoil) in spoils {
        let mut known = sweeps(40);
        spoil(&mut known[1]);
        std::fs::write(&path, recorded(Packing::Zstd, 1, &known)).unwrap();
        let mut recording = opened(&path).unwrap();
        known.remove(1);
        assert!(same(&all(&mut recording), &known), "{name}");
        assert_eq!(recording.faults().count(Fault::BadMessage), 1, "{name}");
    }
    let mut known = sweeps(40);
    known.iter_mut().for_each(|sweep| sweep.header.period_ns = 0);
    std::fs::write(&path, recorded(Packing::Zstd, 1, &known)).unwrap();
    let line = opened(&path).err().unwrap().to_string();
    assert!(line.contains("holds no sweep in topic /encke/raw/sweep"), "{line}");
}

// verifies RPL-021, RPL-023
#[test]
fn sweeps_of_another_version_are_said_to_be_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, container(Packing::Zstd, 1, &[(RAW.0, RAW.1, "encke.Sweep.1")], &[(0, 0, vec![1])])).unwrap();
    let line = opened(&path).err().unwrap().to_string();
    assert!(line.contains("encke.Sweep.1 in encke") && line.contains(Sweep::TYPE), "{line}");
}

// verifies RPL-007
#[test]
fn limits_that_are_asked_for_refuse_returns_which_keep_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let known = made(1, 100);
    std::fs::write(&path, recorded(Packing::Zstd, 1, &[made(1, 100)])).unwrap();
    let options = Options { max_range_m: Some(8.5), ..Options::default() };
    let sweep = all(&mut open(&path, &options, &sensors).unwrap()).remove(0);
    assert_true(&sweep);
    let far = known.returns.iter().filter(|found| found.range_m() > 8.5).count();
    assert!(far > 0);
    assert_eq!(sweep.header.refused[Refusal::TooFar as usize] as usize, far);
    assert_eq!(sweep.header.recorded, known.header.recorded);
    for (place, found) in sweep.returns.iter().enumerate() {
        assert_eq!(*found, known.returns[sweep.recorded_index[place] as usize / 2]);
    }
}

// verifies RPL-024
#[test]
fn gaps_and_steps_between_recorded_sweeps_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut known = sweeps(10);
    known.remove(2);
    known.swap(3, 4);
    std::fs::write(&path, recorded(Packing::Zstd, 1, &known)).unwrap();
    let mut recording = opened(&path).unwrap();
    assert!(same(&all(&mut recording), &known));
    assert_eq!(recording.faults().count(Fault::ClockStep), 3);
}

fn refused(path: &Path, bytes: &[u8]) -> String {
    std::fs::write(path, bytes).unwrap();
    let options = Options { format: Some(Format::Mcap), ..Options::default() };
    let line = open(path, &options, &sensors).err().unwrap().to_string();
    assert!(line.starts_with(&path.display().to_string()) && !line.contains('\n'), "{line}");
    line
}

// verifies RPL-016
#[test]
fn what_is_no_mcap_file_or_claims_the_impossible_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    assert!(refused(&path, b"").contains("byte 0"));
    assert!(refused(&path, b"\x89MCAP1\r\n").contains("version 0"));
    assert!(refused(&path, b"\x89MCAP0\r\n").contains("holds no sweeps; its topics are none"));
    for opcode in 0..=u8::MAX {
        for length in [0, 8, 28, 1 << 28, 1 << 29, u64::MAX / 2, u64::MAX] {
            let bytes = [b"\x89MCAP0\r\n", &[opcode][..], &length.to_le_bytes(), &[0xFF; 60]].concat();
            refused(&path, &bytes);
        }
    }
}
