//! PLY and KITTI files, real and made.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use messages::{Refusal, Sweep};
use replay::{Fault, Format, Options, open};
use support::{all, assert_true, data, opened, sensors};

const KITTI: [(&str, u32); 4] = [
    ("kitti/object_000008_front.bin", 17_238),
    ("kitti/odometry00_000000.bin", 124_668),
    ("kitti/odometry00_000001.bin", 124_605),
    ("kitti/odometry00_000002.bin", 124_478),
];
const NUSCENES: &str = "nuscenes/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";

fn one(path: &Path) -> Box<Sweep> {
    let mut sweeps = all(&mut opened(path).unwrap());
    assert_eq!(sweeps.len(), 1);
    let sweep = sweeps.remove(0);
    assert_true(&sweep);
    sweep
}

// verifies RPL-019
#[test]
fn the_ply_cloud_is_to_the_bit_the_one_that_the_pcd_file_has() {
    let (Some(ply), Some(pcd)) = (data("clouds/small_gicp_target.ply"), data("clouds/fast_gicp_251370668.pcd")) else {
        return;
    };
    assert_eq!(opened(&ply).unwrap().format(), Format::Ply);
    let (ply, pcd) = (one(&ply), one(&pcd));
    assert_eq!(ply.header, pcd.header);
    assert_eq!(ply.header.recorded, 69_088);
    assert!(ply.header.is_organised());
    assert_eq!(ply.returns[..], pcd.returns[..]);
    assert_eq!(ply.recorded_index[..], pcd.recorded_index[..]);
    assert_eq!(ply.columns[..], pcd.columns[..]);
}

/// Two materials and a vertex with a list, before and after the points: all but the points is passed over.
fn ply(encoding: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\r\nformat {encoding} 1.0\r\ncomment element vertex 9\r\nobj_info x\r\n\
         element material 2\r\nproperty uchar red\r\nproperty list uchar short names\r\n\
         element vertex 3\r\nproperty double y\r\nproperty list ushort float weights\r\nproperty float x\r\n\
         property short z\r\nproperty uchar Intensity\r\nproperty ushort ring\r\nproperty uint t\r\n\
         element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
    )
    .into_bytes();
    if encoding == "ascii" {
        bytes.extend(b"7 2 -1 -2\r\n8 0\r\n2 0 1 3 4 5 6\r\n\r\n-2.5 3 .1 .2 .3 1e1 -30 255 31 7000\r\n2 0 1 nan 4 5 6\r\n3 0 1 2\r\n");
        return bytes;
    }
    let is_big = encoding.contains("big");
    let mut put = |value: &[u8]| {
        if is_big { bytes.extend(value.iter().rev()) } else { bytes.extend(value) }
    };
    for material in [&[-1_i16, -2][..], &[]] {
        put(&[7]);
        put(&[material.len() as u8]);
        material.iter().for_each(|name| put(&name.to_le_bytes()));
    }
    let vertices =
        [(2.0, 0, 1.0, 3, 4, 5, 6), (-2.5, 3, 10.0, -30, 255, 31, 7_000), (2.0, 0, 1.0, i16::MAX, 4, 5, 6_u32)];
    for (y, weights, x, z, intensity, ring, t) in vertices {
        put(&f64::to_le_bytes(y));
        put(&u16::to_le_bytes(weights));
        (0..weights).for_each(|_| put(&0.1_f32.to_le_bytes()));
        put(&f32::to_le_bytes(x));
        put(&i16::to_le_bytes(z));
        put(&[intensity]);
        put(&u16::to_le_bytes(ring));
        put(&u32::to_le_bytes(t));
    }
    put(&[3]);
    (0..3).for_each(|index| put(&i32::to_le_bytes(index)));
    bytes
}

// verifies RPL-019
#[test]
fn all_three_encodings_of_a_ply_pass_over_lists_and_other_elements() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        std::fs::write(&path, ply(encoding)).unwrap();
        let mut recording = opened(&path).unwrap();
        let sweep = all(&mut recording).remove(0);
        assert_true(&sweep);
        assert_eq!(sweep.header.recorded, 3, "{encoding}");
        let found: Vec<_> = sweep.returns.iter().map(|found| (found.position(), found.intensity)).collect();
        assert_eq!(found[..2], [([1.0, 2.0, 3.0], 4), ([10.0, -2.5, -30.0], 255)], "{encoding}");
        assert_eq!(sweep.header.sensor_time_ns, 6, "{encoding}: times count nanoseconds");
        let refused = if encoding == "ascii" { Refusal::NotFinite } else { Refusal::TooFar };
        assert_eq!(sweep.header.refused[refused as usize], 1, "{encoding}");
        assert!(recording.faults().found().all(|(fault, _)| fault == Fault::BadRow), "{encoding}");
    }
}

