use std::path::Path;

use classifier::Classifier;
use ground::{Claims, EvaluateError, Evaluation, EvaluationNote, EvaluationPlan};
use messages::{Descriptors, Detections, Part};
use runtime::{Plan, clock};
use serde::de::DeserializeOwned;
use stage::Stage;

use super::{Out, run_note};
use crate::assets::Assets;
use crate::cli::{EvaluateArgs, RunArgs};
use crate::sources::{self, Opened};
use crate::{Failure, dispatch, run};

/// The plan where none is named.
const PLAN: &str = "config/evaluation/reference.toml";

/// Every sweep is whole.
pub(super) const PART: Part =
    Part { ordinal: 0, sweep: 0, sector: 0, sectors: 1, sensor_time_ns: 0, step: 0, attempt: 0 };

/// Measures the chain's classifier, prints its bars, and writes `evaluate.json` and `evaluate.html`.
pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    let assets = Assets::beside(args.chain.as_deref());
    let path = args.plan.as_deref().unwrap_or(Path::new(PLAN));
    let plan: EvaluationPlan = plan_in(path, &assets)?;
    plan.check().map_err(|cause| Failure::start(format!("{}: {cause}", path.display())))?;
    let chain = run::plan(&as_run(args), &assets)?;
    let classifier = dispatch::init::<Classifier>(&chain, |params| dispatch::add_model(&chain, &assets, params))?;
    let recording = args.from.is_some().then(|| sources::open(&chain.source, &assets)).transpose()?;
    let out = args.out.as_deref().map(Out::open).transpose()?;

    let started_ns = clock::now_ns();
    // The stages are the chain's, whatever their files are called there.
    let read = |path: &str| match path.strip_prefix("stages/").and_then(|file| file.strip_suffix(".toml")) {
        Some(stage) if chain.parameters.contains_key(stage) => Ok(chain.parameters[stage].clone()),
        _ => assets.text(path).map_err(std::io::Error::other),
    };
    let judges = || -> ground::Judge {
        let mut classifier = classifier.clone();
        Box::new(move |input: &Descriptors, output: &mut Detections| classifier.process(PART, input, output))
    };
    let mut say = |progress: &ground::Progress| eprintln!("{progress}");
    let named = |cause: EvaluateError| match cause {
        EvaluateError::Rejected(_) => Failure::run(cause),
        cause => Failure::start(format!("{}: {cause}", path.display())),
    };
    let mut evaluation = Evaluation::measure(&plan, &read, &judges, &clock::now_ns, &mut say).map_err(named)?;
    if let Some(recording) = recording {
        let sweeps = chain.sweeps.unwrap_or(u64::MAX);
        evaluation.claims = Some(
            match recording {
                Opened::Scene(mut scene) => Claims::of(scene.as_mut(), sweeps, &plan.scene, &read, &judges),
                Opened::Recording(mut recording) => Claims::of(recording.as_mut(), sweeps, &plan.scene, &read, &judges),
                Opened::Live(_) => return Err(Failure::start("--from takes a recording, not a live sensor")),
            }
            .map_err(Failure::run)?,
        );
    }
    let note = EvaluationNote {
        classifier: described(&chain)?,
        recording: args.from.as_ref().map(|from| from.display().to_string()),
        run: run_note(path, started_ns),
    };
    let json = evaluation.to_json(&note);
    if let Some(out) = &out {
        out.write("evaluate.json", &json)?;
        out.write("evaluate.html", &evaluation.to_html(&note))?;
        eprintln!("the page is {}", out.0.join("evaluate.html").display());
    }
    eprintln!("{:.0} s", note.run.duration_s);
    crate::print(&if args.json { json } else { evaluation.to_string() })?;
    match evaluation.short().join(", ") {
        short if short.is_empty() => Ok(()),
        short => Err(Failure::Failed(format!("bars that fall short: {short}"))),
    }
}

/// The plan in this file; where there is none, the one of this name that is built in.
pub(super) fn plan_in<P: DeserializeOwned>(path: &Path, assets: &Assets) -> Result<P, Failure> {
    let named =
        |cause: &dyn std::fmt::Display| Failure::start(format!("{}: {}", path.display(), cause.to_string().trim_end()));
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(_) => {
            let in_config = path.strip_prefix("config").unwrap_or(path);
            assets.text(&in_config.to_string_lossy()).map_err(Failure::start)?
        }
    };
    toml::from_str(&text).map_err(|cause| named(&cause))
}

/// The run that would read the same recording with the same files.
pub(super) fn as_run(args: &EvaluateArgs) -> RunArgs {
    RunArgs {
        chain: args.chain.clone(),
        from: args.from.clone(),
        format: args.format.clone(),
        sensor: args.sensor.clone(),
        ..RunArgs::default()
    }
}

/// Method and model of the chain's classifier.
pub(super) fn described(chain: &Plan) -> Result<String, Failure> {
    let params = dispatch::params::<Classifier>(chain)?;
    Ok(format!("{}, {}", params.method.name(), params.model))
}
