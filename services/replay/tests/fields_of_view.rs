//! Sensors that are set to less than a whole turn: cut at the gap, in packets that go across it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod streams;
mod support;

use messages::Sweep;
use replay::Fault;
use streams::{Head, Sent, columns, faults, replayed};

/// Firing cycles of a turn at 20 hundredths of a degree.
const TURN: usize = 1_800;

fn head(sensor: &str, view_cdeg: [f64; 2]) -> Head {
    Head { view_cdeg, ..Head::new(sensor, 0x37) }
}

fn first_deg(sweep: &Sweep) -> f64 {
    (-f64::from(sweep.columns[0].azimuth_rad).to_degrees()).rem_euclid(360.0)
}

/// Sweeps that are not at the ends of the recording.
fn inner(sweeps: &[Box<Sweep>]) -> &[Box<Sweep>] {
    &sweeps[1..sweeps.len() - 1]
}

// verifies RPL-026
#[test]
fn each_sweep_is_the_field_of_view_wherever_it_lies_and_however_wide_it_is() {
    let views = [
        [27_000.0, 9_000.0],
        [9_000.0, 27_000.0],
        [3_000.0, 33_000.0],
        [30_000.0, 6_000.0],
        [35_000.0, 34_000.0],
        [100.0, 2_300.0],
    ];
    // Edges that lie at the same block in every turn, and edges that move through the packets.
    let cases = views.iter().flat_map(|view| [(view, 20.0), (view, 19.97), (view, 20.09)]);
    for (sensor, (view_cdeg, step_cdeg)) in
        ["vlp-32c", "hdl-32e"].iter().flat_map(|sensor| cases.clone().map(move |case| (sensor, case)))
    {
        let what = format!("{sensor} {view_cdeg:?} {step_cdeg}");
        let head = Head { step_cdeg, ..head(sensor, *view_cdeg) };
        let sent = head.plain(TURN * 9);
        let (sweeps, recording) = replayed(&sent);
        assert_eq!(faults(&recording), [], "{what}");
        assert_eq!(columns(&sweeps), (12 * sent.len(), 0), "{what}");
        assert!((7..=10).contains(&sweeps.len()), "{what}: {}", sweeps.len());
        let width_cdeg = (view_cdeg[1] - view_cdeg[0]).rem_euclid(36_000.0);
        let cycle_ns = u64::from(head.sensor.cycle_ns());
        let turn_ns = (36_000.0 / step_cdeg) as u64 * cycle_ns;
        for pair in inner(&sweeps).windows(2) {
            let count = pair[0].columns.len();
            assert!((count as f64 - width_cdeg / step_cdeg).abs() <= 1.0, "{what}: {count}");
            assert!((first_deg(&pair[0]) - view_cdeg[0] / 100.0).abs() < 0.3, "{what}: {}", first_deg(&pair[0]));
            let apart_ns = pair[1].header.sensor_time_ns - pair[0].header.sensor_time_ns;
            assert!(apart_ns.abs_diff(turn_ns) <= cycle_ns + 2_000, "{what}: {apart_ns} {turn_ns}");
            let last_ns = u64::from(pair[0].columns[count - 1].offset_ns);
            assert!(last_ns.abs_diff((count as u64 - 1) * cycle_ns) <= 2_000, "{what}");
            assert!(!pair[0].header.is_complete(), "it does not close");
            assert!(pair[0].header.period_ns.abs_diff(turn_ns) < turn_ns / 100, "{what}");
        }
    }
}

// verifies RPL-026
#[test]
fn packets_lost_beside_the_gap_leave_unknown_columns_and_none_within_it() {
    let sent = head("vlp-32c", [27_000.0, 9_000.0]).plain(TURN * 6);
    let (whole, _) = replayed(&sent);
    // A packet with the gap in it; its neighbours; both sides of it.
    let gap =
        (100..sent.len()).find(|&number| sent[number].azimuth(0).abs_diff(sent[number].azimuth(11)) > 10_000).unwrap();
    for lost in [gap..gap + 1, gap - 1..gap, gap + 1..gap + 2, gap - 3..gap + 4] {
        let mut kept = sent.clone();
        kept.drain(lost.clone());
        let (sweeps, recording) = replayed(&kept);
        assert_eq!(faults(&recording), [(Fault::LostPacket, lost.len() as u64)], "{lost:?}");
        assert_eq!(columns(&sweeps), (12 * kept.len(), 12 * lost.len()), "{lost:?}");
        assert_eq!(sweeps.len(), whole.len(), "{lost:?}");
        for (sweep, whole) in sweeps.iter().zip(&whole) {
            assert!(sweep.columns.len().abs_diff(whole.columns.len()) <= 1, "{lost:?}");
            assert!(sweep.header.sensor_time_ns.abs_diff(whole.header.sensor_time_ns) < 120_000, "{lost:?}");
        }
    }
}

// verifies RPL-026
#[test]
fn a_sensor_set_to_another_field_of_view_shows_it_within_a_turn() {
    let whole_turns = Head::new("vlp-32c", 0x37);
    let half = head("vlp-32c", [27_000.0, 9_000.0]);
    // The first four turns in view of the one, the others of the other, on one clock.
    let joined = |first: &Head, second: &Head| -> Vec<Sent> {
        let start = first.plain(TURN * 4);
        let end_us = u64::from(start.last().unwrap().stamp_us());
        let rest = second.plain(TURN * 8).into_iter().filter(|packet| u64::from(packet.stamp_us()) > end_us);
        start.iter().cloned().chain(rest).collect()
    };
    let (sweeps, _) = replayed(&joined(&half, &whole_turns));
    let complete = sweeps.iter().filter(|sweep| sweep.header.is_complete()).count();
    assert!((2..=4).contains(&complete), "{complete}");
    let (sweeps, _) = replayed(&joined(&whole_turns, &half));
    assert!(sweeps[1].header.is_complete() && sweeps[2].header.is_complete());
    let last = &sweeps[sweeps.len() - 2];
    assert_eq!((last.columns.len(), last.header.is_complete()), (TURN / 2, false));
}

// verifies RPL-026
#[test]
fn a_torn_azimuth_is_no_field_of_view() {
    let sent = Head::new("vlp-32c", 0x37).plain(TURN * 4);
    let (whole, _) = replayed(&sent);
    for block in [0, 1, 6, 11] {
        let mut torn = sent.clone();
        let azimuth_cdeg = (torn[200].azimuth(block) + 9_000) % 36_000;
        torn[200].set_azimuth(block, azimuth_cdeg);
        let (sweeps, _) = replayed(&torn);
        let complete = |sweeps: &[Box<Sweep>]| sweeps.iter().filter(|sweep| sweep.header.is_complete()).count();
        assert_eq!((sweeps.len(), complete(&sweeps)), (whole.len(), complete(&whole)), "block {block}");
        assert_eq!(columns(&sweeps).0, columns(&whole).0, "block {block}");
    }
}

// verifies RPL-026
#[test]
fn both_returns_of_half_a_turn_are_cut_there_too() {
    let head = Head { view_cdeg: [27_000.0, 9_000.0], ..Head::new("vlp-32c", 0x39) };
    let sent = head.plain(TURN * 6);
    let (sweeps, recording) = replayed(&sent);
    assert_eq!(faults(&recording), []);
    assert_eq!(columns(&sweeps), (6 * sent.len(), 0));
    assert!(inner(&sweeps).iter().all(|sweep| sweep.columns.len() == TURN / 2));
}
