//! Sweeps written as packets and tables read back as the same sweeps.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::io::Write;
use std::path::Path;

use lidar::{Column, Return, SensorFile, SensorModel};
use messages::{Message, Sweep};
use replay::{Options, PacketWriter, PcapStamps, TableWriter, WriteError, open};
use support::{all, assert_true, hdl_32e, new_sweep};

/// A sensor like the HDL-32E with another time from column to column.
fn sensor(cycle_ns: u32) -> SensorModel {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/sensors/hdl-32e.toml");
    let mut file: SensorFile = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    file.cycle_ns = cycle_ns;
    file.checked().unwrap()
}

/// A small generator of numbers below 1, the same on every machine.
struct Seeded(u64);

impl Seeded {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A turn as a spinning sensor sees it: columns from azimuth 0, each laser's azimuth at its own firing time.
fn turn(sensor: &SensorModel, columns: usize, start_ns: u64, share: f64, random: &mut Seeded) -> Box<Sweep> {
    let mut sweep = new_sweep();
    let cycle_ns = sensor.cycle_ns();
    sweep.header.sensor_time_ns = start_ns;
    sweep.header.organised = 1;
    sensor.rings().iter().for_each(|&ring| sweep.rings.push(ring).unwrap());
    for index in 0..columns {
        let azimuth_deg = (index as f64 * 36_000.0 / columns as f64).round() / 100.0;
        let azimuth_rad = -azimuth_deg.to_radians();
        let wrapped =
            if azimuth_rad < -std::f64::consts::PI { azimuth_rad + std::f64::consts::TAU } else { azimuth_rad };
        let offset_ns = index as u32 * cycle_ns;
        sweep.columns.push(Column { azimuth_rad: wrapped as f32, offset_ns, valid: 1 }).unwrap();
        for laser in sensor.lasers() {
            if random.next() > share {
                continue;
            }
            let turned_rad = std::f64::consts::TAU / columns as f64 * f64::from(laser.offset_ns) / f64::from(cycle_ns);
            let range_m = (500.0 + random.next() * 49_000.0).round() * 0.002;
            let (sin_az, cos_az) = (azimuth_rad - turned_rad).sin_cos();
            let (sin_el, cos_el) = laser.elevation_rad.sin_cos();
            let [x, y, z] = [cos_el * cos_az, cos_el * sin_az, sin_el].map(|c| (range_m * c) as f32);
            let intensity = (random.next() * 256.0) as u8;
            sweep.returns.push(Return { x, y, z, column: index as u16, ring: laser.ring, intensity }).unwrap();
        }
    }
    sweep.header.recorded = sweep.returns.len() as u32;
    sweep
}

fn written(sensor: &SensorModel, stamps: PcapStamps, sweeps: &[Box<Sweep>]) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    let mut writer = PacketWriter::new(Vec::new(), sensor, stamps).unwrap();
    sweeps.iter().for_each(|sweep| writer.write(sweep).unwrap());
    file.write_all(&writer.finish().unwrap()).unwrap();
    file
}

fn read(path: &Path, sensor: &SensorModel) -> Vec<Box<Sweep>> {
    let mut recording = open(path, &Options::default(), &|_| Ok(sensor.clone())).unwrap();
    let sweeps = all(&mut recording);
    assert_eq!(recording.faults().found().collect::<Vec<_>>(), []);
    sweeps
}

/// How far rounding of two azimuths to 0.01° can turn a packet's last firing: 0.01° over 11 cycles, for 0.775 of one.
const TURNED_RAD: f32 = 1.24e-5;

fn apart_rad(a: f32, b: f32) -> f32 {
    let apart = (a - b).abs();
    apart.min(std::f32::consts::TAU - apart)
}

