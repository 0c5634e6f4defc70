//! A VLP-32C set to half a turn, recorded as ROS 2 messages in MCAP, against another decoder's cloud.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use lidar::Return;
use messages::{Cutter, Sweep};
use serde_json::Value;
use support::{all, assert_true, data, opened, sensors};

const MCAP: &str = "mcap/vlp32c_velodynescan.mcap";
const FACTS: &str = "vlp32c_rosbag2/1713492677464078412.facts.json";
const TRUTH: &str = "vlp32c_rosbag2/1713492677464078412.pcd";

fn recorded() -> Option<(Vec<Box<Sweep>>, Value)> {
    let (mcap, facts) = (data(MCAP)?, data(FACTS)?);
    let mut recording = opened(&mcap).unwrap();
    assert_eq!(recording.sensor_name(), "vlp-32c", "by the factory byte");
    let sweeps = all(&mut recording);
    assert_eq!(recording.faults().found().collect::<Vec<_>>(), [], "the recording is intact");
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    Some((sweeps, serde_json::from_str(&std::fs::read_to_string(facts).unwrap()).unwrap()))
}

fn degrees(sweep: &Sweep, column: usize) -> f64 {
    -f64::from(sweep.columns[column].azimuth_rad).to_degrees()
}

// verifies RPL-025, RPL-027
#[test]
fn every_return_of_the_messages_is_there_once() {
    let Some((sweeps, facts)) = recorded() else { return };
    let messages = facts["messages"].as_array().unwrap();
    let expected: u64 = messages.iter().map(|message| message["nonzero_returns"].as_u64().unwrap()).sum();
    assert_eq!(sweeps.iter().map(|sweep| sweep.returns.len() as u64).sum::<u64>(), expected);
    let packets: u64 = messages.iter().map(|message| message["packets"].as_u64().unwrap()).sum();
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len() as u64).sum::<u64>(), 12 * packets);
    assert!(sweeps.iter().flat_map(|sweep| sweep.columns.iter()).all(|column| column.valid == 1));
}

// verifies RPL-026
#[test]
fn sweeps_are_cut_at_the_gap_of_the_field_of_view_and_not_at_the_wrap_within_it() {
    let Some((sweeps, facts)) = recorded() else { return };
    // Five half turns and the beginning of a sixth.
    assert_eq!(sweeps.len(), 6);
    for (index, sweep) in sweeps.iter().enumerate() {
        assert!(!sweep.header.is_complete(), "half a turn does not close");
        let (first, last) = (degrees(sweep, 0), degrees(sweep, sweep.columns.len() - 1));
        assert!((-90.0..-89.3).contains(&first), "sweep {index} begins at {first}");
        assert!(index == 5 || (90.7..91.1).contains(&last), "sweep {index} ends at {last}");
        let steps = sweep.columns.windows(2).map(|pair| f64::from(pair[0].azimuth_rad - pair[1].azimuth_rad));
        assert!(steps.map(f64::to_degrees).all(|step| (0.17..0.23).contains(&step)), "no column is missing");
        assert!((f64::from(sweep.header.column_step_rad).to_degrees() - 0.1986).abs() < 2e-3);
    }
    // Blocks behind the gap are in a packet from before it; their time is that of the turn that they begin.
    let first_us = |message: usize| facts["messages"][message]["first_toh_us"].as_f64().unwrap();
    for (index, sweep) in sweeps.iter().enumerate().skip(1).take(4) {
        let of_hour_us = (sweep.header.sensor_time_ns % 3_600_000_000_000) as f64 / 1e3;
        let ahead = (first_us(index) - of_hour_us) / 55.296;
        let blocks =
            (facts["messages"][index]["first_azimuth"].as_f64().unwrap() / 100.0 - 360.0 - degrees(sweep, 0)) / 0.1986;
        assert!((ahead - blocks).abs() < 0.5, "sweep {index}: {ahead} cycles, {blocks} blocks");
        let gap_ns = sweep.header.sensor_time_ns - sweeps[index - 1].header.sensor_time_ns;
        assert!((gap_ns as f64 / 1e6 - 100.0).abs() < 1.3, "{gap_ns}");
    }
    for sweep in &sweeps[..5] {
        assert!((sweep.header.period_ns as f64 / 1e6 - 100.2).abs() < 0.5, "{}", sweep.header.period_ns);
    }
}

// verifies RPL-025
#[test]
fn returns_stray_from_their_columns_by_no_more_than_lasers_look_aside() {
    let Some((sweeps, _)) = recorded() else { return };
    for mut sweep in sweeps {
        Cutter::new(8).measure(&mut sweep);
        let stray_deg = f64::from(sweep.header.stray_rad).to_degrees();
        // 4.2°, and the turn until the last laser fires. Few columns may hold no such laser's return.
        let is_short = sweep.columns.len() < 8;
        assert!(is_short || (4.2..4.35).contains(&stray_deg), "{stray_deg}");
    }
}

