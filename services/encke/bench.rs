//! `encke bench`: what each stage's work costs on one sweep, without processes, on one thread.

mod clustering;
mod extraction;
pub(crate) mod hop;
mod judge;
mod measure;
mod sectors;
mod stages;
mod surface;
mod tracking;

use std::path::Path;

use messages::{Message, Sweep, Truth};
use runtime::SourcePlan;
use serde::Serialize;
use stage::{Next, Source};

use crate::assets::Assets;
use crate::cli::{BenchArgs, RunArgs};
use crate::sources::Opened;
use crate::{Failure, run, sources};
use stages::{STAGES, Workbench, zeroed};

/// Times every stage on one sweep of every source.
pub(crate) fn bench(args: &BenchArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(args.chain.as_deref());
    if args.hop {
        return hop::hop(args, &assets);
    }
    // All that may be refused is, before anything is timed.
    let mut sweeps = Vec::new();
    let mut built = None;
    for from in &args.from {
        let plan = run::plan(&as_run(args, from), &assets)?;
        sweeps.push((stem(from), first_sweep(&plan.source, &assets)?));
        if built.is_none() {
            built = Some(Workbench::new(args, &plan, &assets)?);
        }
    }
    let Some(mut bench) = built else { return Err(Failure::start("--from names nothing")) };
    for (name, sweep) in sweeps {
        bench.load(sweep)?;
        if !args.json {
            crate::print(&heading(&name, &bench, args.runs))?;
        }
        for stage in STAGES {
            let times = measure::repeat(args.runs, || bench.run(stage))
                .map_err(|cause| Failure::run(format!("{name}, {}: {cause}", stage.name)))?;
            let (judge, fits) = (bench.judge_of(stage), bench.fits_of(stage));
            let line = Line {
                who: "encke",
                stage: stage.name,
                sweep: &name,
                n: bench.returns(),
                clusters: bench.found(),
                described: bench.described(),
                model: &judge.name,
                support_vectors: judge.support_vectors,
                fits: fits.map(|(fits, _)| fits),
                evaluations: fits.map(|(_, evaluations)| evaluations),
                runs: args.runs,
                median_ms: times.median_ms,
                min_ms: times.min_ms,
            };
            let json = || serde_json::to_string(&line).map_err(Failure::run);
            crate::print(&(if args.json { json()? } else { row(&line) } + "\n"))?;
        }
    }
    Ok(())
}

/// One stage on one sweep, as `--json` prints it.
#[derive(Serialize)]
struct Line<'a> {
    who: &'static str,
    stage: &'static str,
    sweep: &'a str,
    /// Returns of the sweep.
    n: usize,
    clusters: usize,
    /// Clusters with features.
    described: usize,
    /// The stage's own model, or the one of `svm`.
    model: &'a str,
    support_vectors: usize,
    /// Of `fit`: clusters with fitted solids.
    #[serde(skip_serializing_if = "Option::is_none")]
    fits: Option<usize>,
    /// Of `fit`: mean number of residuals evaluated for one cluster.
    #[serde(skip_serializing_if = "Option::is_none")]
    evaluations: Option<f64>,
    runs: u32,
    median_ms: f64,
    min_ms: f64,
}

/// A line of the table.
fn row(line: &Line) -> String {
    let times = format!("{:<17} {:>12.4} {:>12.4}", line.stage, line.median_ms, line.min_ms);
    let note = match (line.fits, line.evaluations) {
        (Some(fits), Some(evaluations)) => format!("  {fits} fits of {evaluations:.0} evaluations"),
        _ if line.stage == stages::FULL_CHAIN => format!("  {}", line.model),
        _ => return times,
    };
    times + &note
}

fn heading(name: &str, bench: &Workbench, runs: u32) -> String {
    let svm = &bench.svm;
    format!(
        "sweep {name}: {} returns, {} clusters, {} with features; {}, {} support vectors; {runs} runs\n\
         {:<17} {:>12} {:>12}\n",
        bench.returns(),
        bench.found(),
        bench.described(),
        svm.name,
        svm.support_vectors,
        "stage",
        "median [ms]",
        "min [ms]",
    )
}

/// The run that would read the same source with the same files.
fn as_run(args: &BenchArgs, from: &Path) -> RunArgs {
    RunArgs {
        from: Some(from.to_owned()),
        chain: args.chain.clone(),
        format: args.format.clone(),
        sensor: args.sensor.clone(),
        ..RunArgs::default()
    }
}

/// A file's name without its ending, or a folder's name.
fn stem(from: &Path) -> String {
    let from = if from.file_name().is_none() { from.canonicalize().unwrap_or_default() } else { from.to_owned() };
    let name = if from.is_dir() { from.file_name() } else { from.file_stem() };
    name.unwrap_or_default().to_string_lossy().into_owned()
}

/// The first complete sweep, or the first where none is.
fn first_sweep(plan: &SourcePlan, assets: &Assets) -> Result<Box<Sweep>, Failure> {
    match sources::open(plan, assets)? {
        Opened::Scene(mut simulator) => first_sweep_of(simulator.as_mut(), &plan.from),
        Opened::Recording(mut recording) => first_sweep_of(recording.as_mut(), &plan.from),
        Opened::Live(_) => Err(Failure::start("bench takes a scene or a recording, not a live sensor")),
    }
}

fn first_sweep_of(source: &mut impl Source, from: &Path) -> Result<Box<Sweep>, Failure> {
    let (mut sweep, mut truth) = (zeroed::<Sweep>()?, zeroed::<Truth>()?);
    let mut first = None;
    while source.next(&mut sweep, &mut truth).map_err(Failure::start)? == Next::Sweep {
        if sweep.header.is_complete() {
            return Ok(sweep);
        }
        if first.is_none() {
            first = Some(std::mem::replace(&mut sweep, zeroed()?));
        }
        sweep.clear();
        truth.clear();
    }
    first.ok_or_else(|| Failure::start(format!("{}: no sweep in it", from.display())))
}
