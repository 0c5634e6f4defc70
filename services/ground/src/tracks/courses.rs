//! Courses past the sensor, and into it.

use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use simulator::{Field, Obstacle};

use super::encounters::Danger;
use super::plan::EncountersPlan;
use crate::ObserveError;

/// Least gap between balls round two obstacles, and between them and the own ball, while they are looked at \[m\].
const APART_M: f64 = 1.0;

/// Courses tried for an obstacle.
const ATTEMPTS: u32 = 1_000;

/// Elevations between which centres lie while they are looked at \[rad\].
const ELEVATIONS_RAD: [f64; 2] = [-0.44, 0.12];

/// Obstacles of the field's distribution, each on a course of its own whose closest approach is `track_s + lead_s` after
/// the scene's start, far enough from each other and from the own ball while they are looked at.
pub(crate) fn draw(
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
    use rand::SeedableRng;

    use super::super::plan::TracksPlan;
    use super::super::touch::nearest;
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
}
