//! Which name is which stage.

use classifier::{Card, Classifier, FeatureDefinition, ModelFiles, SolidsDefinition};
use clusterer::Clusterer;
use extractor::Extractor;
use recorder::{Recorder, Settings};
use runtime::page::{PageMap, Tier};
use runtime::{
    Outputs, Pace, Plan, SOURCE, Shell, ShellError, TAPE, run_sink, run_source, run_stage, run_stand_in, run_tap,
};
use serde::de::DeserializeOwned;
use stage::{InitError, Settled, Stage};
use tracker::Tracker;
use transport::Instance;

use crate::assets::Assets;
use crate::cli::StageArgs;
use crate::sources::{self, Opened};
use crate::spoiling::spoiled;
use crate::taping::{self, Taping};
use crate::{Failure, heap_allocations};

/// Name of the sink.
const RECORDER: &str = "recorder";

/// Is one stage of a running instance, until told to leave.
pub(crate) fn stage(args: &StageArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    runtime::logging::abort_at_once_on_panic();
    let instance = Instance::named(&args.instance).map_err(Failure::start)?;
    let mut plan = Shell::find_plan(&instance).map_err(Failure::start)?;
    let mut assets = Assets::in_dirs(plan.config_dirs.clone());
    let tier = tier(&instance, &args.name);
    if tier != Tier::Configured {
        assets = Assets::in_dirs(Vec::new());
        build_in(&mut plan, &assets);
    }
    let is_stand_in = tier == Tier::StandIn;
    let enter = |plan: Plan| Shell::enter(instance, plan, &args.name, heap_allocations);
    let outcome = match args.name.as_str() {
        SOURCE => match sources::open(&plan.source, &assets)? {
            Opened::Scene(simulator) => enter(plan).and_then(|shell| run_source(spoiled(*simulator, &shell), &shell)),
            Opened::Recording(recording) => {
                enter(plan).and_then(|shell| run_source(spoiled(*recording, &shell), &shell))
            }
            Opened::Live(live) => enter(plan).and_then(|shell| run_source(spoiled(*live, &shell), &shell)),
        },
        Clusterer::NAME if is_stand_in => enter(plan).and_then(|shell| run_stand_in::<Clusterer>(&shell)),
        Extractor::NAME if is_stand_in => enter(plan).and_then(|shell| run_stand_in::<Extractor>(&shell)),
        Classifier::NAME if is_stand_in => enter(plan).and_then(|shell| run_stand_in::<Classifier>(&shell)),
        Tracker::NAME if is_stand_in => enter(plan).and_then(|shell| run_stand_in::<Tracker>(&shell)),
        Clusterer::NAME => {
            let stage = clusterer(&plan)?;
            enter(plan).and_then(|shell| run_stage(stage, &shell, |plan| clusterer(plan).map_err(in_words)))
        }
        Extractor::NAME => {
            let stage = extractor(&plan)?;
            enter(plan).and_then(|shell| run_stage(stage, &shell, |plan| extractor(plan).map_err(in_words)))
        }
        Classifier::NAME => {
            let stage = classifier(&plan, &assets)?;
            let rebuild = |plan: &Plan| classifier(plan, &assets).map_err(in_words);
            enter(plan).and_then(|shell| run_stage(stage, &shell, rebuild))
        }
        Tracker::NAME => {
            let stage = tracker(&plan)?;
            enter(plan).and_then(|shell| run_stage(stage, &shell, |plan| tracker(plan).map_err(in_words)))
        }
        RECORDER => {
            if is_stand_in {
                // The statistics alone: a disk may be what is wrong.
                plan.outputs = Outputs::default();
            }
            enter(plan).and_then(|shell| run_sink(shell, recorder))
        }
        TAPE => match enter(plan) {
            Ok(shell) => run_tap(Taping::start(&shell, &assets)?, &shell),
            Err(error) => Err(error),
        },
        name => return Err(unknown(name)),
    };
    outcome.map_err(|error| match error {
        ShellError::Init { .. } => Failure::start(error),
        error => Failure::run(format!("{}: {error}", args.name)),
    })
}

/// Which build of a stage is asked for.
fn tier(instance: &Instance, name: &str) -> Tier {
    // Whoever has no page finds that out when it enters.
    PageMap::open(&Plan::page_path(instance, name)).map_or(Tier::Configured, |page| Tier::from_number(page.tier.get()))
}

