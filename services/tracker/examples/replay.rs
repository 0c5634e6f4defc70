//! Plays dumped detections (uncommitted helper).
#![allow(clippy::unwrap_used, missing_docs)]
use messages::*;
use stage::Stage;
use std::io::Write;
use tracker::{Params, Tracker};
use zerocopy::{FromBytes, FromZeros, IntoBytes};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let params: Params = toml::from_str(&std::fs::read_to_string(&args[1]).unwrap()).unwrap();
    for path in &args[2..] {
        let mut sut = Tracker::init(params).unwrap();
        let bytes = std::fs::read(format!("{path}.bin")).unwrap();
        let mut out = std::io::BufWriter::new(std::fs::File::create(format!("{path}.out")).unwrap());
        let (mut input, mut output) = (Detections::new_box_zeroed().unwrap(), Tracks::new_box_zeroed().unwrap());
        let (mut at, mut sweep) = (0, 0_u64);
        let (mut spent, mut most) = (std::time::Duration::ZERO, std::time::Duration::ZERO);
        while at < bytes.len() {
            let u64_at = |p: usize| u64::from_le_bytes(bytes[p..p + 8].try_into().unwrap());
            let u32_at = |p: usize| u32::from_le_bytes(bytes[p..p + 4].try_into().unwrap());
            let (time, period, _complete, n, s) =
                (u64_at(at), u64_at(at + 8), u32_at(at + 16), u32_at(at + 20) as usize, u32_at(at + 24) as usize);
            let step = f32::from_bits(u32_at(at + 28));
            at += 40;
            input.clear();
            output.clear();
            input.header.sensor_time_ns = time;
            input.header.period_ns = period;
            input.header.complete = 1;
            input.header.organised = 1;
            input.header.column_step_rad = step;
            let mut members = 0;
            for i in 0..n {
                let raw = &bytes[at + 64 * i..at + 64 * (i + 1)];
                let word = |p: usize| u32::from_le_bytes(raw[p * 4..p * 4 + 4].try_into().unwrap());
                let float = |p: usize| f32::from_bits(word(p));
                let summary = ClusterSummary {
                    key: word(0),
                    first_member: members,
                    points: word(2),
                    rings: word(3),
                    last_offset_ns: word(4),
                    seam: word(5),
                    centroid_m: [float(6), float(7), float(8)],
                };
                members += word(2);
                let class = if raw[60] == 0 {
                    lidar::ObstacleClass::Unclassified
                } else {
                    lidar::ObstacleClass::SOLIDS[raw[60] as usize - 1]
                };
                input
                    .detections
                    .push(Detection {
                        summary,
                        posterior: [float(9), float(10), float(11), float(12)],
                        first_solid: word(13),
                        solids: word(14),
                        class,
                        reserved: [0; 3],
                    })
                    .unwrap();
            }
            at += 64 * n;
            input.members.resize_zeroed(members as usize).unwrap();
            for i in 0..s {
                input.solids.push(Solid::read_from_bytes(&bytes[at + 220 * i..at + 220 * (i + 1)]).unwrap()).unwrap();
            }
            at += 220 * s;
            let part = Part { ordinal: sweep, sweep, sector: 0, sectors: 1, sensor_time_ns: time, step: 0, attempt: 0 };
            let start = std::time::Instant::now();
            let verdict = sut.process(part, &input, &mut output);
            let took = start.elapsed();
            spent += took;
            most = most.max(took);
            assert_eq!(verdict, Verdict::Complete);
            out.write_all(&(output.table.tracks.len() as u32).to_le_bytes()).unwrap();
            out.write_all(&(output.table.keys.len() as u32).to_le_bytes()).unwrap();
            out.write_all(&output.table.time_ns.to_le_bytes()).unwrap();
            out.write_all(output.table.tracks.as_bytes()).unwrap();
            out.write_all(output.table.keys.as_bytes()).unwrap();
            sweep += 1;
        }
        eprintln!(
            "{path}: {:.3} ms a sweep, most {:.3}",
            spent.as_secs_f64() * 1e3 / sweep as f64,
            most.as_secs_f64() * 1e3
        );
    }
}
