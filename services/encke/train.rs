use std::path::Path;

use ground::{SolidsPlan, TrainPlan};

use serde::de::DeserializeOwned;

use crate::Failure;
use crate::assets::Assets;
use crate::cli::TrainArgs;

/// Trains what the plan says and writes it with its cards: the paper's classifiers, or boosted trees on fitted solids.
pub(crate) fn train(args: &TrainArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(None);
    let text = text(&args.plan, &assets)?;
    let read = |path: &str| assets.text(path).map_err(std::io::Error::other);
    let mut progress = |progress: &ground::Progress| eprintln!("{progress}");
    let unwritten = |cause: std::io::Error| Failure::run(format!("{}: {cause}", args.out.display()));
    // Only the plan for solids has a table of that name.
    if text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("trees")) {
        let plan: SolidsPlan = parse(&args.plan, &text)?;
        let trained = ground::train_solids(&plan, &read, &mut progress).map_err(Failure::start)?;
        trained.write_to(&args.out).map_err(unwritten)?;
        return crate::print(&format!("{}\n", trained.report));
    }
    let plan: TrainPlan = parse(&args.plan, &text)?;
    let trained = ground::train(&plan, &read, &mut progress).map_err(Failure::start)?;
    trained.write_to(&args.out).map_err(unwritten)?;
    crate::print(&format!("{}\n", trained.report))
}

/// The paper's plan in this file; where there is none, the one of this name that is built in.
pub(crate) fn plan(path: &Path, assets: &Assets) -> Result<TrainPlan, Failure> {
    parse(path, &text(path, assets)?)
}

fn text(path: &Path, assets: &Assets) -> Result<String, Failure> {
    std::fs::read_to_string(path).or_else(|_| {
        let in_config = path.strip_prefix("config").unwrap_or(path);
        assets.text(&in_config.to_string_lossy()).map_err(Failure::start)
    })
}

fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, Failure> {
    toml::from_str(text)
        .map_err(|cause| Failure::start(format!("{}: {}", path.display(), cause.to_string().trim_end())))
}
