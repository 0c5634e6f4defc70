//! Obstacles that come near: what was foreseen of them, and what happens.

use messages::Track;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use simulator::Obstacle;

use super::assignment::assign_within;
use super::calibration::ProbabilityTable;
use super::chase::{Chase, Rooms};
use super::courses::draw;
use super::frame::{Actual, distances, is_believed};
use super::plan::{EncountersPlan, TracksPlan};
use super::touch::nearest;
use crate::bars::quantile;
use crate::{EvaluateError, ObserveError, Share, View, parallel};

/// Returns from which no danger may be missed.
const SURE_RETURNS: u32 = 20;

/// Least returns of what is judged at all.
const LEAST_RETURNS: u32 = 5;

/// Scenes that one core looks at in a row.
const SCENES_A_JOB: u32 = 10;

/// What the tracker is configured to warn of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Danger {
    /// Radius of the own ball \[m\].
    pub own_radius_m: f64,
    /// How far it looks ahead \[s\].
    pub horizon_s: f64,
    /// Probability from which it warns.
    pub alert: f64,
}

/// One obstacle that comes near, as it is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// Its returns in the sweep in which it is judged.
    pub returns: u32,
    /// What was foreseen; none without a track that is believed.
    pub foreseen: Option<Foreseen>,
    /// How near its centre comes within the horizon \[m\].
    pub centre_m: f64,
    /// Whether its surface comes into the own ball within the horizon.
    pub touches: bool,
}

/// What a track says of its closest approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foreseen {
    /// Probability that it touches the own ball.
    pub probability: f64,
    /// Whether it is an alert: what a planner is told.
    pub alert: bool,
    /// Distance of its centre \[m\], and the standard deviation of that.
    pub distance_m: [f64; 2],
}

/// All encounters.
#[derive(Clone, Debug, PartialEq)]
pub struct Encounters {
    /// What was warned of.
    pub danger: Danger,
    /// One by one, in order of scenes.
    pub all: Vec<Encounter>,
}

impl Encounters {
    /// Runs every scene of the plan until its obstacles are judged, on all cores.
    pub(crate) fn measure(plan: &TracksPlan, danger: Danger, rooms: Rooms<'_>) -> Result<Self, EvaluateError> {
        let EncountersPlan { count, together, .. } = plan.encounters;
        let view = View::of(&plan.scene);
        let scenes = count.div_ceil(together);
        let jobs: Vec<u32> = (0..scenes).step_by(SCENES_A_JOB as usize).collect();
        let done = parallel::map(&jobs, |&first| -> Result<Vec<Encounter>, EvaluateError> {
            let mut chase = Chase::new(&view, rooms)?;
            let mut found = Vec::new();
            for number in first..(first + SCENES_A_JOB).min(scenes) {
                let many = together.min(count - number * together);
                found.extend(scene(&mut chase, plan, danger, plan.encounter_seed(number), many, rooms)?);
            }
            Ok(found)
        });
        let all = done.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        Ok(Self { danger, all })
    }

    /// Those with enough returns to be judged.
    fn judged(&self) -> impl Iterator<Item = &Encounter> {
        self.all.iter().filter(|one| one.returns >= LEAST_RETURNS)
    }

    /// Encounters of at least 5 returns with a track that is believed, of all of at least 5.
    pub fn tracked(&self) -> Share {
        Share::of(self.judged().map(|one| one.foreseen.is_some()))
    }

    /// Predicted probabilities of these beside what happened.
    pub fn table(&self) -> ProbabilityTable {
        ProbabilityTable::of(self.judged().filter_map(|one| Some((one.foreseen?.probability, one.touches))))
    }

    /// Those that touch and were not warned of, of those that touch; at least 20 returns, with a track or not.
    pub fn missed(&self) -> Share {
        self.unwarned(|one| one.touches)
    }

    /// The same of those whose centre comes into the own ball.
    pub fn missed_centres(&self) -> Share {
        self.unwarned(|one| one.centre_m < self.danger.own_radius_m)
    }

    fn unwarned(&self, is_dangerous: impl Fn(&Encounter) -> bool) -> Share {
        let dangerous = self.all.iter().filter(|one| one.returns >= SURE_RETURNS && is_dangerous(one));
        Share::of(dangerous.map(|one| one.foreseen.is_none_or(|track| !track.alert)))
    }

