//! Clocks that are set, on either side, and streams that come twice: passed on as they are, and flagged.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod streams;
mod support;

use messages::Sweep;
use replay::Fault;
use streams::{HOUR_US, Head, Sent, columns, faults, replayed};

const TURN: usize = 1_800;
const PACKETS: usize = 400;
/// The packet from which on something is different; within a turn.
const AT: usize = 220;
const MS: i64 = 1_000;

fn sent() -> Vec<Sent> {
    Head::new("hdl-32e", 0x37).plain(12 * PACKETS)
}

fn starts_ns(sweeps: &[Box<Sweep>]) -> Vec<u64> {
    sweeps.iter().map(|sweep| sweep.header.sensor_time_ns).collect()
}

/// The stream with the sensor's clock set by `by_us` at packet `AT`.
fn set(by_us: i64) -> Vec<Sent> {
    let mut sent = sent();
    for packet in &mut sent[AT..] {
        packet.set_stamp_us((i64::from(packet.stamp_us()) + by_us + HOUR_US as i64) as u64);
    }
    sent
}

// verifies RPL-030
#[test]
fn a_sensor_clock_set_forward_by_milliseconds_costs_nothing() {
    let (whole, _) = replayed(&sent());
    // As when the pulse of a second is back after some time without: nothing is missing, so nothing is made up.
    for by_us in [300, MS, 3 * MS, 9 * MS] {
        let (sweeps, recording) = replayed(&set(by_us));
        assert_eq!(faults(&recording), [(Fault::ClockStep, 1)], "{by_us}");
        assert_eq!(columns(&sweeps), (12 * PACKETS, 0), "{by_us}");
        let complete =
            |sweeps: &[Box<Sweep>]| sweeps.iter().map(|sweep| sweep.header.is_complete()).collect::<Vec<_>>();
        assert_eq!(complete(&sweeps), complete(&whole));
        assert_eq!(starts_ns(&sweeps)[..2], starts_ns(&whole)[..2]);
        assert_eq!(starts_ns(&sweeps)[2], starts_ns(&whole)[2] + by_us as u64 * 1_000);
    }
    // Less than half a packet is no step.
    let (sweeps, recording) = replayed(&set(100));
    assert_eq!((faults(&recording), columns(&sweeps)), (vec![], (12 * PACKETS, 0)));
}

// verifies RPL-030
#[test]
fn a_sensor_clock_set_back_or_far_ahead_ends_the_sweep_and_costs_a_packet() {
    // Within 10 ms back a packet could also be late; that the head goes on tells them apart.
    for by_us in [-MS, -9 * MS, -20 * MS, -1_000 * MS, 40 * MS, 1_000 * MS, 200_000 * MS] {
        let (sweeps, recording) = replayed(&set(by_us));
        assert_eq!(faults(&recording), [(Fault::BadStamp, 1), (Fault::Break, 1)], "{by_us}");
        assert_eq!(columns(&sweeps), (12 * (PACKETS - 1), 0), "{by_us}");
        let broken = sweeps.iter().position(|sweep| sweep.columns.len() < TURN).unwrap();
        assert!(!sweeps[broken].header.is_complete() && !sweeps[broken + 1].header.is_complete());
        let expected_ns = (600_000_000.0 + (AT + 1) as f64 * 552.96 + by_us as f64) * 1e3;
        assert!((starts_ns(&sweeps)[broken + 1] as f64 - expected_ns).abs() < 2_000.0, "passed on as it is");
    }
}

// verifies RPL-030
#[test]
fn the_hosts_clock_may_be_set_by_an_hour_while_the_sensor_goes_on() {
    let (whole, _) = replayed(&sent());
    for by_us in [-(HOUR_US as i64), HOUR_US as i64, 5 * MS, -77_000 * MS] {
        let mut stepped: Vec<Sent> = sent();
        // Far enough from 1970.
        stepped.iter_mut().for_each(|packet| packet.host_us += 10 * HOUR_US);
        stepped[AT..].iter_mut().for_each(|packet| packet.host_us = (packet.host_us as i64 + by_us) as u64);
        let (sweeps, recording) = replayed(&stepped);
        assert_eq!(faults(&recording), [], "{by_us}");
        for (sweep, whole) in sweeps.iter().zip(&whole) {
            assert_eq!(sweep.header.sensor_time_ns, whole.header.sensor_time_ns + 10 * HOUR_US * 1_000);
            assert_eq!(sweep.returns[..], whole.returns[..]);
        }
    }
}

// verifies RPL-030
#[test]
fn time_rises_over_the_hour_and_over_midnight() {
    let day_us = 24 * HOUR_US;
    for start_us in [HOUR_US - 100_000, day_us - 100_000, 15_000 * day_us - 1] {
        let head = Head { start_us, ..Head::new("hdl-32e", 0x37) };
        let (sweeps, recording) = replayed(&head.plain(12 * PACKETS));
        assert_eq!((faults(&recording), columns(&sweeps)), (vec![], (12 * PACKETS, 0)));
        assert!(starts_ns(&sweeps)[0].abs_diff(start_us * 1_000) < 2_000, "{start_us}");
        for pair in starts_ns(&sweeps).windows(2) {
            assert!((pair[1] - pair[0]).abs_diff(TURN as u64 * 46_080) < 2_000, "{pair:?}");
        }
    }
}

// verifies RPL-030
#[test]
fn a_sensor_without_a_clock_from_outside_counts_on_from_its_start() {
    // Stamps from 0 on, while the host is in the middle of its hour.
    let head = Head { start_us: 0, ..Head::new("hdl-32e", 0x37) };
    let mut packets = head.plain(12 * PACKETS);
    packets.iter_mut().for_each(|packet| packet.host_us += 100 * HOUR_US + HOUR_US / 3);
    let (sweeps, recording) = replayed(&packets);
    assert_eq!(faults(&recording), []);
    assert_eq!(starts_ns(&sweeps)[0], 100 * HOUR_US * 1_000);
}

// verifies RPL-030
#[test]
fn a_stream_recorded_twice_is_one_and_late_packets_of_it_are_left_out() {
    let (whole, _) = replayed(&sent());
    // Two interfaces; the second copy at once, or some packets later.
    for behind in [0, 1, 5, 17] {
        let sent = sent();
        let mut twice: Vec<Sent> = Vec::new();
        for number in 0..PACKETS + behind {
            twice.extend(sent.get(number).cloned());
            twice.extend(number.checked_sub(behind).map(|number| sent[number].clone()));
        }
        let (sweeps, recording) = replayed(&twice);
        assert_eq!(faults(&recording), [(Fault::LatePacket, PACKETS as u64)], "{behind}");
        for (sweep, whole) in sweeps.iter().zip(&whole) {
            assert_eq!((sweep.header, &sweep.returns[..]), (whole.header, &whole.returns[..]));
        }
    }
}

// verifies RPL-030
#[test]
fn a_recording_that_was_stopped_for_hours_goes_on_at_its_own_time() {
    let (first, mut second) = (sent(), sent());
    for packet in &mut second {
        let later_us = 5 * HOUR_US + 77_000_000;
        packet.host_us += later_us;
        packet.set_stamp_us(u64::from(packet.stamp_us()) + later_us);
    }
    let (sweeps, recording) = replayed(&[first, second].concat());
    assert_eq!(faults(&recording), [(Fault::BadStamp, 1), (Fault::Break, 1)]);
    let last_ns = *starts_ns(&sweeps).last().unwrap();
    assert!(last_ns > (5 * HOUR_US + 677_000_000) * 1_000, "{last_ns}");
}
