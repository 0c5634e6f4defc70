//! Clouds of others in MCAP files, real and made.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use messages::{Refusal, Sweep};
use replay::{Fault, Format, Options, Recording, open};
use support::container::{CLOUD, Field, PACKINGS, PLAIN, Packing, Style, container, point_cloud2};
use support::{all, assert_true, data, opened, sensors};

/// The recording of these messages of one topic, and its sweeps.
fn read(
    folder: &Path,
    topic: support::container::Topic<'_>,
    messages: &[(u64, Vec<u8>)],
) -> (Recording, Vec<Box<Sweep>>) {
    let path = folder.join("a.mcap");
    let messages: Vec<_> = messages.iter().map(|(time, bytes)| (0, *time, bytes.clone())).collect();
    std::fs::write(&path, container(Packing::Zstd, 1_000_000, &[topic], &messages)).unwrap();
    let mut recording = opened(&path).unwrap();
    let sweeps = all(&mut recording);
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    (recording, sweeps)
}

// verifies RPL-022, RPL-005
#[test]
fn a_point_cloud_of_a_capture_gives_the_captures_sweeps_with_their_columns() {
    let clouds = data("mcap/monterey_hdl32e_pointcloud2.mcap");
    let (Some(clouds), Some(packets)) = (clouds, data("hdl32e/monterey_hdl32e.pcap")) else { return };
    let mut recording = opened(&clouds).unwrap();
    assert_eq!((recording.format(), recording.sensor_name()), (Format::Mcap, "hdl-32e"));
    let found = all(&mut recording);
    assert_eq!(recording.faults().found().count(), 0);
    assert_eq!(found.iter().map(|sweep| sweep.header.recorded).collect::<Vec<_>>(), [49_523, 49_598, 49_684]);
    for (found, known) in found.iter().zip(&all(&mut opened(&packets).unwrap())[4..]) {
        assert_true(found);
        assert!(found.header.is_organised() && found.header.is_complete());
        assert_eq!((found.columns.len(), found.returns.len()), (known.columns.len(), known.returns.len()));
        // Its writer's times are floats: good to 256 ns since 1970, to 8 ns within the sweep.
        assert!(found.header.sensor_time_ns.abs_diff(known.header.sensor_time_ns) < 500);
        for (found, known) in found.returns.iter().zip(&known.returns) {
            assert_eq!((found.column, found.ring, found.intensity), (known.column, known.ring, known.intensity));
            let off_m = found.position().iter().zip(known.position()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off_m < 1e-12, "{off_m}");
        }
        for (found, known) in found.columns.iter().zip(&known.columns).filter(|(_, known)| known.valid == 1) {
            assert!((found.azimuth_rad - known.azimuth_rad).abs() < 1e-4);
            assert!(found.offset_ns.abs_diff(known.offset_ns) < 2_000);
        }
    }
}

fn numbers(points: usize, of: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..points).map(of).collect()
}

/// Fields of every datatype, in an order of their own.
fn fields(points: usize) -> Vec<Field<'static>> {
    vec![
        ("flags", 1, numbers(points, |_| -1.0)),
        ("z", 8, numbers(points, |point| 0.25 * point as f64)),
        ("intensity", 4, numbers(points, |point| point as f64)),
        ("x", 7, numbers(points, |point| if point == 2 { f64::NAN } else { 2.5 + point as f64 })),
        ("ring", 2, numbers(points, |_| 40.0)),
        ("y", 3, numbers(points, |point| -3.0 - point as f64)),
        ("t", 6, numbers(points, |point| 1_000.0 * point as f64)),
        ("spare", 5, numbers(points, |_| -7.0)),
    ]
}

// verifies RPL-022
#[test]
fn every_layout_of_a_point_cloud_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let styles = [
        PLAIN,
        Style { is_big_endian: true, ..PLAIN },
        Style { is_data_big_endian: true, ..PLAIN },
        Style { is_big_endian: true, is_data_big_endian: true, ..PLAIN },
        Style { rows: 2, ..PLAIN },
        Style { rows: 3, padding: [5, 7], ..PLAIN },
        Style { is_ros1: true, padding: [1, 0], ..PLAIN },
    ];
    for style in styles {
        let message = point_cloud2(style, [1_700_000_000, 5], &fields(6));
        let topic = if style.is_ros1 { ("/points", "ros1", "sensor_msgs/PointCloud2") } else { CLOUD };
        let (recording, sweeps) = read(folder.path(), topic, &[(9, message)]);
        assert_eq!((sweeps.len(), recording.faults().found().count()), (1, 0), "{style:?}");
        let sweep = &sweeps[0];
        assert_eq!(sweep.header.sensor_time_ns, 1_700_000_000_000_000_005, "{style:?}");
        assert_eq!(sweep.header.recorded, 6);
        assert_eq!(sweep.header.refused[Refusal::NotFinite as usize], 1);
        assert_eq!(&sweep.recorded_index[..], &[0, 1, 3, 4, 5]);
        let found: Vec<_> = sweep.returns.iter().map(|found| (found.position(), found.intensity)).collect();
        assert_eq!(found[4], ([7.5, -8.0, 1.25], 5), "{style:?}");
        assert!(!sweep.header.is_organised(), "ring 40 is none of the sensor's");
    }
}

