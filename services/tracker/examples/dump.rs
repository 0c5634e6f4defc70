//! Plays scenes through the chain's rooms and dumps detections and truth (uncommitted helper).
#![allow(clippy::unwrap_used, missing_docs)]
use messages::*;
use stage::Stage;
use std::io::Write;
use zerocopy::{FromZeros, IntoBytes};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let read = |path: &str| std::fs::read_to_string(path).unwrap();
    let config = &args[1];
    let sweeps: u64 = args[3].parse().unwrap();
    for seed in &args[4..] {
        let seed: u64 = seed.parse().unwrap();
        let mut file: simulator::SceneFile =
            toml::from_str(&read(&format!("{config}/scenes/{}.toml", args[2]))).unwrap();
        file.seed = seed;
        let sensor: lidar::SensorFile = toml::from_str(&read(&format!("{config}/sensors/hdl-32e-paper.toml"))).unwrap();
        let mut simulator =
            simulator::Simulator::new(file.checked(&sensor.checked().unwrap(), &Default::default()).unwrap());
        let mut clusterer =
            clusterer::Clusterer::init(toml::from_str(&read(&format!("{config}/stages/clusterer.toml"))).unwrap())
                .unwrap();
        let mut extractor =
            extractor::Extractor::init(toml::from_str(&read(&format!("{config}/stages/extractor.toml"))).unwrap())
                .unwrap();
        let mut params: classifier::Params =
            toml::from_str(&read(&format!("{config}/stages/classifier.toml"))).unwrap();
        let folder = format!("{config}/models/{}", params.model);
        params.files = Some(classifier::ModelFiles {
            card: read(&format!("{folder}/card.toml")),
            model: std::fs::read(format!("{folder}/model.txt")).unwrap(),
        });
        params.overload = None;
        let mut classifier = classifier::Classifier::init(params).unwrap();
        let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
        let (mut a, mut b, mut c) = (
            Clusters::new_box_zeroed().unwrap(),
            Descriptors::new_box_zeroed().unwrap(),
            Detections::new_box_zeroed().unwrap(),
        );
        let create = |end: &str| std::io::BufWriter::new(std::fs::File::create(format!("n{seed}.{end}")).unwrap());
        let (mut bin, mut rows, mut map) = (create("bin"), create("truth"), create("map"));
        let write =
            |to: &mut dyn Write, row: &[f64]| row.iter().for_each(|one| to.write_all(&one.to_le_bytes()).unwrap());
        for number in 0..sweeps {
            simulator.sweep(number, &mut sweep, &mut truth);
            let part = Part {
                ordinal: number,
                sweep: number,
                sector: 0,
                sectors: 1,
                sensor_time_ns: sweep.header.sensor_time_ns,
                step: 0,
                attempt: 0,
            };
            (a.clear(), b.clear(), c.clear());
            clusterer.process(part, &sweep, &mut a);
            extractor.process(part, &a, &mut b);
            classifier.process(part, &b, &mut c);
            let h = c.header;
            bin.write_all(&h.sensor_time_ns.to_le_bytes()).unwrap();
            bin.write_all(&h.period_ns.to_le_bytes()).unwrap();
            for word in
                [h.complete, c.detections.len() as u32, c.solids.len() as u32, h.column_step_rad.to_bits(), 0, 0]
            {
                bin.write_all(&word.to_le_bytes()).unwrap();
            }
            bin.write_all(c.detections.item_bytes()).unwrap();
            bin.write_all(c.solids.item_bytes()).unwrap();
            for o in &truth.objects {
                let mut row = vec![
                    number as f64,
                    h.sensor_time_ns as f64,
                    f64::from(o.id),
                    f64::from(o.class as u8),
                    f64::from(o.returns),
                ];
                for values in [&o.centre_m[..], &o.velocity_mps, &o.size_m, &o.attitude_wxyz, &o.spin_radps] {
                    row.extend(values.iter().map(|&one| f64::from(one)));
                }
                write(&mut rows, &row);
            }
            for d in &c.detections {
                let mut count = [0_u32; 2048];
                for &member in &c.members[d.summary.member_places()] {
                    count[usize::from(truth.owners[member as usize]).min(2047)] += 1;
                }
                let most = (0..2048).max_by_key(|&id| (count[id], 2048 - id)).unwrap();
                write(
                    &mut map,
                    &[
                        number as f64,
                        f64::from(d.summary.key),
                        most as f64,
                        f64::from(count[most]) / f64::from(d.summary.points),
                        f64::from(d.summary.points),
                    ],
                );
            }
        }
        eprintln!("seed {seed}");
    }
}
