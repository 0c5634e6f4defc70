use std::path::Path;

use classifier::Classifier;
use ground::{
    Danger, EvaluateError, Follower, Judge, Progress, TrackEvaluation, TracksNote, TracksPlan, UnknownTracks,
};
use messages::{Descriptors, Detections, Part, Tracks, Verdict};
use runtime::clock;
use stage::Stage;
use tracker::Tracker;

use super::bars::{PART, as_run, described, plan_in};
use super::{Out, run_note};
use crate::assets::Assets;
use crate::cli::EvaluateArgs;
use crate::sources::{self, Opened};
use crate::{Failure, dispatch, run};

/// The plan where none is named.
const PLAN: &str = "config/evaluation/tracks.toml";

/// Measures the chain's tracks, prints their bars, and writes `tracks.json` and `tracks.html`; or tells what can be said of a
/// recording's.
pub(super) fn evaluate(args: &EvaluateArgs) -> Result<(), Failure> {
    let assets = Assets::beside(args.chain.as_deref());
    let path = args.plan.as_deref().unwrap_or(Path::new(PLAN));
    let plan: TracksPlan = plan_in(path, &assets)?;
    plan.check().map_err(|cause| Failure::start(format!("{}: {cause}", path.display())))?;
    let chain = run::plan(&as_run(args), &assets)?;
    let classifier = dispatch::init::<Classifier>(&chain, |params| dispatch::add_model(&chain, &assets, params))?;
    drop(dispatch::init::<Tracker>(&chain, |_| Ok(()))?);
    let params = dispatch::params::<Tracker>(&chain)?;
    let danger = params.danger;
    let danger =
        Danger { own_radius_m: danger.own_radius_m, horizon_s: danger.horizon_s, alert: danger.alert_probability };
    let recording = args.from.is_some().then(|| sources::open(&chain.source, &assets)).transpose()?;
    let out = args.out.as_deref().map(Out::open).transpose()?;

    let started_ns = clock::now_ns();
    // The stages are the chain's, whatever their files are called there.
    let read = |path: &str| match path.strip_prefix("stages/").and_then(|file| file.strip_suffix(".toml")) {
        Some(stage) if chain.parameters.contains_key(stage) => Ok(chain.parameters[stage].clone()),
        _ => assets.text(path).map_err(std::io::Error::other),
    };
    let judges = || -> Judge {
        let mut classifier = classifier.clone();
        Box::new(move |input: &Descriptors, output: &mut Detections| classifier.process(PART, input, output))
    };
    let followers = || -> Follower {
        // Each is made anew: what a copy keeps has no room to grow into. It was made once, so it can be again.
        let mut tracker = Tracker::init(params).ok();
        Box::new(move |part: Part, input: &Detections, output: &mut Tracks| {
            tracker.as_mut().map_or(Verdict::RejectedMalformed, |tracker| tracker.process(part, input, output))
        })
    };
    let note = || -> Result<TracksNote, Failure> {
        Ok(TracksNote {
            classifier: described(&chain)?,
            recording: args.from.as_ref().map(|from| from.display().to_string()),
            run: run_note(path, started_ns),
        })
    };
    let tell = |json: String, page: String, table: String, duration_s: f64| -> Result<(), Failure> {
        if let Some(out) = &out {
            out.write("tracks.json", &json)?;
            out.write("tracks.html", &page)?;
            eprintln!("the page is {}", out.0.join("tracks.html").display());
        }
        eprintln!("{duration_s:.0} s");
        crate::print(&if args.json { json } else { table })
    };

    if let Some(recording) = recording {
        let sweeps = chain.sweeps.unwrap_or(u64::MAX);
        let found = match recording {
            Opened::Scene(mut scene) => {
                UnknownTracks::measure(scene.as_mut(), sweeps, &plan, &read, &judges, &followers)
            }
            Opened::Recording(mut recording) => {
                UnknownTracks::measure(recording.as_mut(), sweeps, &plan, &read, &judges, &followers)
            }
            Opened::Live(_) => return Err(Failure::start("--from takes a recording, not a live sensor")),
        };
        let (found, note) = (found.map_err(Failure::run)?, note()?);
        return tell(found.to_json(&note), found.to_html(&note), found.to_string(), note.run.duration_s);
    }

    let mut say = |progress: &Progress| eprintln!("{progress}");
    let named = |cause: EvaluateError| match cause {
        EvaluateError::Rejected(_) | EvaluateError::Tracker(_) => Failure::run(cause),
        cause => Failure::start(format!("{}: {cause}", path.display())),
    };
    let clock = &clock::now_ns;
    let found = TrackEvaluation::measure(&plan, danger, &read, &judges, &followers, clock, &mut say).map_err(named)?;
    let note = note()?;
    tell(found.to_json(&note), found.to_html(&note), found.to_string(), note.run.duration_s)?;
    match found.short().join(", ") {
        short if short.is_empty() => Ok(()),
        short => Err(Failure::Failed(format!("bars that fall short: {short}"))),
    }
}
