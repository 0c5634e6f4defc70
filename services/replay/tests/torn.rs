//! Torn files: whatever bytes a parser meets, it gives what is intact or one error, and never panics.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use messages::{Message, Truth};
use replay::{Format, Options, PacketWriter, PcapStamps, open};
use stage::{Next, Source};
use support::{assert_true, hdl_32e, new_sweep, sensors};
use zerocopy::FromZeros;

struct Seeded(u64);

impl Seeded {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound.max(1)
    }
}

/// Bytes with some flipped, cut off, left out or doubled.
fn torn(bytes: &[u8], random: &mut Seeded) -> Vec<u8> {
    let mut torn = bytes.to_vec();
    // Half of the faults hit the headers, where they tell most.
    let head = bytes.len().min(400);
    for _ in 0..1 + random.below(4) {
        let at = if random.below(2) == 0 { random.below(head) } else { random.below(torn.len()) };
        match random.below(8) {
            0 => torn.truncate(at),
            1 => drop(torn.drain(at.min(torn.len())..(at + random.below(50)).min(torn.len()))),
            2 => {
                let part = torn[at.min(torn.len())..(at + 30).min(torn.len())].to_vec();
                torn.splice(at.min(torn.len())..at.min(torn.len()), part);
            }
            3 => torn.iter_mut().skip(at).take(4).for_each(|byte| *byte = 0xFF),
            _ => torn.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << random.below(8)),
        }
    }
    torn
}

/// Opens and reads all there is; the number of sweeps.
fn replayed(path: &Path, format: Option<Format>) -> usize {
    let options = Options { format, ..Options::default() };
    let Ok(mut recording) = open(path, &options, &sensors) else { return 0 };
    let (mut sweep, mut truth) = (new_sweep(), Truth::new_box_zeroed().unwrap());
    for sweeps in 0.. {
        sweep.clear();
        if recording.next(&mut sweep, &mut truth).unwrap() == Next::End {
            return sweeps;
        }
        assert_true(&sweep);
        assert!(sweeps < 10_000, "it ends");
    }
    0
}

fn check(name: &str, bytes: &[u8], format: Format, rounds: usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    assert!(replayed(&path, None) > 0, "{name} is intact before it is torn");
    let mut random = Seeded(bytes.len() as u64);
    let mut used = 0;
    for round in 0..rounds {
        std::fs::write(&path, torn(bytes, &mut random)).unwrap();
        let forced = (round % 4 != 0).then_some(format);
        used += usize::from(replayed(&path, forced) > 0);
    }
    assert!(used * 10 > rounds, "{name}: what is intact is used, {used} of {rounds}");
}

fn pcap() -> Vec<u8> {
    let sensor = hdl_32e();
    let mut writer = PacketWriter::new(Vec::new(), &sensor, PcapStamps::Micros).unwrap();
    let mut sweep = new_sweep();
    for turn in 0..3_u64 {
        sweep.clear();
        sweep.header.organised = 1;
        sweep.header.sensor_time_ns = turn * 100 * 46_080;
        sensor.rings().iter().for_each(|&ring| sweep.rings.push(ring).unwrap());
        for index in 0..100_u16 {
            let azimuth_rad = -(f32::from(index) * 3.6).to_radians();
            let offset_ns = u32::from(index) * 46_080;
            sweep.columns.push(lidar::Column { azimuth_rad, offset_ns, valid: 1 }).unwrap();
            let found = lidar::Return { x: 5.0, column: index, ring: (index % 32) as u8, ..lidar::Return::default() };
            sweep.returns.push(found).unwrap();
        }
        writer.write(&sweep).unwrap();
    }
    writer.finish().unwrap()
}

/// The records of a classic capture in next-generation blocks.
fn pcapng(classic: &[u8]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let length = (body.len() as u32 + 12).to_le_bytes();
        [&kind.to_le_bytes()[..], &length, body, &length].concat()
    };
    let section = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat();
    let mut bytes = [block(0x0A0D_0D0A, &section), block(1, &[1, 0, 0, 0, 0, 0, 0, 0])].concat();
    for record in classic[24..].chunks(16 + 1_248) {
        let words = [0_u32, 0, 5, 1_248, 1_248].map(u32::to_le_bytes).concat();
        bytes.extend(block(6, &[&words[..], &record[16..]].concat()));
    }
    bytes
}

fn points() -> Vec<[f32; 5]> {
    let point = |index: usize| {
        let (column, ring) = (index / 32, index % 32);
        let (azimuth_rad, elevation_rad) = (column as f32 * -0.1, (-30.67 + 1.333 * ring as f32).to_radians());
        let (x, y) = (elevation_rad.cos() * azimuth_rad.cos() * 9.0, elevation_rad.cos() * azimuth_rad.sin() * 9.0);
        [x, y, 9.0 * elevation_rad.sin(), index as f32 % 256.0, ring as f32]
    };
    (0..32 * 60).map(point).collect()
}

fn pcd(encoding: &str) -> Vec<u8> {
    let points = points();
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity ring\nSIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\n\
         WIDTH {n}\nHEIGHT 1\nPOINTS {n}\nDATA {encoding}\n",
        n = points.len()
    )
    .into_bytes();
    match encoding {
        "ascii" => points.iter().for_each(|[x, y, z, i, r]| bytes.extend(format!("{x} {y} {z} {i} {r}\n").bytes())),
        "binary" => points.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes())),
        _ => {
            let whole: Vec<u8> =
                (0..5).flat_map(|axis| points.iter().flat_map(move |p| p[axis].to_le_bytes())).collect();
            let packed: Vec<u8> = whole.chunks(32).flat_map(|run| [&[run.len() as u8 - 1][..], run].concat()).collect();
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend((whole.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
    }
    bytes
}

fn csv() -> Vec<u8> {
    let mut text = "x,y,z,intensity,ring,azimuth_deg,time_ns\n".to_owned();
    for (index, [x, y, z, i, r]) in points().into_iter().enumerate() {
        text += &format!("{x},{y},{z},{i},{r},{},{}\n", index / 32, index * 1_000);
    }
    text.into_bytes()
}

// verifies RPL-017
#[test]
fn torn_captures_never_panic() {
    check("a.pcap", &pcap(), Format::Pcap, 600);
    check("a.pcapng", &pcapng(&pcap()), Format::Pcap, 600);
}

// verifies RPL-017
#[test]
fn torn_point_clouds_never_panic() {
    for encoding in ["ascii", "binary", "binary_compressed"] {
        check(encoding, &pcd(encoding), Format::Pcd, 300);
    }
    let bytes: Vec<u8> = points().iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    check("a.pcd.bin", &bytes, Format::NuScenes, 300);
}

// verifies RPL-017
#[test]
fn torn_tables_never_panic() {
    check("a.csv", &csv(), Format::Csv, 300);
}

// verifies RPL-017
#[test]
fn a_file_forced_into_every_other_format_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    for bytes in [pcap(), pcapng(&pcap()), pcd("binary"), pcd("binary_compressed"), csv(), vec![0; 5_000]] {
        std::fs::write(&path, bytes).unwrap();
        for format in Format::ALL {
            replayed(&path, Some(format));
        }
    }
}
