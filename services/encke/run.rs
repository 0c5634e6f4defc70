use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use chain::executive::{Executive, ExecutiveFile};
use chain::{Chain, ChainFile};
use runtime::{Outputs, Plan, SourcePlan};
use supervisor::{Report, Settings};
use transport::Instance;

use crate::assets::Assets;
use crate::cli::{PaceArg, ReturnsArg, RunArgs, Span};
use crate::{Failure, dispatch, outputs, sources};

/// Runs the chain and prints its summary.
pub(crate) fn run(args: &RunArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(args.chain.as_deref());
    let mut plan = plan(args, &assets)?;
    let name = args.instance.clone().unwrap_or_else(|| format!("run-{}", std::process::id()));
    let instance = Instance::named(&name).map_err(Failure::start)?;
    let adoptable = if args.adopt { supervisor::find_adoptable(&instance, &plan) } else { None };
    plan.sensor = match adoptable {
        Some(running) => running.sensor,
        // What a stage would refuse is refused here, before anything starts.
        None => dispatch::check(&plan, &assets)?,
    };
    let iceoryx2_config = assets.text("iceoryx2.toml").map_err(Failure::start)?;
    let files = [
        ("--detections", plan.outputs.detections.as_deref()),
        ("--tracks", plan.outputs.tracks.as_deref()),
        ("--labels", plan.outputs.labels.as_deref()),
        ("--trace", plan.outputs.trace.as_deref()),
        ("--record", plan.outputs.record.as_deref()),
        ("--events", plan.outputs.events.as_deref()),
        ("--report", args.report.as_deref()),
    ];
    let _pipes = outputs::check(&files, &plan.source.from)?;

    let settings =
        Settings { instance, plan, iceoryx2_config: &iceoryx2_config, spawn: !args.no_spawn, adopt: args.adopt };
    let report = supervisor::run(settings).map_err(Failure::start)?;

    let json = crate::report::to_json(&report)? + "\n";
    if let Some(path) = &args.report {
        outputs::write_whole(path, json.as_bytes())?;
    }
    let text = if args.json { json } else { supervisor::summary(&report) };
    crate::print(&text)?;
    verdict(&report, args.strict)
}

fn verdict(report: &Report, strict: bool) -> Result<(), Failure> {
    report.failure(strict).map_or(Ok(()), |cause| Err(Failure::Failed(cause)))
}

/// Everything that the processes of the run must agree on.
pub(crate) fn plan(args: &RunArgs, assets: &Assets) -> Result<Plan, Failure> {
    let chain = chain(args, assets)?;
    let parameters = parameters(&chain, assets)?;
    let from = match &args.from {
        Some(from) => sources::locate(from, assets)?,
        None => sources::locate_default(&chain.default_source, assets)?,
    };
    let is_scene = sources::is_scene(&from);
    refuse_idle_options(args, is_scene, sources::live(&from)?.is_some())?;
    let (sweeps, duration_ns) = match (args.sweeps, args.duration) {
        (Some(sweeps), _) => (Some(sweeps), None),
        (None, Some(Span::For(duration))) => (None, Some(duration.as_nanos() as u64)),
        (None, Some(Span::Forever)) => (None, None),
        (None, None) => (is_scene.then_some(chain.default_sweeps), None),
    };
    let absolute = |path: &Option<PathBuf>| match path.as_deref() {
        Some(path) if path == Path::new("-") => Ok(Some(path.to_owned())), // standard output
        Some(path) => std::path::absolute(path).map(Some).map_err(Failure::start),
        None => Ok(None),
    };
    Ok(Plan {
        supervisor_pid: std::process::id(),
        executive: executive(&chain, assets)?,
        generation: 0,
        parameters,
        source: SourcePlan {
            from,
            format: args.format.clone(),
            sensor: args.sensor.clone(),
            topic: args.topic.clone(),
            both_returns: matches!(args.returns, ReturnsArg::Both),
            min_range_m: args.min_range,
            max_range_m: args.max_range,
            repeat: args.repeat,
            seed: args.seed,
            rate: args.rate,
            single_step: matches!(args.pace, PaceArg::Step),
        },
        sensor: String::new(),
        pace: args.pace.into(),
        sweeps,
        duration_ns,
        outputs: Outputs {
            detections: absolute(&args.detections)?,
            tracks: absolute(&args.tracks)?,
            labels: absolute(&args.labels)?,
            trace: absolute(&args.trace)?,
            record: absolute(&args.record)?,
            events: absolute(&args.events)?,
        },
        config_dirs: assets.dirs().to_vec(),
        chain,
    })
}

