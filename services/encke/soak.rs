//! `encke soak`: a long run, with faults or without, and a verdict.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use soak::{BarsFile, Campaign, Settings, Setup, SoakError};
use transport::Instance;

use crate::assets::Assets;
use crate::cli::SoakArgs;
use crate::{Failure, outputs, sources};

/// How a new document of survival matrices begins.
const HEAD: &str = "# Survival matrix\n\nWhat was done to the chain on purpose, and what came of it. Each section is written by its own \
                    run; services/soak/README.md says how each figure is measured.\n";

/// Runs the soak, writes what it has shown, prints it.
pub(crate) fn soak(args: &SoakArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(args.chain.as_deref());
    let bars = assets.text("soak.toml").map_err(Failure::start)?;
    let bars = BarsFile::parse(&bars).and_then(BarsFile::checked).map_err(Failure::start)?;
    let campaign = campaign(args, &assets)?;
    if args.duration.is_some() && campaign.has_length() {
        return Err(Failure::start(format!(
            "--duration: a campaign of the kind {} has its own: leave it out",
            campaign.kind()
        )));
    }
    let length_s = args.duration.map(|duration| duration.as_secs_f64());
    if length_s.is_none() && !campaign.has_length() {
        return Err(Failure::start("--duration: this campaign has no length of its own: say how long"));
    }
    let _pipes = outputs::check(&[("--matrix", args.matrix.as_deref())], Path::new(""))?;
    let name = args.instance.clone().unwrap_or_else(|| format!("soak-{}", std::process::id()));
    let out = std::path::absolute(&args.out).map_err(Failure::start)?;
    make_empty(&out)?;
    let (chain, tape) = (chain(args, &campaign, &assets, &out)?, recording(args, &out));
    let setup =
        Setup { instance: Instance::named(&name).map_err(Failure::start)?, arguments: arguments(args, chain), out };
    let source = args.from.as_ref().map_or("chain.toml's".to_owned(), |from| from.display().to_string());
    let settings = Settings { setup, length_s, campaign, bars, seed: args.seed, source, more: tape };

    let verdict = soak::soak(&settings).map_err(|error| match error {
        SoakError::NotUp { .. } => Failure::run(error),
        error => Failure::start(error),
    })?;

    let json = crate::report::to_json(&verdict)? + "\n";
    let out = &settings.setup.out;
    outputs::write_whole(&out.join("verdict.json"), json.as_bytes())?;
    outputs::write_whole(&out.join("verdict.html"), verdict.to_html().as_bytes())?;
    if !verdict.faults.is_empty() {
        outputs::write_whole(&out.join("matrix.md"), verdict.to_markdown().as_bytes())?;
    }
    if let (Some(path), Some(campaign)) = (&args.matrix, &args.faults) {
        let title = campaign.file_stem().unwrap_or_default().to_string_lossy();
        let document = fs::read_to_string(path).unwrap_or_else(|_| HEAD.to_owned());
        outputs::write_whole(path, soak::with_section(&document, &title, &verdict.to_markdown()).as_bytes())?;
    }
    crate::print(&if args.json { json } else { verdict.summary() })?;
    verdict.failure(args.strict).map_or(Ok(()), |cause| Err(Failure::Failed(cause)))
}

/// What is done to the chain.
fn campaign(args: &SoakArgs, assets: &Assets) -> Result<Campaign, Failure> {
    let Some(path) = &args.faults else { return Ok(Campaign::Nothing) };
    let text = text(path, assets)?;
    Campaign::parse(&path.display().to_string(), &text).map_err(Failure::start)
}

/// A file, or the one of this name in the configuration.
fn text(path: &Path, assets: &Assets) -> Result<String, Failure> {
    fs::read_to_string(path).or_else(|_| {
        let in_config = path.strip_prefix("config").unwrap_or(path);
        assets.text(&in_config.to_string_lossy()).map_err(Failure::start)
    })
}

/// Makes the folder. What an earlier soak left there would be mixed up with this one's.
fn make_empty(out: &Path) -> Result<(), Failure> {
    let failed = |cause: std::io::Error| Failure::start(format!("--out {}: {cause}", out.display()));
    fs::create_dir_all(out).map_err(failed)?;
    if fs::read_dir(out).map_err(failed)?.next().is_some() {
        return Err(Failure::start(format!("--out {}: is not empty; name another folder", out.display())));
    }
    Ok(())
}

/// The chain's file, where one is to be named: a day's recordings have a table of their own beside it.
fn chain(args: &SoakArgs, campaign: &Campaign, assets: &Assets, out: &Path) -> Result<Option<PathBuf>, Failure> {
    let absolute = |path: &PathBuf| std::path::absolute(path).map_err(Failure::start);
    let Campaign::Day(soak::DayFile { tape: Some(tape), .. }) = campaign else {
        return args.chain.as_ref().map(absolute).transpose();
    };
    let dir = out.join("config");
    let chain = match &args.chain {
        Some(path) => text(path, assets)?,
        None => assets.text("chain.toml").map_err(Failure::start)?,
    };
    let tape = text(Path::new(tape), assets)?;
    fs::create_dir_all(&dir).map_err(Failure::start)?;
    for (name, text) in [("chain.toml", chain), ("tape.toml", tape)] {
        outputs::write_whole(&dir.join(name), text.as_bytes())?;
    }
    Ok(Some(dir.join("chain.toml")))
}

/// Options of `encke run` that say what it runs.
fn arguments(args: &SoakArgs, chain: Option<PathBuf>) -> Vec<OsString> {
    let mut words = Vec::new();
    if let Some(from) = &args.from {
        words.extend(["--from".into(), from.into()]);
        if !sources::is_scene(from) {
            words.push("--loop".into());
        }
    }
    if let Some(chain) = chain {
        words.extend(["--chain".into(), chain.into()]);
    }
    if args.rate != 1.0 {
        words.extend(["--rate".into(), args.rate.to_string().into()]);
    }
    words
}

fn recording(args: &SoakArgs, out: &Path) -> Vec<OsString> {
    if args.record { vec!["--record".into(), out.join("recording.mcap").into()] } else { Vec::new() }
}
