//! What goes wrong in real captures: each trap in a capture made for it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::PathBuf;

use etherparse::PacketBuilder;
use messages::Sweep;
use replay::{Fault, Options, Recording, ReplayError, open};
use support::{all, assert_true, hdl_32e, opened, sensors};

const PACKET_US: f64 = 552.96;
/// Azimuth from block to block [0.01°]: 10 Hz nearly.
const STEP: usize = 16;

/// One record of a capture: host time [µs] and frame.
type Record = (u64, Vec<u8>);

/// A data packet: the `number`th of a sensor that started at azimuth 0 with stamp 0.
fn packet(number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for block in 0..12 {
        let azimuth = (number * 12 + block) * STEP % 36_000;
        bytes.extend([0xFF, 0xEE]);
        bytes.extend((azimuth as u16).to_le_bytes());
        for channel in 0..32_u16 {
            // Channel 31 is dead, channel 30 has no return but an intensity.
            let distance = if channel >= 30 { 0 } else { 1_000 + 50 * channel };
            bytes.extend(distance.to_le_bytes());
            bytes.push(if channel == 31 { 0 } else { 40 + channel as u8 });
        }
    }
    bytes.extend((stamp_us(number) as u32).to_le_bytes());
    bytes.extend([0x37, 0x21]);
    bytes
}

fn stamp_us(number: usize) -> u64 {
    (number as f64 * PACKET_US) as u64
}

fn frame(payload: &[u8], ports: [u16; 2]) -> Vec<u8> {
    let builder = PacketBuilder::ethernet2([1; 6], [2; 6]).ipv4([10, 0, 0, 1], [255; 4], 9).udp(ports[0], ports[1]);
    let mut bytes = Vec::new();
    builder.write(&mut bytes, payload).unwrap();
    bytes
}

/// Packets `from..to`, as recorded.
fn records(from: usize, to: usize) -> Vec<Record> {
    (from..to).map(|number| (stamp_us(number) + 600, frame(&packet(number), [443, 2_368]))).collect()
}

fn pcap(records: &[Record]) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [0xa1b2_c3d4_u32, 4 << 16 | 2, 0, 0, 65_535, 1].iter().flat_map(|w| w.to_le_bytes()).collect();
    for (host_us, frame) in records {
        let words =
            [(host_us / 1_000_000) as u32, (host_us % 1_000_000) as u32, frame.len() as u32, frame.len() as u32];
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend(frame);
    }
    bytes
}

fn file(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn replayed(bytes: &[u8]) -> (Vec<Box<Sweep>>, Recording) {
    let (_folder, path) = file(bytes);
    let mut recording = opened(&path).unwrap();
    let sweeps = all(&mut recording);
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    (sweeps, recording)
}

fn faults(recording: &Recording) -> Vec<(Fault, u64)> {
    recording.faults().found().collect()
}

fn columns(sweeps: &[Box<Sweep>]) -> usize {
    sweeps.iter().map(|sweep| sweep.columns.len()).sum()
}

fn unknown(sweeps: &[Box<Sweep>]) -> usize {
    sweeps.iter().flat_map(|sweep| sweep.columns.iter()).filter(|column| column.valid == 0).count()
}

/// Packets of somewhat more than two turns: 2250 columns each.
const TWO_TURNS: usize = 400;

// verifies RPL-011
#[test]
fn an_intact_capture_gives_whole_turns_without_dead_lasers_and_empty_channels() {
    let (sweeps, recording) = replayed(&pcap(&records(0, TWO_TURNS)));
    assert_eq!(faults(&recording), []);
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).collect::<Vec<_>>(), [2_250, 2_250, 300]);
    assert_eq!(sweeps.iter().map(|sweep| sweep.header.is_complete()).collect::<Vec<_>>(), [true, true, false]);
    assert_eq!(sweeps[0].returns.len(), 2_250 * 30);
    let silent = [hdl_32e().lasers()[30].ring, hdl_32e().lasers()[31].ring];
    assert!(sweeps[0].returns.iter().all(|found| !silent.contains(&found.ring)));
    let period_ns = sweeps[0].header.period_ns as f64;
    assert!((period_ns - 2_250.0 * 46_080.0).abs() < 2_000.0, "{period_ns}");
}

