use lidar::SensorFile;

use super::*;

pub(crate) fn hdl_32e() -> SensorModel {
    let file: SensorFile = toml::from_str(include_str!("../../../../config/sensors/hdl-32e.toml")).unwrap();
    file.checked().unwrap()
}

pub(crate) fn paper_sensor() -> SensorModel {
    let file: SensorFile = toml::from_str(include_str!("../../../../config/sensors/hdl-32e-paper.toml")).unwrap();
    file.checked().unwrap()
}

/// Azimuth of a direction, clockwise [deg], in [0, 360).
fn heading_deg(direction: &Vector3<f64>) -> f64 {
    (-direction.y.atan2(direction.x)).to_degrees().rem_euclid(360.0)
}

#[test]
fn the_head_turns_clockwise_from_x_and_reports_azimuths_counter_clockwise() {
    let turn = Turn::new(&hdl_32e(), 2_170, true);
    let azimuths: Vec<f32> = turn.columns().iter().map(|column| column.azimuth_rad).collect();
    assert_eq!(azimuths[0], 0.0);
    assert!(azimuths[1] < 0.0);
    assert!(azimuths.iter().all(|azimuth| (-std::f32::consts::PI..std::f32::consts::PI).contains(azimuth)));
    assert_eq!(azimuths.windows(2).filter(|pair| pair[1] > pair[0]).count(), 1, "one wrap a turn");
    assert_eq!(turn.columns()[1].offset_ns, 46_080);
    assert_eq!(turn.period_ns(), 99_993_600);
}

#[test]
fn ring_0_is_the_lowest_and_the_order_of_firing_is_the_sensors() {
    let turn = Turn::new(&hdl_32e(), 2_170, true);
    let elevations: Vec<f64> = (0..32).map(|ring| turn.direction(0, ring).z.asin().to_degrees()).collect();
    assert!((elevations[0] + 30.67).abs() < 1e-9);
    assert!(elevations.is_sorted());
    assert_eq!(turn.firing_order()[..4], [0, 16, 1, 17]);
}

/// The published way to read packets, written out: 12 columns a packet, the speed from its first and last azimuth.
#[test]
fn every_direction_is_what_a_reader_of_packets_makes_of_it() {
    for (sensor, columns) in [(hdl_32e(), 2_170), (hdl_32e(), 1_084), (hdl_32e(), 1_085), (paper_sensor(), 500)] {
        let mut turn = Turn::new(&sensor, columns, true);
        let sweeps = 7;
        let azimuth_counts: Vec<i64> = (0..sweeps * columns)
            .map(|index| {
                let azimuth_rad = f64::from(turn.columns()[index % columns].azimuth_rad);
                ((-azimuth_rad).to_degrees() * 100.0).round().rem_euclid(36_000.0) as i64
            })
            .collect();
        for sweep in 0..sweeps - 1 {
            turn.begin(sweep as u64);
            for column in 0..columns {
                let index = sweep * columns + column;
                let packet = index / 12 * 12;
                let seen = (azimuth_counts[packet + 11] - azimuth_counts[packet]).rem_euclid(36_000);
                let counts_per_ns = seen as f64 / (11.0 * f64::from(sensor.cycle_ns()));
                for laser in sensor.lasers() {
                    let counts = azimuth_counts[index] as f64 + counts_per_ns * f64::from(laser.offset_ns);
                    let found = heading_deg(&turn.direction(column, usize::from(laser.ring)));
                    let difference = (found - counts / 100.0 + 180.0).rem_euclid(360.0) - 180.0;
                    assert!(difference.abs() < 1e-9, "{columns} columns, sweep {sweep}, column {column}: {difference}");
                }
            }
        }
    }
}

#[test]
fn unrounded_azimuths_are_those_of_an_even_turn() {
    let sensor = hdl_32e();
    let mut turn = Turn::new(&sensor, 2_170, false);
    turn.begin(3);
    for column in [0, 1, 1_085, 2_169] {
        for laser in sensor.lasers() {
            let time_ns = column as f64 * 46_080.0 + f64::from(laser.offset_ns);
            let expected = 360.0 * time_ns / turn.period_ns() as f64;
            let found = heading_deg(&turn.direction(column, usize::from(laser.ring)));
            assert!((found - expected).abs() < 1e-9);
        }
    }
}