/// Replaces all parameters by those that are built in.
fn build_in(plan: &mut Plan, built_in: &Assets) {
    plan.config_dirs.clear();
    for stage in &plan.chain.stages {
        let wired = stage.parameters.as_deref().and_then(|path| built_in.text(path).ok());
        // A chain may name its files as it likes.
        let text = wired.or_else(|| built_in.text(&format!("stages/{}.toml", stage.name)).ok());
        if let Some(text) = text {
            plan.parameters.insert(stage.name.clone(), text);
        }
    }
}

/// Builds everything that the plan names once, and gives the name of its sensor, so that what a stage would refuse is known before any process starts.
pub(crate) fn check(plan: &Plan, assets: &Assets) -> Result<String, Failure> {
    let mut source = sources::open(&plan.source, assets)?;
    source.check_sensor()?;
    let sensor = source.sensor_name().to_owned();
    drop(source);
    if plan.tape().is_some() {
        drop(taping::settings(assets)?);
    }
    check_stages(plan, assets)?;
    Ok(sensor)
}

/// Builds every stage of the plan once, so that parameters that do not hold are known before anybody uses them.
pub(crate) fn check_stages(plan: &Plan, assets: &Assets) -> Result<(), Failure> {
    for stage in &plan.chain.stages {
        match stage.name.as_str() {
            Clusterer::NAME => drop(clusterer(plan)?),
            Extractor::NAME => drop(extractor(plan)?),
            Classifier::NAME => drop(classifier(plan, assets)?),
            Tracker::NAME => drop(tracker(plan)?),
            RECORDER => {}
            name => return Err(unknown(name)),
        }
    }
    Ok(())
}

/// Why a stage could not be built.
fn in_words(failure: Failure) -> String {
    match failure {
        Failure::Failed(cause) | Failure::CannotStart(cause) => cause,
    }
}

fn unknown(name: &str) -> Failure {
    let known = [SOURCE, Clusterer::NAME, Extractor::NAME, Classifier::NAME, Tracker::NAME, RECORDER, TAPE].join(", ");
    Failure::start(format!("no stage {name:?}; there are {known}"))
}

fn clusterer(plan: &Plan) -> Result<Clusterer, Failure> {
    init(plan, |_| Ok(()))
}

fn extractor(plan: &Plan) -> Result<Extractor, Failure> {
    init(plan, |_| Ok(()))
}

fn tracker(plan: &Plan) -> Result<Tracker, Failure> {
    init(plan, |_| Ok(()))
}

fn classifier(plan: &Plan, assets: &Assets) -> Result<Classifier, Failure> {
    init::<Classifier>(plan, |params| add_model(plan, assets, params))
}

/// Reads the files of the model that the parameters name.
pub(crate) fn add_model(plan: &Plan, assets: &Assets, params: &mut classifier::Params) -> Result<(), Failure> {
    let found = extractor_params(plan);
    params.files = Some(model_files(assets, &params.model, found.as_ref())?);
    if let Some(overload) = &mut params.overload {
        let found = found.map(|found| extractor::Params {
            solids: false,
            histogram: found.histogram || found.overload.histogram,
            ..found
        });
        overload.files = Some(model_files(assets, &overload.model, found.as_ref())?);
    }
    Ok(())
}

/// The extractor's parameters; none where they do not hold, of which the extractor itself says what is wrong.
fn extractor_params(plan: &Plan) -> Option<extractor::Params> {
    toml::from_str(plan.parameters.get(Extractor::NAME)?).ok()
}

/// The files of a model that judges what an extractor of parameters `found` describes.
fn model_files(assets: &Assets, model: &str, found: Option<&extractor::Params>) -> Result<ModelFiles, Failure> {
    let folder = format!("models/{model}");
    let card = assets.text(&format!("{folder}/card.toml")).map_err(Failure::start)?;
    let parsed = Card::parse(&card).map_err(|cause| Failure::start(format!("{folder}/card.toml: {cause}")))?;
    fits_extractor(found, &parsed, model)?;
    let bytes = assets.bytes(&format!("{folder}/{}", parsed.file)).map_err(Failure::start)?.into_owned();
    Ok(ModelFiles { card, model: bytes })
}