// verifies RPL-011
#[test]
fn azimuth_36000_is_azimuth_0_and_begins_a_sweep() {
    let mut records = records(0, TWO_TURNS);
    // Column 2250 is block 6 of packet 187.
    let at = 42 + 6 * 100 + 2;
    assert_eq!(records[187].1[at..at + 2], [0, 0]);
    records[187].1[at..at + 2].copy_from_slice(&36_000_u16.to_le_bytes());
    let (sweeps, recording) = replayed(&pcap(&records));
    assert_eq!(faults(&recording), []);
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).collect::<Vec<_>>(), [2_250, 2_250, 300]);
    assert_eq!(sweeps[1].columns[0].azimuth_rad, 0.0);
}

// verifies RPL-011
#[test]
fn other_ports_addresses_tags_and_traffic_make_no_difference() {
    let (plain, _) = replayed(&pcap(&records(0, 50)));
    let mut mixed = Vec::new();
    for (number, (host_us, _)) in records(0, 50).into_iter().enumerate() {
        mixed.push((host_us, frame(&packet(number), [number as u16 + 1, 9_999])));
        mixed.push((host_us, frame(&[7; 512], [8_308, 8_308])));
        mixed.push((host_us, frame(&[7; 1_205], [2_368, 2_368])));
        mixed.push((host_us, frame(&[7; 1_248], [2_368, 2_368])));
        mixed.push((host_us, [&[1; 12][..], &[0x08, 0x06], &[0; 28]].concat()));
        let last = mixed[mixed.len() - 5].1.clone();
        mixed.push((host_us + 5, [&last[..12], &[0x81, 0, 0, 7], &last[12..]].concat()));
    }
    // The tagged copy of each packet is a second one with the same stamp.
    let (sweeps, recording) = replayed(&pcap(&mixed));
    assert_eq!(faults(&recording), [(Fault::LatePacket, 50)]);
    assert_eq!(sweeps[0].returns[..], plain[0].returns[..]);
    assert_eq!(sweeps[0].columns[..], plain[0].columns[..]);
}

// verifies RPL-012
#[test]
fn lost_packets_leave_unknown_columns_on_the_firing_grid() {
    let (whole, _) = replayed(&pcap(&records(0, TWO_TURNS)));
    // In a turn, several in a row, and across the wrap in packet 187.
    for lost in [50..51, 50..60, 187..188, 180..195] {
        let mut kept = records(0, TWO_TURNS);
        kept.drain(lost.clone());
        let (sweeps, recording) = replayed(&pcap(&kept));
        assert_eq!(faults(&recording), [(Fault::LostPacket, lost.len() as u64)]);
        assert_eq!(sweeps.len(), whole.len());
        assert_eq!(unknown(&sweeps), 12 * lost.len());
        for (sweep, whole) in sweeps.iter().zip(&whole) {
            assert_eq!(sweep.columns.len(), whole.columns.len());
            assert_eq!(sweep.header.is_complete(), whole.header.is_complete());
            for (column, whole) in sweep.columns.iter().zip(&whole.columns) {
                assert!((column.azimuth_rad - whole.azimuth_rad).abs() < 1e-5 || column.azimuth_rad.abs() > 3.1);
                assert!(column.offset_ns.abs_diff(whole.offset_ns) <= 1_000);
            }
            let mut returns = whole.returns.iter().filter(|r| sweep.columns[usize::from(r.column)].valid == 1);
            assert!(sweep.returns.iter().all(|found| Some(found) == returns.next()));
            assert!(returns.next().is_none());
        }
    }
}

