//! Recordings that cannot be opened: one clear line each, that names file, place and remedy.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::fs;

use replay::{Format, Options, ReplayError, open};
use support::{all, opened, sensors};

fn line(result: Result<replay::Recording, ReplayError>) -> String {
    let line = result.err().unwrap().to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

// verifies RPL-016
#[test]
fn each_kind_of_bad_input_names_file_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n";
    let cases: [(&str, &[u8], &[&str]); 27] = [
        ("empty", b"", &["is empty", "--format"]),
        (
            "magic",
            b"\x89PNG\r\n\x1a\n....",
            &["bytes 89 50 4e 47 0d 0a 1a 0a at offset 0", "pcap, csv, pcd", "--format"],
        ),
        ("word", b"hello, world\n", &["no known format"]),
        ("header.pcap", b"\xd4\xc3\xb2\xa1\x02\x00", &["byte 0", ".pcap"]),
        ("no-packets.pcap", &pcap_header(), &["no Velodyne data packet", "1206"]),
        ("lone.pcapng", b"\x0a\x0d\x0d\x0a\x1c\x00\x00\x00", &["byte 0"]),
        ("no-rows.csv", b"x,y,z\n", &["holds no points"]),
        ("no-points.pcd", &pcd_of(pcd, "POINTS 0\nDATA ascii\n"), &["holds no points"]),
        ("no-data.pcd", &pcd_of(pcd, "POINTS 1\n"), &["line 6", "DATA"]),
        ("kind.pcd", &pcd_of(pcd, "POINTS 1\nDATA octal\n"), &["line 6", "octal", "must be ascii"]),
        ("size.pcd", b"FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n", &["line 5", "as many each"]),
        ("type.pcd", b"FIELDS x y z\nSIZE 4 4 2\nTYPE F F F\nPOINTS 1\nDATA ascii\n", &["field z is F with 2 bytes"]),
        ("xy.pcd", b"FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n", &["must name x, y and z"]),
        ("packed.pcd", &pcd_of(pcd, "POINTS 9\nDATA binary_compressed\n\x01\0\0\0\x6c\0\0\0a"), &["byte", "cut off"]),
        ("no-end.ply", b"ply\nformat ascii 1.0\n", &["line 3", "end_header"]),
        ("format.ply", b"ply\nformat utf-8 1.0\nend_header\n", &["line 2", "utf-8", "must be format ascii"]),
        ("no-format.ply", b"ply\nelement vertex 1\nend_header\n", &["line 3", "no line format"]),
        (
            "element.ply",
            b"ply\nformat ascii 1.0\nelement vertex -1\nend_header\n",
            &["line 3", "vertex -1", "a number"],
        ),
        ("property.ply", b"ply\nformat ascii 1.0\nproperty float x\n", &["line 3", "below an element"]),
        ("kind.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n", &["line 4", "half", "KIND"]),
        ("list.ply", b"ply\nformat ascii 1.0\nelement a 1\nproperty list float int x\n", &["line 4", "an integer"]),
        ("word.ply", b"ply\nformat ascii 1.0\nvertices 3\n", &["line 3", "vertices 3", "must be format"]),
        ("no-vertex.ply", b"ply\nformat ascii 1.0\nend_header\n", &["line 3", "no element vertex"]),
        ("no-z.ply", &ply_of("ascii", 1, "xy"), &["line 6", "no property z"]),
        ("no-points.ply", &ply_of("ascii", 0, "xyz"), &["holds no points"]),
        ("huge.ply", &ply_of("binary_big_endian", u64::MAX, "xyz"), &["holds no points"]),
        ("version.mcap", b"\x89MCAP9\r\n", &["byte 0", "version 0", ".mcap"]),
    ];
    for (name, bytes, words) in cases {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let line = line(opened(&path));
        assert!(line.starts_with(&path.display().to_string()), "{name}: {line}");
        for word in words {
            assert!(line.contains(word), "{name}: {line}");
        }
    }
}

fn pcap_header() -> Vec<u8> {
    [0xa1b2_c3d4_u32, 4 << 16 | 2, 0, 0, 65_535, 1].iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn ply_of(encoding: &str, points: u64, names: &str) -> Vec<u8> {
    let properties: String = names.chars().map(|name| format!("property float {name}\n")).collect();
    format!("ply\nformat {encoding} 1.0\nelement vertex {points}\n{properties}end_header\n").into_bytes()
}

fn pcd_of(head: &str, rest: &str) -> Vec<u8> {
    format!("{head}{rest}").into_bytes()
}

// verifies RPL-016
#[test]
fn a_path_that_is_not_there_and_a_folder_without_recordings_are_said_so() {
    let folder = tempfile::tempdir().unwrap();
    assert!(line(opened(&folder.path().join("nothing"))).contains("cannot be read"));
    assert!(line(opened(folder.path())).contains("no recording among its 0 files"));
    fs::write(folder.path().join("readme.txt"), "text").unwrap();
    assert!(line(opened(folder.path())).contains("no recording among its 1 files"));
}

// verifies RPL-016
#[test]
fn a_folder_of_several_formats_asks_which_and_a_format_by_name_chooses() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "x,y,z\n1,2,3\n").unwrap();
    fs::write(folder.path().join("b.pcd"), "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n4 5 6\n")
        .unwrap();
    let line = line(opened(folder.path()));
    assert!(line.contains("csv (") && line.contains("pcd (") && line.contains("--format"), "{line}");
    for (format, x) in [(Format::Csv, 1.0), (Format::Pcd, 4.0)] {
        let options = Options { format: Some(format), ..Options::default() };
        let sweeps = all(&mut open(folder.path(), &options, &sensors).unwrap());
        assert_eq!(sweeps.iter().map(|sweep| sweep.returns[0].x).collect::<Vec<_>>(), [x]);
    }
}

// verifies RPL-016
#[test]
fn a_bad_file_of_a_folder_is_passed_over_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\n";
    fs::write(folder.path().join("a.pcd"), format!("{head}DATA octal\n")).unwrap();
    fs::write(folder.path().join("b.pcd"), format!("{head}DATA ascii\n4 5 6\n")).unwrap();
    fs::write(folder.path().join("c.pcd"), head).unwrap();
    let mut recording = opened(folder.path()).unwrap();
    assert_eq!(all(&mut recording).len(), 1);
    assert_eq!(recording.faults().count(replay::Fault::BadFile), 2);
}

// verifies RPL-016
#[test]
fn an_unknown_sensor_and_impossible_limits_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "x,y,z\n1,2,3\n").unwrap();
    let options = Options { sensor: Some("sonar".to_owned()), ..Options::default() };
    let unknown = line(open(&path, &options, &sensors));
    assert!(unknown.contains("sensor sonar") && unknown.contains("--sensor"), "{unknown}");
    let options = Options { min_range_m: Some(200.0), ..Options::default() };
    let limits = line(open(&path, &options, &sensors));
    assert!(limits.contains("200 to 131.08 m") && limits.contains("--min-range"), "{limits}");
}