/// Points of a binary PCD of x, y, z.
fn points(pcd: &[u8]) -> Vec<[f32; 3]> {
    let marker = b"DATA binary\n";
    let start = pcd.windows(marker.len()).position(|window| window == marker).unwrap() + marker.len();
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    pcd[start..].chunks_exact(12).map(|row| [number(&row[..4]), number(&row[4..8]), number(&row[8..])]).collect()
}

// verifies RPL-025
#[test]
fn the_first_message_is_another_decoders_cloud_in_the_same_order() {
    let Some((sweeps, facts)) = recorded() else { return };
    let Some(truth) = data(TRUTH) else { return };
    let truth = points(&std::fs::read(truth).unwrap());
    assert_eq!(truth.len() as u64, facts["truth_points"].as_u64().unwrap());
    // Four blocks of its last packet are of the next half turn.
    let blocks = 12 * facts["messages"][0]["packets"].as_u64().unwrap() as usize;
    let of_next = blocks - sweeps[0].columns.len();
    assert_eq!(of_next, 4);
    let next = sweeps[1].returns.iter().filter(|found| usize::from(found.column) < of_next);
    let ours: Vec<&Return> = sweeps[0].returns.iter().chain(next).collect();
    assert_eq!(ours.len() as u64, facts["messages"][0]["nonzero_returns"].as_u64().unwrap());

    let sensor = sensors("vlp-32c").unwrap();
    let laser_of = |ring: u8| sensor.lasers().iter().position(|laser| laser.ring == ring).unwrap();
    let turning_deg_per_ns = f64::from(sweeps[0].header.column_step_rad).to_degrees() / f64::from(sensor.cycle_ns());
    let range_m = |p: [f32; 3]| p.iter().map(|c| c * c).sum::<f32>().sqrt();
    let mut behind_deg: Vec<Vec<f64>> = vec![Vec::new(); 32];
    let (mut rest, mut worst_m) = (ours.iter(), 0.0_f32);
    for &theirs in &truth {
        // They leave out some at the ends of the field of view.
        let found = rest.find(|found| (found.range_m() - range_m(theirs)).abs() < 2e-3).unwrap();
        let elevation = |p: [f32; 3]| f64::from(p[2] / range_m(p)).asin().to_degrees();
        assert!((elevation(found.position()) - elevation(theirs)).abs() < 0.01);
        let azimuth = |p: [f32; 3]| f64::from(p[1]).atan2(f64::from(p[0])).to_degrees();
        behind_deg[laser_of(found.ring)].push(azimuth(found.position()) - azimuth(theirs));
        // In the packet with the gap they turn by the gap.
        if (4..blocks - 12).contains(&usize::from(found.column)) {
            let apart = found.position().iter().zip(theirs).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
            worst_m = worst_m.max(apart);
        }
    }
    assert!(worst_m < 0.07, "{worst_m} m at up to 24 m");
    // They take the lasers of a pair for fired one after the other. But for that, azimuths are the same within their
    // rounding to 0.01 degrees, that of the packet's, and a block's share of it.
    for (number, mut behind_deg) in behind_deg.into_iter().enumerate() {
        behind_deg.sort_by(f64::total_cmp);
        let later_ns = 2_304.0 * number as f64 - f64::from(sensor.lasers()[number].offset_ns);
        let off_deg = behind_deg[behind_deg.len() / 2] - later_ns * turning_deg_per_ns;
        assert!(off_deg.abs() < 0.016, "laser {number}: {off_deg} degrees");
    }
}

// verifies RPL-025
#[test]
fn the_sensor_file_is_the_manuals_table() {
    let sensor = sensors("vlp-32c").unwrap();
    // Elevations come in no order of the lasers; offsets of azimuth are four columns of the laser array.
    let mut columns = [0; 4];
    for laser in sensor.lasers() {
        let offset = (laser.azimuth_offset_rad.to_degrees() * 10.0).round() as i32;
        columns[[42, 14, -14, -42].iter().position(|&known| known == offset).unwrap()] += 1;
    }
    assert_eq!(columns, [5, 11, 11, 5]);
    assert_eq!((sensor.lasers()[0].ring, sensor.lasers()[29].ring), (0, 31));
    assert!(sensor.lasers().chunks(2).all(|pair| pair[0].offset_ns == pair[1].offset_ns), "two fire together");
    assert_eq!(sensor.lasers()[31].offset_ns, 34_560);
}