// verifies RPL-012, RPL-020
#[test]
fn packets_lost_at_one_place_in_two_turns_are_lost_where_a_turn_between_has_them() {
    let mut kept = records(0, 4 * TWO_TURNS);
    // 375 packets are two turns.
    kept.drain(50 + 750..60 + 750);
    kept.drain(50..60);
    let (sweeps, recording) = replayed(&pcap(&kept));
    assert_eq!(faults(&recording), [(Fault::LostPacket, 20)]);
    assert_eq!(unknown(&sweeps), 12 * 20);
    assert!(sweeps[..8].iter().all(|sweep| sweep.header.is_complete()));
}

// verifies RPL-012
#[test]
fn a_gap_of_more_than_half_a_turn_ends_the_sweep_incomplete() {
    let mut kept = records(0, 1_000);
    kept.drain(50..500);
    let (sweeps, recording) = replayed(&pcap(&kept));
    // The first packet after a jump is left out: the next one says whether it was right.
    assert_eq!(faults(&recording), [(Fault::BadStamp, 1), (Fault::Break, 1)]);
    assert!(!sweeps[0].header.is_complete() && !sweeps[1].header.is_complete());
    assert_eq!(sweeps[0].columns.len(), 600);
    assert_eq!(columns(&sweeps), 12 * (50 + 499));
    assert_eq!(unknown(&sweeps), 0);
    let expected_ns = stamp_us(501) * 1_000;
    assert_eq!(sweeps[1].header.sensor_time_ns, expected_ns);
}

// verifies RPL-012
#[test]
fn packets_that_come_twice_or_late_are_left_out() {
    let mut moved = records(0, 100);
    let late = moved.remove(30);
    moved.insert(33, late);
    let twice = moved[70].clone();
    moved.insert(71, twice);
    let (sweeps, recording) = replayed(&pcap(&moved));
    assert_eq!(faults(&recording), [(Fault::LostPacket, 1), (Fault::LatePacket, 2)]);
    assert_eq!((columns(&sweeps), unknown(&sweeps)), (1_200, 12));
}

// verifies RPL-012
#[test]
fn a_torn_stamp_costs_one_packet_and_a_set_clock_ends_the_sweep() {
    let mut torn = records(0, 100);
    torn[40].1[42 + 1_200 + 3] ^= 0x40;
    let (sweeps, recording) = replayed(&pcap(&torn));
    assert_eq!(faults(&recording), [(Fault::LostPacket, 1), (Fault::BadStamp, 1)]);
    assert_eq!((sweeps.len(), columns(&sweeps), unknown(&sweeps)), (1, 1_200, 12));

    let mut set = records(0, 100);
    for (number, (_, frame)) in set.iter_mut().enumerate().skip(40) {
        let stamp_us = stamp_us(number) as u32 + 30_000_000;
        frame[42 + 1_200..42 + 1_204].copy_from_slice(&stamp_us.to_le_bytes());
    }
    let (sweeps, recording) = replayed(&pcap(&set));
    assert_eq!(faults(&recording), [(Fault::BadStamp, 1), (Fault::Break, 1)]);
    assert_eq!((sweeps.len(), columns(&sweeps)), (2, 1_188));
}

// verifies RPL-013
#[test]
fn blocks_without_flag_are_unknown_columns_and_packets_without_any_are_lost_ones() {
    let mut torn = records(0, 100);
    torn[10].1[42 + 300] = 0;
    torn[20].1[42 + 1_102..42 + 1_104].copy_from_slice(&36_001_u16.to_le_bytes());
    for block in 0..12 {
        torn[30].1[42 + 100 * block] = 0xFD;
    }
    let (sweeps, recording) = replayed(&pcap(&torn));
    assert_eq!(faults(&recording), [(Fault::NoBlock, 1), (Fault::BadBlock, 2), (Fault::LostPacket, 1)]);
    assert_eq!((columns(&sweeps), unknown(&sweeps)), (1_200, 14));
    assert!([10 * 12 + 3, 20 * 12 + 11].iter().all(|&column| sweeps[0].columns[column].valid == 0));
}