/// The same returns in the same columns; positions as near as the rounding of azimuths allows, 1 mm up to 80 m.
fn assert_same(found: &[Box<Sweep>], sent: &[Box<Sweep>], tolerance_ns: u32) {
    assert_eq!(found.len(), sent.len());
    for (found, sent) in found.iter().zip(sent) {
        assert_true(found);
        assert_eq!(found.returns.len(), sent.returns.len());
        assert_eq!(found.columns.len(), sent.columns.len());
        assert!(found.header.sensor_time_ns.abs_diff(sent.header.sensor_time_ns) <= u64::from(tolerance_ns));
        for (index, (a, b)) in found.columns.iter().zip(&sent.columns).enumerate() {
            assert_eq!(a.valid, b.valid, "column {index}");
            assert!(a.offset_ns.abs_diff(b.offset_ns) <= tolerance_ns, "{} {}", a.offset_ns, b.offset_ns);
            assert!(apart_rad(a.azimuth_rad, b.azimuth_rad) < 3e-4, "column {index}: {a:?} {b:?}");
        }
        for (a, b) in found.returns.iter().zip(&sent.returns) {
            assert_eq!((a.column, a.ring, a.intensity), (b.column, b.ring, b.intensity));
            let apart_m = a.position().iter().zip(b.position()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(apart_m <= 3e-5 + b.range_m() * TURNED_RAD, "{apart_m} m at {} m", b.range_m());
        }
    }
}

// verifies RPL-009
#[test]
fn turns_written_as_packets_read_back_as_the_same_turns() {
    let hdl = hdl_32e();
    // Columns a turn, time from column to column, period: 10 Hz and 20 Hz of the real sensor, the paper's 500 columns,
    // and turns that do and do not end with a packet.
    for (columns, cycle_ns, period_ns) in [
        (2_170, 46_080, 100_000_000),
        (1_084, 46_080, 50_000_000),
        (500, 200_000, 100_000_000),
        (504, 200_000, 100_800_000),
        (1_091, 46_080, 50_300_000),
    ] {
        let sensor = if cycle_ns == 46_080 { hdl.clone() } else { sensor(cycle_ns) };
        for share in [0.0, 0.05, 1.0] {
            let mut random = Seeded(columns as u64);
            let start_ns = 1_700_000_000_000_000_000;
            let sent: Vec<_> =
                (0..3).map(|i| turn(&sensor, columns, start_ns + i * period_ns, share, &mut random)).collect();
            let file = written(&sensor, PcapStamps::Micros, &sent);
            let found = read(file.path(), &sensor);
            // Between turns the sensor may rest for less than half a cycle, of which packets say nothing.
            let tolerance_ns = 1_000 + (period_ns - columns as u64 * u64::from(cycle_ns)).min(23_040) as u32;
            assert_same(&found, &sent, tolerance_ns);
            assert!(found.iter().all(|sweep| sweep.header.is_complete()), "{columns} columns");
            assert!(found.iter().take(2).all(|sweep| sweep.header.period_ns.abs_diff(period_ns) <= 30_000));
        }
    }
}

// verifies RPL-009
#[test]
fn time_goes_on_over_the_hour_in_both_kinds_of_stamps() {
    let sensor = hdl_32e();
    for stamps in [PcapStamps::Micros, PcapStamps::Nanos] {
        for start_ns in [0, 3_600_000_000_000 - 100_000_000, 3_600_000_000_000 * 500_000 - 150_000_000] {
            let mut random = Seeded(1);
            let sent: Vec<_> =
                (0..4).map(|i| turn(&sensor, 2_170, start_ns + i * 100_000_000, 0.1, &mut random)).collect();
            let file = written(&sensor, stamps, &sent);
            assert_same(&read(file.path(), &sensor), &sent, 8_000);
        }
    }
}

// verifies RPL-009
#[test]
fn columns_that_are_not_valid_are_unknown_again() {
    let sensor = hdl_32e();
    let mut sent = turn(&sensor, 2_170, 1_000_000_000, 0.5, &mut Seeded(5));
    let unknown = |column: usize| matches!(column, 0 | 3 | 4 | 10..40 | 2_160..2_165);
    let kept: Vec<Return> = sent.returns.iter().copied().filter(|r| !unknown(usize::from(r.column))).collect();
    sent.returns.clear();
    sent.returns.extend_from_slice(&kept).unwrap();
    for index in (0..2_170).filter(|&index| unknown(index)) {
        sent.columns[index].valid = 0;
    }
    let file = written(&sensor, PcapStamps::Micros, std::slice::from_ref(&sent));
    let mut recording = open(file.path(), &Options::default(), &|_| Ok(sensor.clone())).unwrap();
    let found = all(&mut recording);
    assert_eq!(found[0].columns.iter().filter(|column| column.valid == 0).count(), 38);
    assert_same(&found, &[sent], 1_000);
}

// verifies RPL-009
#[test]
fn what_packets_cannot_say_is_refused() {
    let sensor = hdl_32e();
    let refused = |spoil: fn(&mut Sweep)| {
        let mut sweep = turn(&sensor, 100, 0, 1.0, &mut Seeded(2));
        spoil(&mut sweep);
        PacketWriter::new(Vec::new(), &sensor, PcapStamps::Micros).unwrap().write(&sweep).unwrap_err()
    };
    assert!(matches!(refused(|s| s.header.organised = 0), WriteError::Unorganised));
    assert!(matches!(refused(|s| s.returns[5].column = 99), WriteError::Order(6)));
    assert!(matches!(refused(|s| s.returns[5].ring = 32), WriteError::Order(5)));
    assert!(matches!(refused(|s| s.returns[5].ring = s.returns[4].ring), WriteError::Second(5)));
    assert!(matches!(refused(|s| s.returns[5].x = 1e6), WriteError::Range { index: 5, .. }));
    assert!(matches!(
        refused(|s| (s.returns[5].x, s.returns[5].y, s.returns[5].z) = (0.0, 0.0, 0.0)),
        WriteError::Range { index: 5, .. }
    ));
}

// verifies RPL-009
#[test]
fn a_real_capture_written_again_gives_the_same_sweeps() {
    let Some(capture) = support::data("hdl32e/monterey_hdl32e.pcap") else { return };
    let sensor = hdl_32e();
    let sent = read(&capture, &sensor);
    let file = written(&sensor, PcapStamps::Micros, &sent);
    let found = read(file.path(), &sensor);
    assert_same(&found, &sent, 1_000);
}

// verifies RPL-010
#[test]
fn turns_written_as_tables_read_back_to_the_bit() {
    let sensor = hdl_32e();
    for (columns, share) in [(500, 1.0), (500, 0.02), (2_170, 0.3)] {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = TableWriter::new(folder.path()).unwrap();
        let mut random = Seeded(7);
        let sent: Vec<_> =
            (0..3).map(|i| turn(&sensor, columns, 5_000 + i * 100_000_000, share, &mut random)).collect();
        sent.iter().for_each(|sweep| drop(writer.write(sweep).unwrap()));
        let found = read(folder.path(), &sensor);
        assert_eq!(found.len(), 3);
        for (found, sent) in found.iter().zip(&sent) {
            assert_true(found);
            assert!(found.header.is_organised(), "{columns} columns, share {share}");
            // Columns before the first return are not in the file.
            let before = sent.returns[0].column;
            assert_eq!(found.returns.len(), sent.returns.len());
            for (a, b) in found.returns.iter().zip(&sent.returns) {
                assert_eq!(*a, Return { column: b.column - before, ..*b });
                let (a, b) = (found.columns[usize::from(a.column)], sent.columns[usize::from(b.column)]);
                assert!(apart_rad(a.azimuth_rad, b.azimuth_rad) < 1e-3);
                assert_eq!(
                    found.header.sensor_time_ns + u64::from(a.offset_ns),
                    sent.header.sensor_time_ns + u64::from(b.offset_ns)
                );
            }
        }
    }
}

// verifies RPL-010
#[test]
fn an_unorganised_sweep_is_written_as_a_table_without_rings() {
    let folder = tempfile::tempdir().unwrap();
    let mut sweep = new_sweep();
    sweep.clear();
    for x in [1.0, 2.5, -3.25] {
        sweep.returns.push(Return { x, z: 0.5, intensity: 9, ..Return::default() }).unwrap();
    }
    let path = TableWriter::new(folder.path()).unwrap().write(&sweep).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "x,y,z,intensity\n1,0,0.5,9\n2.5,0,0.5,9\n-3.25,0,0.5,9\n");
    let found = read(&path, &hdl_32e());
    assert_eq!(found[0].returns[..], sweep.returns[..]);
}
