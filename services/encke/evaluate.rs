use std::fs;
use std::path::{Path, PathBuf};

use ground::RunNote;

use crate::assets::Assets;
use crate::cli::EvaluateArgs;
use crate::{Failure, train};

/// Repeats the paper's experiments and writes `paper.json` and `paper.html`.
pub(crate) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(None);
    let plan = train::plan(&args.plan, &assets)?;
    let named = |cause: &dyn std::fmt::Display| Failure::start(format!("{}: {cause}", args.plan.display()));
    plan.check().and_then(|()| plan.reproduction().map(drop)).map_err(|cause| named(&cause))?;
    let out = Out::open(&args.out)?;

    let started_ns = runtime::clock::now_ns();
    let read = |path: &str| assets.text(path).map_err(std::io::Error::other);
    let reproduction = ground::reproduce(&plan, &read, &|progress| eprintln!("{progress}")).map_err(Failure::start)?;
    let run = RunNote {
        plan_file: args.plan.display().to_string(),
        machine: processor(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        duration_s: ((runtime::clock::now_ns() - started_ns) as f64 * 1e-8).round() / 10.0,
    };
    let json = reproduction.to_json(&run);
    out.write("paper.json", &json)?;
    out.write("paper.html", &reproduction.to_html(&run))?;
    eprintln!("{:.0} s; the page is {}", run.duration_s, out.0.join("paper.html").display());
    crate::print(&if args.json { json } else { format!("{reproduction}\n") })
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

/// The processor's name, as the kernel gives it.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or(std::env::consts::ARCH, |(_, name)| name.trim()).to_owned()
}