// verifies RPL-013
#[test]
fn a_capture_torn_anywhere_is_used_up_to_there() {
    let whole = pcap(&records(0, 20));
    let record = 16 + 1_248;
    for cut in [24 + record, 24 + record + 1, 24 + record + 16, 24 + 2 * record - 1, 24 + 7 * record + 600] {
        let (sweeps, recording) = replayed(&whole[..cut]);
        let packets = (cut - 24) / record;
        assert_eq!(columns(&sweeps), 12 * packets, "cut at {cut}");
        let is_torn = (cut - 24) % record != 0;
        assert_eq!(recording.faults().count(Fault::TornCapture), u64::from(is_torn), "cut at {cut}");
    }
    // A record's length that cannot be.
    let mut broken = whole.clone();
    broken[24 + 5 * record + 11] = 0x7F;
    let (sweeps, recording) = replayed(&broken);
    assert_eq!((columns(&sweeps), recording.faults().count(Fault::TornCapture)), (60, 1));
}

// verifies RPL-013
#[test]
fn frames_that_the_snap_length_cut_off_are_counted() {
    let mut cut = records(0, 20);
    cut[5].1.truncate(600);
    cut[6].1.truncate(20);
    let (sweeps, recording) = replayed(&pcap(&cut));
    assert_eq!(faults(&recording), [(Fault::BadFrame, 2), (Fault::LostPacket, 2)]);
    assert_eq!((columns(&sweeps), unknown(&sweeps)), (240, 24));
}

fn dual(mut record: Record, last_nearer: bool) -> Record {
    let payload = &mut record.1[42..];
    for pair in 0..6 {
        let (even, odd) = (200 * pair, 200 * pair + 100);
        let azimuth = [payload[even + 2], payload[even + 3]];
        payload[odd + 2..odd + 4].copy_from_slice(&azimuth);
        for channel in 0..32 {
            let at = even + 4 + 3 * channel;
            if last_nearer && payload[at] != 0 && channel % 2 == 0 {
                payload[at + 1] += 1;
            }
        }
    }
    payload[1_204] = 0x39;
    record
}

// verifies RPL-014
#[test]
fn dual_returns_give_the_strongest_or_both() {
    // Six firing cycles a packet, so packets are half as long.
    let made: Vec<Record> = records(0, 60)
        .into_iter()
        .enumerate()
        .map(|(number, (host_us, frame))| {
            let (host_us, mut frame) = dual((host_us, frame), true);
            let stamp_us = (number as f64 * PACKET_US / 2.0) as u32;
            frame[42 + 1_200..42 + 1_204].copy_from_slice(&stamp_us.to_le_bytes());
            (host_us, frame)
        })
        .collect();
    let (_folder, path) = file(&pcap(&made));
    let strongest = all(&mut opened(&path).unwrap());
    let options = Options { both_returns: true, ..Options::default() };
    let both = all(&mut open(&path, &options, &sensors).unwrap());
    assert_eq!((columns(&strongest), columns(&both)), (360, 360));
    assert_eq!(strongest[0].returns.len(), 360 * 30);
    // Of 30 channels 15 have another last return.
    assert_eq!(both[0].returns.len(), 360 * 45);
    assert_true(&both[0]);
    let mut ranges: Vec<f32> = strongest[0].returns[..30].iter().map(|found| found.range_m()).collect();
    ranges.sort_by(f32::total_cmp);
    assert!((ranges[0] - 2.0).abs() < 1e-5 && (ranges[29] - 4.9).abs() < 1e-5, "{ranges:?}");
}

// verifies RPL-011
#[test]
fn a_byte_of_mode_in_old_firmware_does_not_halve_a_capture() {
    let mut old = records(0, 50);
    old.iter_mut().for_each(|(_, frame)| frame[42 + 1_204] = 0x39);
    let (sweeps, recording) = replayed(&pcap(&old));
    assert_eq!((columns(&sweeps), faults(&recording)), (600, vec![]));
}

