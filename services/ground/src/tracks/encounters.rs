//! Obstacles that come near: what was foreseen of them, and what happens.

use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulator::{Field, Obstacle};

use super::assignment::assign_within;
use super::calibration::ProbabilityTable;
use super::chase::{Chase, Rooms};
use super::frame::{Actual, distances, is_believed};
use super::plan::{EncountersPlan, TracksPlan};
use super::touch::nearest;
use crate::bars::quantile;
use crate::{EvaluateError, ObserveError, Share, View, parallel};

/// Returns from which no danger may be missed.
const SURE_RETURNS: u32 = 20;

/// Least returns of what is judged at all.
const LEAST_RETURNS: u32 = 5;

/// Least gap between balls round two obstacles, and between them and the own ball, while they are looked at \[m\].
const APART_M: f64 = 1.0;

/// Courses tried for an obstacle.
const ATTEMPTS: u32 = 1_000;

/// Elevations between which centres lie while they are looked at \[rad\].
const ELEVATIONS_RAD: [f64; 2] = [-0.44, 0.12];

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
        Share::of(dangerous.map(|one| one.foreseen.is_none_or(|track| track.probability < self.danger.alert)))
    }

    /// Those warned of, of those that pass by; at least 20 returns.
    pub fn false_alerts(&self) -> Share {
        let harmless = self.all.iter().filter(|one| one.returns >= SURE_RETURNS && !one.touches);
        Share::of(harmless.map(|one| one.foreseen.is_some_and(|track| track.probability >= self.danger.alert)))
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
        let track = pairs.iter().find(|pair| pair.0 == row).map(|&(_, column)| tracks[column].approach);
        Encounter {
            returns: actual[row].returns,
            foreseen: track.map(|approach| Foreseen {
                probability: f64::from(approach.collision_probability),
                distance_m: [approach.distance_m, approach.distance_sigma_m].map(f64::from),
            }),
            centre_m: nearest.centre_m,
            touches: nearest.surface_m <= danger.own_radius_m,
        }
    };
    Ok(obstacles.iter().enumerate().map(of_obstacle).collect())
}

/// Obstacles of the field's distribution, each on a course of its own whose closest approach is `track_s + lead_s` after
/// the scene's start, far enough from each other and from the own ball while they are looked at.
fn draw(
    field: &Field,
    plan: &EncountersPlan,
    danger: Danger,
    together: u32,
    random: &mut ChaCha8Rng,
) -> Result<Vec<Obstacle>, ObserveError> {
    let mut obstacles: Vec<Obstacle> = Vec::new();
    for number in 0..together {
        let found = (0..ATTEMPTS).map(|_| course(field, plan, danger, [number, together], random)).find(|obstacle| {
            [0.0, 0.5, 1.0].into_iter().all(|share| {
                let time_s = share * plan.track_s;
                let place = |one: &Obstacle| one.motion.position_m + one.motion.velocity_mps * time_s;
                let (at, radius_m) = (place(obstacle), obstacle.body.bounding_radius_m());
                let elevation_rad = at.z.atan2(at.x.hypot(at.y));
                let is_apart = |other: &Obstacle| {
                    (place(other) - at).norm() >= radius_m + other.body.bounding_radius_m() + APART_M
                };
                (ELEVATIONS_RAD[0]..=ELEVATIONS_RAD[1]).contains(&elevation_rad)
                    && at.norm() >= radius_m + danger.own_radius_m + APART_M
                    && obstacles.iter().all(is_apart)
            })
        });
        let none = || ObserveError::new("encounters", format!("none of {ATTEMPTS} courses keeps clear of the others"));
        obstacles.push(found.ok_or_else(none)?);
    }
    Ok(obstacles)
}

