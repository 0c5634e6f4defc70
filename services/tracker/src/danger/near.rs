use nalgebra::{Matrix2, Matrix3, Vector3};

use super::ellipse::ellipse;
use super::encounter::Encounter;
use super::motion::{about_first, frame, principal};
use super::normal::{REACH, nodes, share};

/// Least standard deviation of a speed that is told from none [m/s].
const LEAST_SIGMA_MPS: f64 = 1e-7;
/// Points of two standard normal numbers, one for each node of the place along.
const ASIDE: [[f64; 2]; 10] = [
    [-0.7784, -0.4814],
    [0.4302, 0.7801],
    [1.9956, -0.8480],
    [-0.2528, -0.0183],
    [-0.4743, -0.9984],
    [0.8372, 0.6543],
    [0.2217, -0.1745],
    [-1.7134, 1.4446],
    [-1.1176, -2.1967],
    [0.0549, 0.2694],
];

/// Probability that the obstacle touches now.
pub(super) fn touching(now: &Encounter, touch_m: f64) -> f64 {
    let low = ((-touch_m - now.along_m) / now.along_sigma_m).max(-REACH);
    let high = ((touch_m - now.along_m) / now.along_sigma_m).min(REACH);
    if low >= high {
        return 0.0;
    }
    let mut sum = 0.0;
    for (z, weight) in nodes(low, high) {
        let beyond = z * now.along_sigma_m;
        let along = now.along_m + beyond;
        let radius = (touch_m * touch_m - along * along).max(0.0).sqrt();
        let mean = [0, 1].map(|axis| now.across_m[axis] + now.across_slope[axis] * beyond);
        if radius > 0.0 {
            sum += weight * ellipse([0.0; 2], [radius; 2], mean, now.across_sigma_m);
        }
    }
    sum.min(1.0)
}

/// Probability that an obstacle near by touches within the horizon: it does now, or its velocity lies in the cone under
/// which the sphere is seen from where it is. `at_once` is [`touching`], the horizon more than 0.
pub(super) fn probability(now: &Encounter, at_once: f64, touch_m: f64, horizon_s: f64) -> f64 {
    // Places outside, seen along the line of sight; the obstacle comes from the negative side.
    let low = ((touch_m + now.along_m) / now.along_sigma_m).max(-REACH);
    let rest = 1.0 - at_once;
    if rest <= 0.0 || low >= REACH {
        return at_once;
    }
    let covariance = now.open_mps * now.open_mps.transpose();
    let mut sum = 0.0;
    for ((z, weight), aside) in nodes(low, REACH).into_iter().zip(ASIDE) {
        let beyond = -z * now.along_sigma_m;
        let across = [0, 1].map(|axis| aside[axis] * now.across_sigma_m[axis]);
        let place = Vector3::new(
            now.along_m + beyond,
            now.across_m[0] + now.across_slope[0] * beyond + across[0],
            now.across_m[1] + now.across_slope[1] * beyond + across[1],
        );
        let velocity = now.velocity_mps + now.gain[0] * beyond + now.gain[1] * across[0] + now.gain[2] * across[1];
        sum += weight * cone(&place, &velocity, &covariance, touch_m, horizon_s);
    }
    (at_once + rest * sum / share(low, REACH)).min(1.0)
}

/// Probability that a velocity takes a point outside the sphere into it within the horizon: the velocity obstacle of
/// Fiorini and Shiller (1998) under a normal distribution, in slices across the line of sight.
fn cone(place: &Vector3<f64>, velocity: &Vector3<f64>, covariance: &Matrix3<f64>, touch_m: f64, horizon_s: f64) -> f64 {
    let distance = place.norm().max(touch_m * (1.0 + 1e-9));
    let axes = frame(&(-place / place.norm().max(1e-12)));
    let local = axes * covariance * axes.transpose();
    let variance = local[(0, 0)].max(LEAST_SIGMA_MPS * LEAST_SIGMA_MPS);
    let sigma = variance.sqrt();
    let rest = Matrix2::from_fn(|row, column| {
        local[(row + 1, column + 1)] - local[(row + 1, 0)] * local[(0, column + 1)] / variance
    });
    let turn = about_first(&rest);
    let slope = turn * local.column(0) / variance;
    let mean = turn * axes * velocity;
    let across_sigma = principal(&rest).map(|variance| variance.max(0.0).sqrt().max(LEAST_SIGMA_MPS));
    let low = (((distance - touch_m) / horizon_s - mean.x) / sigma).max(-REACH);
    if low >= REACH {
        return 0.0;
    }
    // Tangents from the place touch the sphere at this depth, at this slope.
    let tangent = distance * distance - touch_m * touch_m;
    let (depth, opening) = (tangent / distance, touch_m / tangent.sqrt());
    let mut sum = 0.0;
    for (z, weight) in nodes(low, REACH) {
        let closing = mean.x + z * sigma;
        let reached = closing * horizon_s;
        let radius = if reached >= depth {
            closing * opening
        } else {
            let short = distance - reached;
            (touch_m * touch_m - short * short).max(0.0).sqrt() / horizon_s
        };
        if radius > 0.0 {
            let across = [1, 2].map(|axis| mean[axis] + slope[axis] * z * sigma);
            sum += weight * ellipse([0.0; 2], [radius; 2], across, across_sigma);
        }
    }
    sum
}