/// The same records as a next-generation capture, with stamps in `exponent` decimal digits of a second.
fn pcapng(records: &[Record], exponent: u8) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let padded = body.len().next_multiple_of(4);
        let length = (padded as u32 + 12).to_le_bytes();
        [&kind.to_le_bytes()[..], &length, body, &vec![0; padded - body.len()], &length].concat()
    };
    let section = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat();
    let interface = [&[1, 0, 0, 0, 0, 0, 0, 0][..], &[9, 0, 1, 0, exponent, 0, 0, 0], &[0; 4]].concat();
    let mut bytes = [block(0x0A0D_0D0A, &section), block(1, &interface), block(5, &[0; 12])].concat();
    for (host_us, frame) in records {
        let counts = (u128::from(*host_us) * 10_u128.pow(u32::from(exponent)) / 1_000_000) as u64;
        let length = (frame.len() as u32).to_le_bytes();
        let words = [0, (counts >> 32) as u32, counts as u32].map(u32::to_le_bytes).concat();
        bytes.extend(block(6, &[&words[..], &length, &length, frame].concat()));
    }
    bytes
}

// verifies RPL-011
#[test]
fn a_next_generation_capture_gives_the_same_sweeps() {
    let hours_us = 490_000 * 3_600_000_000;
    let mut late = records(0, 200);
    late.iter_mut().for_each(|(host_us, _)| *host_us += hours_us);
    let (classic, _) = replayed(&pcap(&late));
    assert_eq!(classic[0].header.sensor_time_ns, hours_us * 1_000);
    for exponent in [6, 9] {
        let (sweeps, recording) = replayed(&pcapng(&late, exponent));
        assert_eq!(faults(&recording), []);
        assert_eq!(sweeps.len(), classic.len());
        for (sweep, classic) in sweeps.iter().zip(&classic) {
            assert_eq!(sweep.header, classic.header);
            assert_eq!(sweep.returns[..], classic.returns[..]);
        }
    }
    let whole = pcapng(&late, 6);
    let (sweeps, recording) = replayed(&whole[..whole.len() - 100]);
    assert_eq!((columns(&sweeps), faults(&recording)), (199 * 12, vec![(Fault::TornCapture, 1)]));
}

// verifies RPL-011
#[test]
fn a_capture_split_into_files_goes_on_over_their_ends() {
    let (whole, _) = replayed(&pcap(&records(0, TWO_TURNS)));
    let folder = tempfile::tempdir().unwrap();
    for (name, from, to) in [("a", 0, 100), ("b", 100, 101), ("c", 101, TWO_TURNS)] {
        std::fs::write(folder.path().join(name), pcap(&records(from, to))).unwrap();
    }
    let mut recording = opened(folder.path()).unwrap();
    let sweeps = all(&mut recording);
    assert_eq!(faults(&recording), []);
    for (sweep, whole) in sweeps.iter().zip(&whole) {
        assert_eq!((sweep.header, &sweep.returns[..]), (whole.header, &whole.returns[..]));
    }
}

// verifies RPL-015
#[test]
fn packets_of_another_sensor_are_refused_with_both_rates() {
    let Some(path) = support::data("vlp16/veloview_vlp16.pcap") else { return };
    let error = opened(&path).err().unwrap();
    assert!(matches!(error, ReplayError::OtherSensor { found_us: 1_327, expected_us: 553, .. }), "{error}");
}

// verifies RPL-011
#[test]
fn a_head_that_stands_still_is_cut_into_incomplete_sweeps() {
    let mut still = records(0, 500);
    for (_, frame) in &mut still {
        (0..12).for_each(|block| frame[42 + 100 * block + 2..42 + 100 * block + 4].fill(3));
    }
    let (sweeps, _) = replayed(&pcap(&still));
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).collect::<Vec<_>>(), [4_608, 1_392]);
    assert!(sweeps.iter().all(|sweep| !sweep.header.is_complete()));
}