// verifies RPL-022
#[test]
fn a_cloud_without_time_has_that_of_its_logging() {
    let folder = tempfile::tempdir().unwrap();
    let fields = ["x", "y", "z"].map(|name| (name, 7, vec![1.0]));
    let (_, sweeps) = read(folder.path(), CLOUD, &[(77, point_cloud2(PLAIN, [0, 0], &fields))]);
    assert_eq!(sweeps[0].header.sensor_time_ns, 77);
}

// verifies RPL-022, RPL-013
#[test]
fn a_message_that_contradicts_itself_is_passed_over_and_one_that_ends_early_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let good = point_cloud2(PLAIN, [1, 0], &fields(6));
    let step_at = good.len() - 6 * 26 - 1 - 12;
    let broken = |at: usize, value: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    let no_z = point_cloud2(PLAIN, [1, 0], &fields(6)[2..]);
    let bad =
        [broken(step_at, 25), broken(step_at, 0), no_z, vec![], vec![0, 1, 0, 0], vec![9; 300], broken(12, u32::MAX)];
    for (case, bad) in bad.into_iter().enumerate() {
        let (recording, sweeps) = read(folder.path(), CLOUD, &[(1, good.clone()), (2, bad), (3, good.clone())]);
        assert_eq!((sweeps.len(), recording.faults().count(Fault::BadMessage)), (2, 1), "{case}");
    }
    // Heights, widths and lengths that no file could fill, and data that end inside a point.
    let height_at = 4 + 8 + 4 + 8;
    let torn = [broken(height_at, u32::MAX), broken(height_at + 4, u32::MAX), good[..good.len() - 30].to_vec()];
    for (case, torn) in torn.into_iter().enumerate() {
        let (recording, sweeps) = read(folder.path(), CLOUD, &[(1, torn)]);
        assert_eq!(sweeps.len(), 1, "{case}");
        assert!(recording.faults().count(Fault::TornCloud) > 0, "{case}");
        assert!(!sweeps[0].header.is_complete(), "{case}");
        assert_eq!(sweeps[0].header.recorded, if case == 2 { 4 } else { 6 }, "{case}");
    }
    let zero: Vec<Field<'_>> = fields(6).into_iter().map(|(name, kind, _)| (name, kind, Vec::new())).collect();
    let (recording, sweeps) = read(folder.path(), CLOUD, &[(1, point_cloud2(PLAIN, [1, 0], &zero)), (2, good)]);
    assert_eq!((sweeps.len(), sweeps[0].header.recorded, recording.faults().found().count()), (2, 0, 0));
}

/// A `foxglove.PointCloud` of three points: x, y, z, column, ring, intensity as a `Return` lies in memory.
fn foxglove(seconds: u8) -> Vec<u8> {
    let field = |name: &str, offset: u8, kind: u8| {
        let body = [&[0x0A, name.len() as u8][..], name.as_bytes(), &[0x15, offset, 0, 0, 0, 0x18, kind]].concat();
        [&[0x2A, body.len() as u8][..], &body].concat()
    };
    let points = [[5.0_f32, 0.0, 0.0], [0.0, 5.0, 0.0], [f32::NAN, 0.0, 0.0]];
    let point = |(index, point): (usize, &[f32; 3])| {
        let bytes: Vec<u8> = point.iter().flat_map(|value| value.to_le_bytes()).collect();
        [&bytes[..], &[index as u8, 0, 23, 9]].concat()
    };
    let data: Vec<u8> = points.iter().enumerate().flat_map(point).collect();
    [
        &[0x0A, 4, 0x08, seconds, 0x10, 7][..],
        &[0x12, 1, b'l', 0x25, 16, 0, 0, 0],
        &[field("x", 0, 7), field("y", 4, 7), field("z", 8, 7)].concat(),
        &[field("column", 12, 3), field("ring", 14, 1), field("intensity", 15, 1)].concat(),
        &[0x32, data.len() as u8],
        &data,
    ]
    .concat()
}

