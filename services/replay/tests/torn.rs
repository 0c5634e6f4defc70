//! Torn files: whatever bytes a parser meets, it gives what is intact or one error, and never panics.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use messages::{Message, Truth};
use replay::{Format, Options, PacketWriter, PcapStamps, open};
use stage::{Next, Source};
use support::container::{CLOUD, PACKINGS, PLAIN, RAW, Style, container, point_cloud2, raw};
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

fn pcap(turns: u64) -> Vec<u8> {
    let sensor = hdl_32e();
    let mut writer = PacketWriter::new(Vec::new(), &sensor, PcapStamps::Micros).unwrap();
    let mut sweep = new_sweep();
    for turn in 0..turns {
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

fn points(columns: usize) -> Vec<[f32; 5]> {
    let point = |index: usize| {
        let (column, ring) = (index / 32, index % 32);
        let (azimuth_rad, elevation_rad) = (column as f32 * -0.1, (-30.67 + 1.333 * ring as f32).to_radians());
        let (x, y) = (elevation_rad.cos() * azimuth_rad.cos() * 9.0, elevation_rad.cos() * azimuth_rad.sin() * 9.0);
        [x, y, 9.0 * elevation_rad.sin(), index as f32 % 256.0, ring as f32]
    };
    (0..32 * columns).map(point).collect()
}

fn pcd(encoding: &str, columns: usize) -> Vec<u8> {
    let points = points(columns);
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

fn csv(columns: usize) -> Vec<u8> {
    let mut text = "x,y,z,intensity,ring,azimuth_deg,time_ns\n".to_owned();
    for (index, [x, y, z, i, r]) in points(columns).into_iter().enumerate() {
        text += &format!("{x},{y},{z},{i},{r},{},{}\n", index / 32, index * 1_000);
    }
    text.into_bytes()
}

fn nuscenes(columns: usize) -> Vec<u8> {
    points(columns).iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

/// Ring by ring, as KITTI has them, and only the rings that look as its sensor does.
fn kitti(columns: usize) -> Vec<u8> {
    let mut points: Vec<_> = points(columns).into_iter().filter(|point| point[4] > 10.0).collect();
    points.sort_by_key(|point| point[4] as u8);
    points.iter().flat_map(|[x, y, z, i, _]| [*x, *y, *z, *i / 256.0]).flat_map(f32::to_le_bytes).collect()
}

/// Vertices with a list and between other elements.
fn ply(encoding: &str, columns: usize) -> Vec<u8> {
    let points = points(columns);
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\ncomment made\nelement camera 1\nproperty list uchar short sizes\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty double z\nproperty list uchar uchar more\n\
         property uchar intensity\nproperty ushort ring\nproperty float time\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n",
        points.len()
    )
    .into_bytes();
    if encoding == "ascii" {
        bytes.extend(b"2 640 480\n");
        points.iter().for_each(|[x, y, z, i, r]| bytes.extend(format!("{x} {y} {z} 1 7 {i} {r} 0.5\n").bytes()));
        bytes.extend(b"3 0 1 2\n");
        return bytes;
    }
    let mut put = |value: &[u8]| {
        if encoding.contains("big") { bytes.extend(value.iter().rev()) } else { bytes.extend(value) }
    };
    [&[2][..], &640_u16.to_le_bytes(), &480_u16.to_le_bytes()].into_iter().for_each(&mut put);
    for [x, y, z, i, r] in points {
        [x, y].into_iter().for_each(|value| put(&value.to_le_bytes()));
        put(&f64::from(z).to_le_bytes());
        [&[1][..], &[7], &[i as u8]].into_iter().for_each(&mut put);
        put(&(r as u16).to_le_bytes());
        put(&0.5_f32.to_le_bytes());
    }
    bytes
}

/// Files of every kind of message and packing, with sweeps or clouds of few columns.
fn mcaps(columns: usize) -> Vec<(String, Vec<u8>)> {
    let points = points(columns);
    let of = |axis: usize| points.iter().map(|point| f64::from(point[axis])).collect::<Vec<f64>>();
    let fields = [("x", 7, of(0)), ("y", 7, of(1)), ("z", 8, of(2)), ("intensity", 2, of(3)), ("ring", 4, of(4))];
    let mut sweep = new_sweep();
    hdl_32e().rings().iter().for_each(|&ring| sweep.rings.push(ring).unwrap());
    for index in 0..columns as u16 {
        let azimuth_rad = 3.0 - f32::from(index) * 0.1;
        sweep.columns.push(lidar::Column { azimuth_rad, offset_ns: u32::from(index), valid: 1 }).unwrap();
        let found = lidar::Return { x: 5.0, column: index, ring: (index % 32) as u8, ..lidar::Return::default() };
        sweep.returns.push(found).unwrap();
    }
    (sweep.header.organised, sweep.header.period_ns, sweep.header.recorded) = (1, 1, columns as u32);
    let foxglove = [
        &[0x0A, 2, 0x08, 1, 0x25, 12, 0, 0, 0][..],
        b"\x2A\x0A\x0A\x01x\x15\0\0\0\0\x18\x07\x2A\x0A\x0A\x01y\x15\x04\0\0\0\x18\x07",
        b"\x2A\x0A\x0A\x01z\x15\x08\0\0\0\x18\x07\x32\x18",
        &[1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat(),
    ]
    .concat();
    let ros1 = Style { is_ros1: true, ..PLAIN };
    let kinds = [
        (RAW, raw(&sweep)),
        (CLOUD, point_cloud2(PLAIN, [1, 2], &fields)),
        (
            CLOUD,
            point_cloud2(Style { is_big_endian: true, is_data_big_endian: true, rows: 2, ..PLAIN }, [1, 2], &fields),
        ),
        (("/a", "ros1", "sensor_msgs/PointCloud2"), point_cloud2(ros1, [1, 2], &fields)),
        (("/a", "protobuf", "foxglove.PointCloud"), foxglove),
    ];
    let mut files = Vec::new();
    for packing in PACKINGS {
        for (kind, (topic, message)) in kinds.iter().enumerate() {
            let messages: Vec<_> = (0..3).map(|time| (0, time, message.clone())).collect();
            files.push((format!("{packing:?}-{kind}"), container(packing, 500, &[*topic], &messages)));
        }
    }
    files
}

// verifies RPL-017
#[test]
fn torn_captures_never_panic() {
    check("a.pcap", &pcap(3), Format::Pcap, 600);
    check("a.pcapng", &pcapng(&pcap(3)), Format::Pcap, 600);
}

// verifies RPL-017
#[test]
fn torn_point_clouds_never_panic() {
    for encoding in ["ascii", "binary", "binary_compressed"] {
        check(encoding, &pcd(encoding, 60), Format::Pcd, 300);
    }
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        check(encoding, &ply(encoding, 60), Format::Ply, 300);
    }
    check("a.pcd.bin", &nuscenes(60), Format::NuScenes, 300);
    check("a.bin", &kitti(60), Format::Kitti, 300);
}

// verifies RPL-017
#[test]
fn torn_mcap_files_never_panic() {
    for (name, bytes) in mcaps(4) {
        check(&name, &bytes, Format::Mcap, 200);
    }
}

// verifies RPL-017
#[test]
fn torn_tables_never_panic() {
    check("a.csv", &csv(60), Format::Csv, 300);
}

// verifies RPL-017
#[test]
fn a_file_forced_into_every_other_format_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let mut files = vec![pcap(3), pcapng(&pcap(3)), pcd("binary", 60), pcd("binary_compressed", 60), csv(60)];
    files.extend([nuscenes(60), kitti(60), ply("ascii", 60), ply("binary_big_endian", 60), vec![0; 5_000]]);
    files.extend(mcaps(4).into_iter().map(|(_, bytes)| bytes));
    for bytes in files {
        std::fs::write(&path, bytes).unwrap();
        for format in Format::ALL {
            replayed(&path, Some(format));
        }
    }
}

/// Small intact files for each target of `fuzz/`, into the folder that ENCKE_SEEDS names.
#[test]
#[ignore = "writes files: run by fuzz/million.sh"]
fn seeds_for_fuzzing_are_written() {
    let folder = std::path::PathBuf::from(std::env::var_os("ENCKE_SEEDS").unwrap());
    let mut seeds = vec![("pcap", pcap(1)), ("pcap", pcapng(&pcap(1))), ("csv", csv(1))];
    seeds.extend(["ascii", "binary", "binary_compressed"].map(|encoding| ("pcd", pcd(encoding, 1))));
    seeds.extend(["ascii", "binary_little_endian", "binary_big_endian"].map(|encoding| ("ply", ply(encoding, 1))));
    seeds.extend([("nuscenes", nuscenes(1)), ("kitti", kitti(2))]);
    seeds.extend(mcaps(1).into_iter().map(|(_, bytes)| ("mcap", bytes)));
    for (number, (name, bytes)) in seeds.into_iter().enumerate() {
        for target in [name, "any"] {
            let folder = folder.join(format!("replay_{target}"));
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join(format!("{name}-{number}")), &bytes).unwrap();
        }
    }
}
