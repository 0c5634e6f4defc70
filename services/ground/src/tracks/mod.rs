//! Tracks against truth, on scenes in motion; and what can be said of them where no truth is known.

mod assignment;
mod bars;
mod bodies;
mod calibration;
mod chase;
mod classes;
mod clear_mot;
mod confirming;
mod consistency;
mod cost;
mod courses;
mod encounters;
mod errors;
mod frame;
#[cfg(test)]
mod golden;
mod hardest;
mod hota;
mod identity;
mod json;
mod page;
mod page_plots;
mod pair;
mod plan;
mod scores;
mod table;
#[cfg(test)]
mod tests;
mod touch;
mod trails;
mod unknown;
mod unknown_page;

use stage::Source;

pub use bodies::Bodies;
pub use calibration::{PROBABILITY_BINS, ProbabilityBin, ProbabilityTable};
pub use chase::{Follower, Followers};
pub use classes::Classes;
pub use clear_mot::ClearMot;
pub use confirming::Confirming;
pub use consistency::{Consistency, Nees};
pub use cost::TrackerTime;
pub use encounters::{Danger, Encounter, Encounters, Foreseen};
pub use errors::{RootMeanSquare, TrackErrors};
pub use hardest::HardObstacle;
pub use hota::{ALPHAS, Hota};
pub use identity::Identity;
pub use json::TracksNote;
pub use plan::{CostPlan, EncountersPlan, TracksPlan};
pub use scores::{Followed, TrackScores};
pub use unknown::UnknownTracks;

use crate::{Bar, Clock, EvaluateError, Files, Judges, Observer, Progress, Standing, View, parallel};
use bars::BARS;
use chase::{Chase, Rooms};
use frame::Looked;
use scores::LEAST_RETURNS;
use trails::Trails;

/// All that was measured of tracks.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackEvaluation {
    /// What was looked at.
    pub plan: TracksPlan,
    /// Time from sweep to sweep \[s\].
    pub period_s: f64,
    /// Tracks against truth.
    pub scores: TrackScores,
    /// Closest approaches, foreseen and true.
    pub encounters: Encounters,
    /// What the tracker takes.
    pub time: TrackerTime,
    /// Courses of the first scene.
    trails: Trails,
}

impl TrackEvaluation {
    /// Measures the tracker that `followers` makes, behind the classifiers that `judges` makes, on all cores, and its time
    /// on one. The same plan, files and rooms give the same results, but for times.
    ///
    /// # Errors
    /// A plan or a file that does not hold, or a room that does not take what the one before it gives.
    pub fn measure(
        plan: &TracksPlan,
        danger: Danger,
        read: Files<'_>,
        judges: Judges<'_>,
        followers: Followers<'_>,
        clock: Clock<'_>,
        progress: &mut dyn FnMut(&Progress),
    ) -> Result<Self, EvaluateError> {
        plan.check()?;
        let (lead_s, horizon_s) = (plan.encounters.lead_s, danger.horizon_s);
        if plan.encounters.count > 0 && horizon_s < lead_s {
            return Err(EvaluateError::Horizon { lead_s, horizon_s });
        }
        let (rooms, view) = (Rooms { read, judges, followers }, View::of(&plan.scene));
        // What cannot be seen is known before any work.
        let period_s = Observer::new(&view, &read)?.simulator(plan.scene_seed(0))?.period_ns() as f64 * 1e-9;
        let mut say = |line: String| progress(&Progress(line));
        say(format!("{}: {} scenes of {} sweeps", plan.scene, plan.scenes, plan.sweeps));
        let numbers: Vec<u32> = (0..plan.scenes).collect();
        let done = parallel::map(&numbers, |&number| -> Result<(TrackScores, Trails), EvaluateError> {
            let sweeps = scene(plan, number, &view, rooms)?;
            let trails = match number {
                0 => Trails::of(&sweeps, LEAST_RETURNS, plan.match_m),
                _ => Trails::default(),
            };
            Ok((TrackScores::of(&sweeps, plan, number), trails))
        });
        let (mut scores, mut trails) = (TrackScores::default(), None);
        for scene in done {
            let (of_scene, of_trails) = scene?;
            scores.add(&of_scene);
            trails.get_or_insert(of_trails);
        }
        say(format!("{} encounters, {} in a scene", plan.encounters.count, plan.encounters.together));
        let encounters = Encounters::measure(plan, danger, rooms)?;
        say("timing the tracker".to_owned());
        let time = TrackerTime::measure(plan, rooms, clock)?;
        Ok(Self { plan: plan.clone(), period_s, scores, encounters, time, trails: trails.unwrap_or_default() })
    }

    /// Every bar, judged or not.
    pub fn bars(&self) -> Vec<Bar> {
        BARS.iter().map(|definition| definition.bar(self, &self.plan.bars)).collect()
    }

    /// Keys of the bars that fall short.
    pub fn short(&self) -> Vec<&'static str> {
        let short = |bar: &Bar| bar.standing() == Standing::FallsShort;
        self.bars().iter().filter(|bar| short(bar)).map(|bar| bar.key).collect()
    }

    /// Sweeps in some time, to the nearest.
    pub(crate) fn sweeps_in(&self, time_s: f64) -> usize {
        (time_s / self.period_s).round() as usize
    }
}

impl UnknownTracks {
    /// Follows a recording's sweeps to its end, at most `sweeps` of them, with the stages that `read` gives; `plan` only
    /// lends its scene, which lends the stages.
    ///
    /// # Errors
    /// A source that fails, or a classifier that rejects.
    pub fn measure(
        source: &mut impl Source,
        sweeps: u64,
        plan: &TracksPlan,
        read: Files<'_>,
        judges: Judges<'_>,
        followers: Followers<'_>,
    ) -> Result<Self, EvaluateError> {
        Self::of(source, sweeps, &plan.scene, Rooms { read, judges, followers })
    }
}

/// Every sweep of one scene, looked at and followed.
fn scene(plan: &TracksPlan, number: u32, view: &View, rooms: Rooms<'_>) -> Result<Vec<Looked>, EvaluateError> {
    let mut chase = Chase::new(view, rooms)?;
    let mut simulator = chase.observer().simulator(plan.scene_seed(number))?;
    (0..plan.sweeps).map(|sweep| Ok(chase.step(&mut simulator, sweep.into())?.looked())).collect()
}
