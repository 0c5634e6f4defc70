use std::path::Path;

use super::{Out, run_note};
use crate::assets::Assets;
use crate::cli::EvaluateArgs;
use crate::{Failure, train};

/// The plan where none is named.
const PLAN: &str = "config/training/paper.toml";

/// Repeats the paper's experiments and writes `paper.json` and `paper.html`.
pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    let assets = Assets::beside(None);
    let path = args.plan.as_deref().unwrap_or(Path::new(PLAN));
    let plan = train::plan(path, &assets)?;
    let named = |cause: &dyn std::fmt::Display| Failure::start(format!("{}: {cause}", path.display()));
    plan.check().and_then(|()| plan.reproduction().map(drop)).map_err(|cause| named(&cause))?;
    let Some(out) = &args.out else { return Err(Failure::start("--paper needs --out DIR, a folder for its page")) };
    let out = Out::open(out)?;

    let started_ns = runtime::clock::now_ns();
    let read = |path: &str| assets.text(path).map_err(std::io::Error::other);
    let reproduction = ground::reproduce(&plan, &read, &|progress| eprintln!("{progress}")).map_err(Failure::start)?;
    let run = run_note(path, started_ns);
    let json = reproduction.to_json(&run);
    out.write("paper.json", &json)?;
    out.write("paper.html", &reproduction.to_html(&run))?;
    eprintln!("{:.0} s; the page is {}", run.duration_s, out.0.join("paper.html").display());
    crate::print(&if args.json { json } else { format!("{reproduction}\n") })
}