/// One obstacle, from its own part of the horizon.
fn course(
    field: &Field,
    plan: &EncountersPlan,
    danger: Danger,
    [number, together]: [u32; 2],
    random: &mut ChaCha8Rng,
) -> Obstacle {
    let shape = field.shapes()[random.random_range(0..field.shapes().len())];
    let mut obstacle = field.draw(shape, random);
    let part_rad = std::f64::consts::TAU / f64::from(together);
    let azimuth_rad = part_rad * (f64::from(number) + random.random_range(0.25..0.75));
    // Along x to the sensor, past it in the plane of y and z, nearer to y; then turned to its own azimuth.
    let (steep_rad, side_rad): (f64, f64) = (random.random_range(-0.07..0.07), random.random_range(-0.35..0.35));
    let side = if random.random_range(0..2) == 0 { 1.0 } else { -1.0 };
    let from = Vector3::new(steep_rad.cos(), 0.0, steep_rad.sin());
    let up = Vector3::new(-steep_rad.sin(), 0.0, steep_rad.cos());
    let past = Vector3::y() * side * side_rad.cos() + up * side_rad.sin();
    let speed_mps = random.random_range(plan.speed_mps[0]..=plan.speed_mps[1]);
    let widest_m = danger.own_radius_m + obstacle.body.bounding_radius_m() + plan.beyond_m;
    let miss_m = random.random_range(0.0..=widest_m);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), azimuth_rad);
    obstacle.motion.velocity_mps = turn * from * -speed_mps;
    obstacle.motion.position_m = turn * (past * miss_m + from * speed_mps * (plan.track_s + plan.lead_s));
    obstacle
}

#[cfg(test)]
mod tests {
    use super::*;

    const DANGER: Danger = Danger { own_radius_m: 1.0, horizon_s: 20.0, alert: 0.1 };

    fn field() -> Field {
        let sensor: lidar::SensorFile =
            toml::from_str(include_str!("../../../../config/sensors/hdl-32e-paper.toml")).unwrap();
        let scene: simulator::SceneFile =
            toml::from_str(include_str!("../../../../config/scenes/reference-tumbling.toml")).unwrap();
        scene.checked(&sensor.checked().unwrap(), &Default::default()).unwrap().fields()[0].clone()
    }

    #[test]
    fn courses_are_nearest_when_they_should_be_and_about_half_of_them_touch() {
        let plan: TracksPlan = toml::from_str(include_str!("../../../../config/evaluation/tracks.toml")).unwrap();
        let plan = plan.encounters;
        let (field, mut touching, mut all) = (field(), 0, 0);
        for seed in 0..40 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            for obstacle in draw(&field, &plan, DANGER, 4, &mut random).unwrap() {
                let Obstacle { motion, .. } = &obstacle;
                let closest_s = -motion.position_m.dot(&motion.velocity_mps) / motion.velocity_mps.norm_squared();
                assert!((closest_s - plan.track_s - plan.lead_s).abs() < 1e-9, "{closest_s}");
                let speed_mps = motion.velocity_mps.norm();
                assert!((plan.speed_mps[0]..=plan.speed_mps[1]).contains(&speed_mps));
                let nearest = nearest(&obstacle, plan.track_s, 20.0, DANGER.own_radius_m);
                assert!((nearest.centre_m - motion.closest_approach_m()).abs() < 1e-9);
                touching += u32::from(nearest.surface_m <= DANGER.own_radius_m);
                all += 1;
            }
        }
        assert!(all == 160 && (40..110).contains(&touching), "{touching}");
    }

    #[test]
    fn a_danger_without_a_track_or_a_warning_is_missed() {
        let one = |returns, touches, probability: Option<f64>| Encounter {
            returns,
            foreseen: probability.map(|probability| Foreseen { probability, distance_m: [2.0, 0.5] }),
            centre_m: if touches { 0.5 } else { 3.5 },
            touches,
        };
        let sut = Encounters {
            danger: DANGER,
            all: vec![
                one(20, true, Some(0.9)),
                one(20, true, Some(0.09)),
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
