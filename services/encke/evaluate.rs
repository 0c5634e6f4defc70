//! `encke evaluate`: the configured classifier against its bars, the configured tracker against its own, or the paper's
//! experiments.

mod bars;
mod paper;
mod tracks;

use std::fs;
use std::path::{Path, PathBuf};

use ground::RunNote;

use crate::Failure;
use crate::cli::EvaluateArgs;

/// Measures, prints, and writes a page.
pub(crate) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    match (args.paper, args.tracks) {
        (true, _) => paper::evaluate(args),
        (false, true) => tracks::evaluate(args),
        (false, false) => bars::evaluate(args),
    }
}

/// A folder that can be written to: known before minutes of work.
struct Out(PathBuf);

impl Out {
    fn open(dir: &Path) -> Result<Self, Failure> {
        let refused = |cause| Failure::start(format!("--out {}: cannot be written to: {cause}", dir.display()));
        fs::create_dir_all(dir).map_err(refused)?;
        let probe = dir.join(format!(".encke-{}", std::process::id()));
        fs::write(&probe, b"").and_then(|()| fs::remove_file(&probe)).map_err(refused)?;
        Ok(Self(dir.to_owned()))
    }

    /// Writes a file whole or not at all.
    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let (part, whole) = (self.0.join(format!("{name}.part")), self.0.join(name));
        fs::write(&part, text)
            .and_then(|()| fs::rename(&part, &whole))
            .map_err(|cause| Failure::run(format!("{}: {cause}", whole.display())))
    }
}

/// What differs from run to run, once all is done.
fn run_note(plan: &Path, started_ns: u64) -> RunNote {
    RunNote {
        plan_file: plan.display().to_string(),
        machine: processor(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        duration_s: ((runtime::clock::now_ns() - started_ns) as f64 * 1e-8).round() / 10.0,
    }
}

/// The processor's name, as the kernel gives it.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or(std::env::consts::ARCH, |(_, name)| name.trim()).to_owned()
}