/// Text of each stage's file of parameters.
pub(crate) fn parameters(chain: &Chain, assets: &Assets) -> Result<BTreeMap<String, String>, Failure> {
    let stages = chain.stages.iter().filter_map(|stage| Some((stage.name.clone(), stage.parameters.as_deref()?)));
    stages.map(|(name, path)| Ok((name, assets.text(path).map_err(Failure::start)?))).collect()
}

/// An option that would change nothing is a mistake of the one who wrote it.
fn refuse_idle_options(args: &RunArgs, is_scene: bool, is_live: bool) -> Result<(), Failure> {
    let for_recordings = [
        ("--format", args.format.is_some()),
        ("--sensor", args.sensor.is_some()),
        ("--min-range", args.min_range.is_some()),
        ("--max-range", args.max_range.is_some()),
        ("--loop", args.repeat),
        ("--topic", args.topic.is_some()),
        ("--returns", matches!(args.returns, ReturnsArg::Both)),
    ];
    let of_files = [
        ("--format", args.format.is_some()),
        ("--loop", args.repeat),
        ("--topic", args.topic.is_some()),
        ("--rate", args.rate != 1.0),
        ("--pace", !matches!(args.pace, PaceArg::Realtime)),
    ];
    if let Some((option, _)) = of_files.into_iter().find(|(_, given)| *given && is_live) {
        return Err(Failure::start(format!(
            "{option} is not for live sensors, which come when they come: leave it out"
        )));
    }
    let idle = for_recordings.into_iter().find(|(_, given)| *given && is_scene);
    if let Some((option, _)) = idle {
        return Err(Failure::start(format!("{option} is for recordings, and the source is a scene: leave it out")));
    }
    if args.rate != 1.0 && !matches!(args.pace, PaceArg::Realtime) {
        return Err(Failure::start("--rate is for --pace realtime: leave one of them out"));
    }
    if args.seed.is_some() && !is_scene {
        return Err(Failure::start("--seed is for scenes, and the source is a recording: leave it out"));
    }
    Ok(())
}

fn chain(args: &RunArgs, assets: &Assets) -> Result<Chain, Failure> {
    let (name, text) = match &args.chain {
        Some(path) => {
            let text = fs::read_to_string(path);
            (path.display().to_string(), text.map_err(|cause| Failure::start(format!("{}: {cause}", path.display())))?)
        }
        None => ("chain.toml".to_owned(), assets.text("chain.toml").map_err(Failure::start)?),
    };
    let named = |cause: chain::ChainError| Failure::start(format!("{name}: {cause}"));
    let mut file = ChainFile::parse(&text).map_err(named)?;
    if let Some(sectors) = args.sectors {
        file.sectors = sectors;
    }
    let chain = file.checked().map_err(named)?;
    Ok(chain)
}

/// What is watched while the chain runs: `executive.toml` beside the chain's file.
pub(crate) fn executive(chain: &Chain, assets: &Assets) -> Result<Executive, Failure> {
    let text = assets.text("executive.toml").map_err(Failure::start)?;
    let table = ExecutiveFile::parse(&text).and_then(|file| file.checked(chain));
    table.map_err(|cause| Failure::start(format!("executive.toml: {cause}")))
}