// verifies RPL-022
#[test]
fn a_foxglove_cloud_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let topic = ("/points", "protobuf", "foxglove.PointCloud");
    let (recording, sweeps) = read(folder.path(), topic, &[(9, foxglove(3)), (9, vec![0xFF; 9]), (9, foxglove(4))]);
    assert_eq!(sweeps.len(), 2);
    assert_eq!(recording.faults().count(Fault::BadMessage), 1);
    assert_eq!(sweeps[1].header.sensor_time_ns, 4_000_000_007);
    assert_eq!(sweeps[1].header.refused[Refusal::NotFinite as usize], 1);
    assert_eq!(sweeps[1].returns[1].position(), [0.0, 5.0, 0.0]);
    assert_eq!(sweeps[1].returns[1].intensity, 9);
}

// verifies RPL-023
#[test]
fn one_topic_is_read_and_several_ask_which() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let cloud = |x: f64| point_cloud2(PLAIN, [1, 0], &[("x", 7, vec![x]), ("y", 7, vec![0.0]), ("z", 7, vec![0.0])]);
    let image = ("/image", "cdr", "sensor_msgs/msg/Image");
    let rear = ("/rear", CLOUD.1, CLOUD.2);
    let messages = [(0, 1, vec![7; 99]), (1, 2, cloud(1.0)), (2, 3, cloud(2.0)), (0, 4, vec![]), (1, 5, cloud(3.0))];
    for packing in PACKINGS {
        std::fs::write(&path, container(packing, 1, &[image, CLOUD, rear], &messages)).unwrap();
        let line = opened(&path).err().unwrap().to_string();
        assert!(line.contains("/points") && line.contains("/rear") && line.contains("--topic"), "{line}");
        assert!(!line.contains("/image") && !line.contains('\n'), "{line}");
        for (topic, xs) in [("/points", &[1.0, 3.0][..]), ("/rear", &[2.0])] {
            let options = Options { topic: Some(topic.to_owned()), ..Options::default() };
            let sweeps = all(&mut open(&path, &options, &sensors).unwrap());
            assert_eq!(sweeps.iter().map(|sweep| sweep.returns[0].x).collect::<Vec<_>>(), xs);
        }
        for (topic, words) in
            [("/image", "sensor_msgs/msg/Image"), ("/nothing", "no topic /nothing; give one of /points")]
        {
            let options = Options { topic: Some(topic.to_owned()), ..Options::default() };
            let line = open(&path, &options, &sensors).err().unwrap().to_string();
            assert!(line.contains(words), "{line}");
        }
        std::fs::write(&path, container(packing, 1, &[image, CLOUD], &messages[..2])).unwrap();
        assert_eq!(all(&mut opened(&path).unwrap()).len(), 1);
        std::fs::write(&path, container(packing, 1, &[image], &messages[..1])).unwrap();
        let line = opened(&path).err().unwrap().to_string();
        assert!(line.contains("holds no sweeps") && line.contains("/image (sensor_msgs/msg/Image in cdr)"), "{line}");
        std::fs::write(&path, container(packing, 1, &[CLOUD], &[])).unwrap();
        assert!(opened(&path).is_err(), "a topic without messages");
    }
}

// verifies RPL-024
#[test]
fn time_that_goes_back_or_has_a_gap_is_passed_on_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = |ms: u32| {
        let fields = ["x", "y", "z"].map(|name| (name, 7, vec![1.0]));
        (u64::from(ms), point_cloud2(PLAIN, [1, ms * 1_000_000], &fields))
    };
    let (recording, sweeps) = read(folder.path(), CLOUD, &[0, 100, 200, 300].map(cloud));
    assert_eq!((sweeps.len(), recording.faults().count(Fault::ClockStep)), (4, 0));
    let (recording, sweeps) = read(folder.path(), CLOUD, &[0, 100, 800, 900, 400, 500].map(cloud));
    assert_eq!(recording.faults().count(Fault::ClockStep), 2);
    let times: Vec<u64> = sweeps.iter().map(|sweep| sweep.header.sensor_time_ns / 1_000_000).collect();
    assert_eq!(times, [1_000, 1_100, 1_800, 1_900, 1_400, 1_500]);
    assert!(sweeps.iter().all(|sweep| sweep.header.period_ns == 100_000_000));
}

// verifies RPL-024
#[test]
fn tables_whose_time_goes_back_are_named_too() {
    let folder = tempfile::tempdir().unwrap();
    for (sweep, ms) in [100, 200, 150].into_iter().enumerate() {
        let text = format!("x,y,z,time_ns\n1,0,1,{ms}000000\n");
        std::fs::write(folder.path().join(format!("{sweep}.csv")), text).unwrap();
    }
    let mut recording = opened(folder.path()).unwrap();
    assert_eq!(all(&mut recording)[2].header.sensor_time_ns, 150_000_000);
    assert_eq!(recording.faults().count(Fault::ClockStep), 1);
}