// verifies RPL-019, RPL-013
#[test]
fn a_ply_that_is_torn_anywhere_is_used_up_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let whole = ply(encoding);
        let head = whole.windows(10).position(|part| part == b"end_header").unwrap() + 12;
        let mut before = 0;
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let options = Options { format: Some(Format::Ply), ..Options::default() };
            let opened = open(&path, &options, &sensors);
            assert!(length >= head || opened.is_err(), "{encoding}, {length}");
            let Ok(mut recording) = opened else { continue };
            let sweep = all(&mut recording).remove(0);
            let torn = recording.faults().count(Fault::TornCloud) as u32;
            assert_eq!(sweep.header.recorded + torn, 3, "{encoding}, {length}: each point is read or missed");
            assert_eq!(sweep.header.is_complete(), torn == 0);
            assert!(sweep.header.recorded >= before);
            before = sweep.header.recorded;
        }
        assert_eq!(before, 3);
    }
}

// verifies RPL-020
#[test]
fn kitti_sweeps_have_their_counts_and_their_sensor_and_are_not_called_organised() {
    for (name, points) in KITTI {
        let Some(path) = data(name) else { return };
        let recording = opened(&path).unwrap();
        assert_eq!((recording.format(), recording.sensor_name()), (Format::Kitti, "hdl-64e"), "{name}");
        let sweep = one(&path);
        assert_eq!((sweep.header.recorded, sweep.returns.len()), (points, points as usize), "{name}");
        assert!(!sweep.header.is_organised(), "{name}: corrected for the car's motion");
    }
    let Some(path) = data(KITTI[0].0) else { return };
    let first = one(&path).returns[0];
    assert_eq!((first.position(), first.intensity), ([21.554, 0.028, 0.938], 87), "0.34 of 255");
}

// verifies RPL-020
#[test]
fn a_folder_of_kitti_files_is_a_sweep_each() {
    let Some(path) = data(KITTI[1].0) else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["1.bin", "0.bin"] {
        std::fs::copy(&path, folder.path().join(name)).unwrap();
    }
    let sweeps = all(&mut opened(folder.path()).unwrap());
    assert_eq!(sweeps.iter().map(|sweep| sweep.header.sensor_time_ns).collect::<Vec<_>>(), [0, 100_000_000]);
}

// verifies RPL-020
#[test]
fn rows_of_four_and_of_five_floats_are_told_apart_at_any_length() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let names = KITTI.map(|(name, _)| (name, Format::Kitti));
    for (name, format) in names.into_iter().chain([(NUSCENES, Format::NuScenes)]) {
        let Some(file) = data(name) else { return };
        let bytes = std::fs::read(file).unwrap();
        // 80 divides by both rows, 81 by none.
        for length in [80 * 4, 80 * 100, 80 * 100 + 1, bytes.len() / 80 * 80] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert_eq!(opened(&path).unwrap().format(), format, "{name}, {length}");
        }
    }
}

// verifies RPL-020
#[test]
fn floats_that_no_sensor_sees_are_not_taken_for_kitti() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let mut random = 7_u64;
    let mut uniform = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f32 / (1 << 24) as f32
    };
    let mut floats = |scale: f32, shift: f32| -> Vec<f32> { (0..4_000).map(|_| scale * (uniform() - shift)).collect() };
    let mut flat = floats(40.0, 0.5);
    flat.chunks_mut(4).for_each(|point| (point[2], point[3]) = (-1.0, 0.5));
    let cases = [
        ("0 to 1", floats(1.0, 0.0)),
        ("-1 to 1", floats(2.0, 0.5)),
        ("0 to 100", floats(100.0, 0.0)),
        ("zeros", floats(0.0, 0.0)),
        ("NaN", floats(f32::NAN, 0.0)),
        ("a flat cloud in no order", flat),
        ("rising", (0..4_000).map(|value| value as f32).collect()),
    ];
    for (name, floats) in cases {
        let bytes: Vec<u8> = floats.into_iter().flat_map(f32::to_le_bytes).collect();
        std::fs::write(&path, bytes).unwrap();
        assert!(opened(&path).is_err(), "{name}");
    }
}

// verifies RPL-020, RPL-013
#[test]
fn a_kitti_file_torn_inside_a_point_is_used_up_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    let bytes: Vec<u8> = [1.0_f32, 2.0, -0.5, 0.5].repeat(5).into_iter().flat_map(f32::to_le_bytes).collect();
    for length in 0..bytes.len() {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let options = Options { format: Some(Format::Kitti), ..Options::default() };
        let Ok(mut recording) = open(&path, &options, &sensors) else {
            assert!(length < 16);
            continue;
        };
        let sweep = all(&mut recording).remove(0);
        assert_eq!((sweep.returns.len(), sweep.header.is_complete()), (length / 16, length % 16 == 0));
        assert_eq!(recording.faults().count(Fault::TornCloud), u64::from(length % 16 != 0));
    }
}