/// A model judges only what the extractor that it was trained with describes.
fn fits_extractor(found: Option<&extractor::Params>, card: &Card, model: &str) -> Result<(), Failure> {
    let Some(found) = found else { return Ok(()) };
    let refused = |trained: String, has: String| {
        let remedy = "train anew, or set them back in stages/extractor.toml";
        Err(Failure::start(format!("model {model:?} was trained with {trained}; the extractor has {has}: {remedy}")))
    };
    if let Some(SolidsDefinition { evaluations, scouting_rays, rays, .. }) = card.solids {
        let said = |solids, (evaluations, scouting_rays, rays)| {
            format!(
                "solids = {solids}, fit.evaluations = {evaluations}, fit.scouting_rays = {scouting_rays}, fit.rays = {rays}"
            )
        };
        let (trained, has) = (
            said(true, (evaluations, scouting_rays, rays)),
            said(found.solids, (found.fit.evaluations, found.fit.scouting_rays, found.fit.rays)),
        );
        return if trained == has { Ok(()) } else { refused(trained, has) };
    }
    if let Some(FeatureDefinition { neighbours, spacing_deg, .. }) = card.features {
        let said = |histogram, (neighbours, spacing_deg)| {
            format!("histogram = {histogram}, neighbours = {neighbours}, spacing_deg = {spacing_deg}")
        };
        let (trained, has) =
            (said(true, (neighbours, spacing_deg)), said(found.histogram, (found.neighbours, found.spacing_deg)));
        return if trained == has { Ok(()) } else { refused(trained, has) };
    }
    Ok(())
}

/// Reads a stage's parameters, lets `complete` add what lies in other files, and builds the stage.
pub(crate) fn init<S: Stage>(
    plan: &Plan,
    complete: impl FnOnce(&mut S::Params) -> Result<(), Failure>,
) -> Result<S, Failure>
where
    S::Params: DeserializeOwned,
{
    let mut params = params::<S>(plan)?;
    complete(&mut params)?;
    S::init(params).map_err(|cause| in_file::<S>(plan, &cause))
}

/// A stage's parameters, as its file has them.
pub(crate) fn params<S: Stage>(plan: &Plan) -> Result<S::Params, Failure>
where
    S::Params: DeserializeOwned,
{
    let text = plan.parameters.get(S::NAME).ok_or_else(|| {
        Failure::start(format!("chain.toml: stage {:?} names no file of parameters, must name one", S::NAME))
    })?;
    toml::from_str(text).map_err(|cause| in_file::<S>(plan, &cause))
}

/// What is wrong with a stage's file of parameters.
fn in_file<S: Stage>(plan: &Plan, cause: &dyn std::fmt::Display) -> Failure {
    let wired = plan.chain.stages.iter().find(|stage| stage.name == S::NAME);
    let file = wired.and_then(|stage| stage.parameters.as_deref()).unwrap_or_default();
    Failure::start(format!("{file}: {}", cause.to_string().trim_end()))
}

fn recorder(shell: &Shell, settled: Settled) -> Result<Recorder, ShellError> {
    let plan = shell.plan();
    let settings = Settings {
        detections: plan.outputs.detections.clone(),
        tracks: plan.outputs.tracks.clone(),
        labels: plan.outputs.labels.clone(),
        trace: plan.outputs.trace.clone(),
        statistics: Some(Plan::snapshot_path(shell.instance(), shell.incarnation())),
        resume: shell.incarnation() > 1,
        queue_parts: WRITER_QUEUE_PARTS.max(plan.chain.queue_parts()),
        lossless: plan.pace == Pace::Fast,
        in_order_from: (plan.pace == Pace::Fast).then(|| shell.answered_sweeps()),
        paced: plan.pace == Pace::Realtime,
        rate: plan.source.rate,
        deadline_ms: plan.chain.deadline_ms,
        stages: plan.stages().filter(|stage| *stage != RECORDER).map(str::to_owned).collect(),
    };
    Recorder::start(settings, settled)
        .map_err(|cause| ShellError::Init { stage: RECORDER, cause: InitError::new(cause) })
}

/// Parts that may wait for a slow disk before the recorder rejects: 1.6 s of whole sweeps at 10 Hz.
const WRITER_QUEUE_PARTS: usize = 16;
