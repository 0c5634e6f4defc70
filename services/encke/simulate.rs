use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use messages::{Message, Part, Sweep, Trace, Truth};
use replay::{PacketWriter, PcapStamps, TableWriter};
use serde_json::json;
use simulator::Simulator;
use tape::{About, Tape};
use zerocopy::FromZeros;

use crate::assets::Assets;
use crate::cli::SimulateArgs;
use crate::{Failure, sources, taping};

/// Writes simulated sweeps to a file, and the truth beside it.
pub(crate) fn simulate(args: &SimulateArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(None);
    let scene = sources::locate(&args.scene, &assets)?;
    let mut simulator = sources::scene(&scene, args.seed, &assets)?;
    let mut out = Out::create(args, &simulator, &assets)?;
    let truth_path = args.out.with_extension("truth.jsonl");
    let mut truths = BufWriter::new(create(&truth_path)?);
    let no_memory = |_| Failure::start("no memory for a sweep");
    let mut sweep = Sweep::new_box_zeroed().map_err(no_memory)?;
    let mut truth = Truth::new_box_zeroed().map_err(no_memory)?;
    for number in 0..args.sweeps {
        sweep.clear();
        truth.clear();
        simulator.sweep(number, &mut sweep, &mut truth);
        out.write(number, &sweep, &truth)?;
        writeln!(truths, "{}", truth_line(number, &truth)).map_err(|cause| failed(&truth_path, cause))?;
    }
    out.finish()?;
    truths.flush().map_err(|cause| failed(&truth_path, cause))?;
    eprintln!("{} sweeps in {}, their truth in {}", args.sweeps, args.out.display(), truth_path.display());
    Ok(())
}

enum Out {
    Packets(Box<PacketWriter<BufWriter<File>>>, PathBuf),
    Tables(TableWriter, PathBuf),
    Messages(Box<Tape>),
}

impl Out {
    fn create(args: &SimulateArgs, simulator: &Simulator, assets: &Assets) -> Result<Self, Failure> {
        let path = args.out.as_path();
        if path.extension().is_some_and(|extension| extension == "mcap") {
            let about = About {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                source: args.scene.display().to_string(),
                sensor: simulator.scene().sensor().name().to_owned(),
                sectors: 1,
                ..About::default()
            };
            let tape = Tape::start(taping::settings_for_sweeps(assets)?, path, about, None, 0);
            return Ok(Self::Messages(Box::new(tape.map_err(Failure::start)?)));
        }
        if path.extension().is_some_and(|extension| extension == "pcap") {
            let file = BufWriter::new(create(path)?);
            let writer = PacketWriter::new(file, simulator.scene().sensor(), PcapStamps::Micros);
            return Ok(Self::Packets(Box::new(writer.map_err(|cause| failed(path, cause))?), path.to_owned()));
        }
        if path.extension().is_some() {
            return Err(Failure::start(format!(
                "{}: must end in .pcap or .mcap, or name a folder for CSV files",
                path.display()
            )));
        }
        let tables = TableWriter::new(path).map_err(|cause| failed(path, cause))?;
        Ok(Self::Tables(tables, path.to_owned()))
    }

    fn write(&mut self, number: u64, sweep: &Sweep, truth: &Truth) -> Result<(), Failure> {
        match self {
            Self::Packets(writer, path) => writer.write(sweep).map_err(|cause| failed(path, cause)),
            Self::Tables(writer, path) => writer.write(sweep).map(drop).map_err(|cause| failed(path, cause)),
            Self::Messages(tape) => {
                let sensor_time_ns = sweep.header.sensor_time_ns;
                let part = Part { ordinal: number, sweep: number, sectors: 1, sensor_time_ns, ..Part::default() };
                let trace = Trace { part, ..Trace::default() };
                // Nobody publishes these, so their time is the sensor's: the same scene gives the same file.
                tape.sweep(sensor_time_ns, &trace, sweep);
                tape.truth(sensor_time_ns, &trace, truth);
                Ok(())
            }
        }
    }

    fn finish(self) -> Result<(), Failure> {
        match self {
            Self::Packets(writer, path) => {
                let mut file = writer.finish().map_err(|cause| failed(&path, cause))?;
                file.flush().map_err(|cause| failed(&path, cause))
            }
            Self::Tables(..) => Ok(()),
            Self::Messages(mut tape) => tape.finish(0).map_err(Failure::run),
        }
    }
}

fn create(path: &Path) -> Result<File, Failure> {
    File::create(path).map_err(|cause| Failure::start(format!("{}: cannot be written: {cause}", path.display())))
}

fn failed(path: &Path, cause: impl std::fmt::Display) -> Failure {
    Failure::run(format!("{}: {cause}", path.display()))
}

/// One sweep's truth: the obstacles, and the owner of every return (null: none).
fn truth_line(sweep: u64, truth: &Truth) -> serde_json::Value {
    let objects = truth.objects.iter().map(|object| {
        json!({
            "id": object.id,
            "class": object.class,
            "returns": object.returns,
            "centre_m": object.centre_m,
            "size_m": object.size_m,
            "attitude_wxyz": object.attitude_wxyz,
            "velocity_mps": object.velocity_mps,
            "spin_radps": object.spin_radps,
        })
    });
    let owners = truth.owners.iter().map(|&id| (id != messages::NO_OBJECT).then_some(id));
    json!({
        "sweep": sweep,
        "sensor_time_ns": truth.sensor_time_ns,
        "objects": objects.collect::<Vec<_>>(),
        "owners": owners.collect::<Vec<_>>(),
    })
}
