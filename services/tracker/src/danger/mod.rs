//! How near an obstacle comes, and how likely it is touched.
//!
//! Both craft and obstacle move on straight lines; where and how fast is known up to a normal distribution. Conjunction
//! analysis (Foster and Estes 1992; Alfano 2005; Chan 2008) takes the velocity for known and integrates over the plane
//! across it. Here velocities are slow and uncertain, so that an obstacle may come from its place in any direction or not
//! at all (as in Coppola 2012), and both have to be integrated over. Without allocation, at a bounded number of nodes.

mod contact;
mod ellipse;
mod encounter;
mod motion;
mod near;
mod normal;
mod passing;
#[cfg(test)]
mod passing_tests;
mod paths;
mod spread;
mod surface;
#[cfg(test)]
mod tests;
mod touch;

use encounter::Encounter;
use messages::ClosestApproach;
use motion::Motion;
use nalgebra::{Matrix6, Vector3};
pub use passing::Body;
pub use touch::{Touch, touch};

/// Probability of touching at once from which on the obstacle is near by: what its velocity adds is then seen from where
/// it is, and not from where it would touch.
const NEAR: f64 = 0.05;

/// What is said of what is not a number: the worst, so that it is looked at.
const WORST: ClosestApproach =
    ClosestApproach { time_s: 0.0, distance_m: 0.0, distance_sigma_m: 0.0, collision_probability: 1.0 };

/// How near an obstacle comes to the own craft between now and the horizon, if both go on as they do.
///
/// Position and velocity are the obstacle's relative to the own craft, in any axes, with their joint covariance, which may
/// be singular (variances below 0 count as 0). `touch_m` is the distance between centres at which the two touch
/// ([`touch`]); where it is uncertain, give the covariance of [`Touch::widened`]. A horizon below 0 is one of 0.
///
/// Time and distance are those of the mean motion. The deviation is the root mean square of what the least distance of
/// every possible motion, at its own time, differs from that distance. The probability is that of touching at any time
/// within the horizon; the note of this room says how near it is to the exact one. Where an argument is not finite, the
/// probability is 1 and all else is 0.
pub fn closest_approach(
    position_m: &Vector3<f64>,
    velocity_mps: &Vector3<f64>,
    covariance: &Matrix6<f64>,
    touch_m: f64,
    horizon_s: f64,
) -> ClosestApproach {
    let mut numbers =
        position_m.iter().chain(velocity_mps.iter()).chain(covariance.iter()).chain([&touch_m, &horizon_s]);
    if !numbers.all(|number| number.is_finite()) {
        return WORST;
    }
    let horizon_s = horizon_s.max(0.0);
    let time_s = paths::nearest_s(position_m, velocity_mps, 0.0, horizon_s);
    let distance_m = (position_m + velocity_mps * time_s).norm();
    let motion = Motion::new(position_m, velocity_mps, covariance);
    let found = ClosestApproach {
        time_s: time_s as f32,
        distance_m: distance_m as f32,
        distance_sigma_m: spread::deviation_m(position_m, velocity_mps, covariance, horizon_s, distance_m) as f32,
        collision_probability: probability(&motion, touch_m, horizon_s) as f32,
    };
    // Numbers too large to be squared.
    let answers = [found.time_s, found.distance_m, found.distance_sigma_m, found.collision_probability];
    if answers.iter().all(|number| number.is_finite()) { found } else { WORST }
}

/// The same of a body that turns while it passes: what its attitude is by then tells at what distance the two touch.
///
/// Time, distance and deviation are those of [`closest_approach`] with the size's doubt in the covariance; the probability
/// is that of the body's own surface coming within `own_radius_m`.
pub fn foresee(
    position_m: &Vector3<f64>,
    velocity_mps: &Vector3<f64>,
    covariance: &Matrix6<f64>,
    body: &Body,
    own_radius_m: f64,
    horizon_s: f64,
) -> ClosestApproach {
    let all = touch(own_radius_m, body.class, body.size_m, body.size_sigma_m);
    let found = closest_approach(position_m, velocity_mps, &all.widened(covariance), all.tumbling_m, horizon_s);
    if found == WORST {
        return WORST;
    }
    let passing = body.passing(own_radius_m, position_m, velocity_mps, &found, horizon_s);
    if passing == all || !(passing.tumbling_m.is_finite() && passing.sigma_m.is_finite()) {
        return found;
    }
    let motion = Motion::new(position_m, velocity_mps, &passing.widened(covariance));
    let collision_probability = probability(&motion, passing.tumbling_m, horizon_s) as f32;
    if collision_probability.is_finite() { ClosestApproach { collision_probability, ..found } } else { found }
}

/// Probability of touching between now and the horizon.
fn probability(motion: &Motion, touch_m: f64, horizon_s: f64) -> f64 {
    if touch_m <= 0.0 || motion.is_beyond(touch_m, horizon_s) {
        return 0.0;
    }
    let now = Encounter::now(motion);
    let at_once = near::touching(&now, touch_m);
    if horizon_s == 0.0 {
        at_once
    } else if at_once > NEAR {
        near::probability(&now, at_once, touch_m, horizon_s)
    } else {
        contact::probability(&Encounter::likeliest(motion, horizon_s), touch_m, horizon_s).max(at_once)
    }
}