    /// Those warned of, of those that pass by; at least 20 returns.
    pub fn false_alerts(&self) -> Share {
        let harmless = self.all.iter().filter(|one| one.returns >= SURE_RETURNS && !one.touches);
        Share::of(harmless.map(|one| one.foreseen.is_some_and(|track| track.alert)))
    }

    /// Error of the closest distance of the centre, at least 20 returns: median and ninth decile \[m\], how many, and the
    /// share within two-sided 95 % of the claimed deviation; none without a track.
    pub fn distance_errors(&self) -> Option<([f64; 2], Share)> {
        let sure = self.all.iter().filter(|one| one.returns >= SURE_RETURNS);
        let errors: Vec<[f64; 2]> = sure
            .filter_map(|one| {
                let [distance_m, sigma_m] = one.foreseen?.distance_m;
                Some([(distance_m - one.centre_m).abs(), sigma_m])
            })
            .collect();
        let of = |at| quantile(errors.iter().map(|error| error[0]).collect(), at);
        let within = Share::of(errors.iter().map(|[error, sigma]| *error <= 1.959_964 * sigma));
        Some(([of(0.5)?, of(0.9)?], within))
    }
}

/// One scene until its obstacles are judged.
fn scene(
    chase: &mut Chase,
    plan: &TracksPlan,
    danger: Danger,
    seed: u64,
    together: u32,
    rooms: Rooms<'_>,
) -> Result<Vec<Encounter>, EvaluateError> {
    let mut simulator = chase.observer().simulator(seed)?;
    let obstacles = {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        draw(&simulator.scene().fields()[0], &plan.encounters, danger, together, &mut random)?
    };
    let refused = |cause: simulator::SceneError| ObserveError::new("encounters", cause);
    simulator.show(obstacles.clone()).map_err(refused)?;
    chase.begin(rooms);
    let period_s = simulator.period_ns() as f64 * 1e-9;
    let sweeps = (plan.encounters.track_s / period_s).round().max(1.0) as u64;
    for sweep in 0..sweeps - 1 {
        chase.step(&mut simulator, sweep)?;
    }
    let seen = chase.step(&mut simulator, sweeps - 1)?;
    let (time_s, looked) = (seen.table.time_ns as f64 * 1e-9, seen.looked());
    let actual: Vec<&Actual> = looked.actual.iter().collect();
    let tracks: Vec<_> = looked.tracks.iter().filter(|track| is_believed(track)).collect();
    let pairs = assign_within(&distances(&actual, &tracks), actual.len(), tracks.len(), plan.match_m);
    let of_obstacle = |(row, obstacle): (usize, &Obstacle)| {
        let nearest = nearest(obstacle, time_s, danger.horizon_s, danger.own_radius_m);
        let track = pairs.iter().find(|pair| pair.0 == row).map(|&(_, column)| tracks[column]);
        Encounter {
            returns: actual[row].returns,
            foreseen: track.map(|Track { approach, alert, .. }| Foreseen {
                probability: f64::from(approach.collision_probability),
                alert: *alert != 0,
                distance_m: [approach.distance_m, approach.distance_sigma_m].map(f64::from),
            }),
            centre_m: nearest.centre_m,
            touches: nearest.surface_m <= danger.own_radius_m,
        }
    };
    Ok(obstacles.iter().enumerate().map(of_obstacle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DANGER: Danger = Danger { own_radius_m: 1.0, horizon_s: 20.0, alert: 0.1 };

    #[test]
    fn a_danger_without_a_track_or_an_alert_is_missed() {
        let one = |returns, touches, probability: Option<f64>| Encounter {
            returns,
            // The tracker decides what is an alert: not the probability beside it.
            foreseen: probability.map(|probability| Foreseen {
                probability,
                alert: probability == 0.9 || probability == 0.5,
                distance_m: [2.0, 0.5],
            }),
            centre_m: if touches { 0.5 } else { 3.5 },
            touches,
        };
        let sut = Encounters {
            danger: DANGER,
            all: vec![
                one(20, true, Some(0.9)),
                one(20, true, Some(0.99)),
                one(30, true, None),
                one(19, true, None),
                one(4, true, None),
                one(20, false, Some(0.5)),
                one(90, false, Some(0.0)),
            ],
        };
        let share = |count, of| Share { count, of };
        assert_eq!((sut.missed(), sut.missed_centres(), sut.false_alerts()), (share(2, 3), share(2, 3), share(1, 2)));
        assert_eq!((sut.tracked(), sut.table().count()), (share(4, 6), 4));
        assert_eq!(sut.distance_errors(), Some(([1.5, 1.5], share(0, 4))));
    }
}
