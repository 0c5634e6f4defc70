//! Both returns of a firing, as HDL-32E and VLP-32C send them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod streams;
mod support;

use messages::{Cutter, Sweep};
use replay::Options;
use streams::{Head, columns, faults, replayed_with};

const CYCLES: usize = 4 * 1_800;
const SENSORS: [&str; 2] = ["hdl-32e", "vlp-32c"];

/// What a firing gave by its channel: the last and the strongest (or second strongest) return.
fn echoes(_cycle: usize, channel: usize) -> [(u16, u8); 2] {
    match channel % 5 {
        // One return: the same twice.
        0 => [(3_000, 50); 2],
        // A strong one before the last.
        1 => [(4_000, 20), (2_000, 90)],
        // The last is the strongest; beside it stands the second strongest.
        2 => [(5_000, 200), (2_500, 30)],
        // Equally strong.
        3 => [(6_000, 70), (3_500, 70)],
        // None, with an intensity.
        _ => [(0, 9); 2],
    }
}

fn replayed(sensor: &str, mode: u8, both_returns: bool) -> Vec<Box<Sweep>> {
    let options = Options { both_returns, ..Options::default() };
    let sent = Head::new(sensor, mode).packets(CYCLES, echoes);
    let (sweeps, recording) = replayed_with(&sent, &options);
    assert_eq!((faults(&recording), columns(&sweeps)), (vec![], (CYCLES, 0)));
    assert_eq!(recording.sensor_name(), sensor);
    sweeps
}

/// Counts of distance of a column's returns, in order, of lasers in order of their ring.
fn counts(sensor: &str, sweep: &Sweep, column: u16) -> Vec<(u8, u16, u8)> {
    let quantum_m = support::sensors(sensor).unwrap().quantum_m();
    let count = |range_m: f32| (f64::from(range_m) / quantum_m).round() as u16;
    let of_column = sweep.returns.iter().filter(|found| found.column == column);
    of_column.map(|found| (found.ring, count(found.range_m()), found.intensity)).collect()
}

/// The same of the echoes that `chosen` picks of each channel.
fn expected(sensor: &str, chosen: impl Fn([(u16, u8); 2]) -> Vec<(u16, u8)>) -> Vec<(u8, u16, u8)> {
    let sensor = support::sensors(sensor).unwrap();
    let lasers = sensor.lasers().iter().enumerate();
    let of = |(channel, laser): (usize, &lidar::Laser)| {
        let ring = laser.ring;
        chosen(echoes(0, channel))
            .into_iter()
            .filter(|(distance, _)| *distance > 0)
            .map(move |(d, i)| (ring, d, i))
            .collect::<Vec<_>>()
    };
    lasers.flat_map(of).collect()
}

// verifies RPL-014
#[test]
fn the_strongest_return_is_given_whichever_block_has_it() {
    for sensor in SENSORS {
        let sweeps = replayed(sensor, 0x39, false);
        let strongest = |[last, other]: [(u16, u8); 2]| vec![if last.1 > other.1 { last } else { other }];
        assert_eq!(counts(sensor, &sweeps[1], 700), expected(sensor, strongest));
    }
}

// verifies RPL-014
#[test]
fn both_returns_are_given_and_one_that_is_both_only_once() {
    for sensor in SENSORS {
        let mut sweeps = replayed(sensor, 0x39, true);
        let both = |[last, other]: [(u16, u8); 2]| if last == other { vec![last] } else { vec![last, other] };
        assert_eq!(counts(sensor, &sweeps[1], 700), expected(sensor, both));
        // A firing with two returns cannot be cut into sectors: the sweep promises nothing.
        Cutter::new(4).measure(&mut sweeps[1]);
        assert_eq!(sweeps[1].header.stray_rad, 0.0);
    }
}

// verifies RPL-014
#[test]
fn modes_of_one_return_give_that_one() {
    for sensor in SENSORS {
        for both_returns in [false, true] {
            let last = replayed(sensor, 0x38, both_returns);
            assert_eq!(counts(sensor, &last[1], 700), expected(sensor, |echoes| vec![echoes[0]]));
            let strongest = replayed(sensor, 0x37, both_returns);
            assert_eq!(counts(sensor, &strongest[1], 700), expected(sensor, |echoes| vec![echoes[1]]));
        }
    }
}

// verifies RPL-014
#[test]
fn a_mode_makes_no_difference_to_columns_and_their_times() {
    for sensor in SENSORS {
        let (dual, single) = (replayed(sensor, 0x39, false), replayed(sensor, 0x37, false));
        assert_eq!(dual.len(), single.len());
        for (dual, single) in dual.iter().zip(&single) {
            assert!(dual.header.sensor_time_ns.abs_diff(single.header.sensor_time_ns) <= 2_000);
            for (a, b) in dual.columns.iter().zip(&single.columns) {
                assert!(a.offset_ns.abs_diff(b.offset_ns) <= 2_000 && (a.azimuth_rad - b.azimuth_rad).abs() < 1e-6);
            }
        }
    }
}

// verifies RPL-025
#[test]
fn the_factory_byte_names_the_sensor_where_the_caller_does_not() {
    for sensor in SENSORS {
        let (_, recording) = replayed_with(&Head::new(sensor, 0x37).plain(3_000), &Options::default());
        assert_eq!(recording.sensor_name(), sensor);
    }
    // Old firmware has other content in it.
    let mut old = Head::new("hdl-32e", 0x37).plain(3_000);
    old.iter_mut().for_each(|packet| packet.bytes[1_205] = 0);
    assert_eq!(replayed_with(&old, &Options::default()).1.sensor_name(), "hdl-32e");
}
