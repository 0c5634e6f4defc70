use nalgebra::{Matrix2, Matrix3, Vector3};

use super::motion::{Motion, about_first, frame, principal, root};
use super::normal::REACH;

/// Least standard deviation that is told from none [m].
const LEAST_SIGMA_M: f64 = 1e-6;

/// Relative motion as seen along the direction in which the obstacle would have to come, at the time τ at which it most
/// likely does. Vectors are in the encounter's axes: along that direction, then two across it in which the position,
/// given its place along, is uncorrelated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encounter {
    /// τ, seconds from now.
    pub(super) tau_s: f64,
    /// Mean place along the direction at τ [m].
    pub(super) along_m: f64,
    /// Its standard deviation [m].
    pub(super) along_sigma_m: f64,
    /// Mean place across at τ [m].
    pub(super) across_m: [f64; 2],
    /// What it changes for each metre along.
    pub(super) across_slope: [f64; 2],
    /// Standard deviation across, given the place along; the greater first [m].
    pub(super) across_sigma_m: [f64; 2],
    /// Mean velocity [m/s].
    pub(super) velocity_mps: Vector3<f64>,
    /// What the velocity changes for each metre along, and for each metre across beyond what the place along explains.
    pub(super) gain: [Vector3<f64>; 3],
    /// A square root of the covariance of what the position at τ leaves open of the velocity [m/s].
    pub(super) open_mps: Matrix3<f64>,
    /// Covariance of the velocity along, beyond what the place along explains [m²/s²].
    closing_variance: f64,
}

/// When the mean is nearest in standard deviations: least |p + t·v|² / (a + 2bt + ct²) in [0, horizon], with a, b and c
/// the mean variances of position, position and velocity, velocity.
fn likeliest_s(position: &Vector3<f64>, velocity: &Vector3<f64>, spread: [f64; 3], horizon_s: f64) -> f64 {
    let [a, b, c] = spread;
    let (pp, pv, vv) = (position.norm_squared(), position.dot(velocity), velocity.norm_squared());
    let value = |t: f64| (pp + 2.0 * pv * t + vv * t * t) / (a + 2.0 * b * t + c * t * t).max(1e-18);
    // Where the derivative vanishes: q2·t² + q1·t + q0 = 0, in a form that holds for q2 = 0.
    let (q2, q1, q0) = (vv * b - pv * c, vv * a - pp * c, pv * a - pp * b);
    let root = (q1 * q1 - 4.0 * q2 * q0).max(0.0).sqrt();
    let half = -0.5 * (q1 + if q1 < 0.0 { -root } else { root });
    let mut best = if value(horizon_s) < value(0.0) { horizon_s } else { 0.0 };
    for candidate in [q0 / half, half / q2] {
        if candidate > 0.0 && candidate < horizon_s && value(candidate) < value(best) {
            best = candidate;
        }
    }
    best
}

impl Encounter {
    /// At the likeliest time within the horizon, along the velocity that the obstacle would then have.
    pub(super) fn likeliest(motion: &Motion, horizon_s: f64) -> Self {
        let spread = [motion.pp.trace() / 3.0, motion.vp.trace() / 3.0, motion.vv.trace() / 3.0];
        let tau_s = likeliest_s(&motion.position, &motion.velocity, spread, horizon_s);
        let there = motion.position + motion.velocity * tau_s;
        // The mean velocity of those that pass the origin at τ, as if variances were the same in all directions.
        let variance = spread[0] + 2.0 * tau_s * spread[1] + tau_s * tau_s * spread[2];
        let meeting = motion.velocity - there * ((spread[1] + tau_s * spread[2]) / variance.max(1e-18));
        Self::new(motion, tau_s, if meeting.norm() > 1e-9 { meeting } else { -motion.position })
    }

    /// Now, along the line of sight.
    pub(super) fn now(motion: &Motion) -> Self {
        Self::new(motion, 0.0, -motion.position)
    }

    fn new(motion: &Motion, tau_s: f64, along: Vector3<f64>) -> Self {
        let Motion { pp, vp, vv, position, velocity } = motion;
        let there = position + velocity * tau_s;
        let mut axes = frame(&along.try_normalize(1e-9).unwrap_or_else(Vector3::x));

        let at_tau = pp + (vp + vp.transpose()) * tau_s + vv * (tau_s * tau_s);
        let mixed = vp + vv * tau_s;
        let local = axes * at_tau * axes.transpose();
        let along_variance = local[(0, 0)].max(LEAST_SIGMA_M * LEAST_SIGMA_M);
        let rest = Matrix2::from_fn(|row, column| {
            local[(row + 1, column + 1)] - local[(row + 1, 0)] * local[(0, column + 1)] / along_variance
        });
        axes = about_first(&rest) * axes;
        let across_sigma_m = principal(&rest).map(|variance| variance.max(0.0).sqrt().max(LEAST_SIGMA_M));

        let local = axes * at_tau * axes.transpose();
        let mixed = axes * mixed * axes.transpose();
        let across_slope = [local[(1, 0)] / along_variance, local[(2, 0)] / along_variance];
        let mut gain = [mixed.column(0) / along_variance, Vector3::zeros(), Vector3::zeros()];
        let mut open = axes * vv * axes.transpose() - gain[0] * gain[0].transpose() * along_variance;
        let closing_variance = open[(0, 0)].max(0.0);
        for axis in 0..2 {
            let variance = across_sigma_m[axis] * across_sigma_m[axis];
            gain[axis + 1] = (mixed.column(axis + 1) - mixed.column(0) * across_slope[axis]) / variance;
            open -= gain[axis + 1] * gain[axis + 1].transpose() * variance;
        }
        let mean = axes * there;
        Self {
            tau_s,
            along_m: mean.x,
            along_sigma_m: along_variance.sqrt(),
            across_m: [mean.y, mean.z],
            across_slope,
            across_sigma_m,
            velocity_mps: axes * velocity,
            gain,
            open_mps: root(&open),
            closing_variance,
        }
    }

    /// Between which places along, in standard deviations about the mean, paths can come within `touch_m` at all.
    ///
    /// A path that is farther than that on the same side now and at the horizon does not.
    pub(super) fn range(&self, touch_m: f64, horizon_s: f64) -> (f64, f64) {
        let (mut low, mut high) = (REACH, -REACH);
        for time_s in [-self.tau_s, horizon_s - self.tau_s] {
            // Place along then, of a path that is `along` at τ: a line.
            let slope = 1.0 + time_s * self.gain[0].x;
            let mean = self.along_m + time_s * self.velocity_mps.x;
            let slack = touch_m + REACH * time_s.abs() * self.closing_variance.sqrt();
            let scale = slope * self.along_sigma_m;
            if scale <= 1e-12 {
                let near = mean.abs() <= slack + scale.abs() * REACH;
                (low, high) = if near || slope < 0.0 {
                    (-REACH, REACH)
                } else if mean > 0.0 {
                    (-REACH, high)
                } else {
                    (low, REACH)
                };
                continue;
            }
            low = low.min((-slack - mean) / scale);
            high = high.max((slack - mean) / scale);
        }
        (low.max(-REACH), high.min(REACH))
    }
}
