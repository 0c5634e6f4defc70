use std::path::Path;

use ground::TrainPlan;

use crate::Failure;
use crate::assets::Assets;
use crate::cli::TrainArgs;

/// Trains the paper's classifiers and writes them with their cards.
pub(crate) fn train(args: &TrainArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(None);
    let plan = plan(&args.plan, &assets)?;
    let read = |path: &str| assets.text(path).map_err(std::io::Error::other);
    let trained = ground::train(&plan, &read, &mut |progress| eprintln!("{progress}")).map_err(Failure::start)?;
    trained.write_to(&args.out).map_err(|cause| Failure::run(format!("{}: {cause}", args.out.display())))?;
    crate::print(&format!("{}\n", trained.report))
}

/// The plan in this file; where there is none, the one of this name that is built in.
pub(crate) fn plan(path: &Path, assets: &Assets) -> Result<TrainPlan, Failure> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(_) => {
            let in_config = path.strip_prefix("config").unwrap_or(path);
            assets.text(&in_config.to_string_lossy()).map_err(Failure::start)?
        }
    };
    toml::from_str(&text)
        .map_err(|cause| Failure::start(format!("{}: {}", path.display(), cause.to_string().trim_end())))
}
