use lidar::ObstacleClass;
use messages::ClosestApproach;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::motion::root;
use super::surface::{distance_m, inner_m};
use super::touch::{Touch, touch};

/// Standard deviations of the miss within which it is open whether the two touch.
const OPEN: f64 = 5.0;
/// What the body turns by, and how far it moves, from one look to the next, and how many looks there are.
const TURN_RAD: f64 = 0.3;
const MOVE_M: f64 = 0.5;
const LOOKS: [f64; 2] = [6.0, 32.0];
/// Rounds in which the distance of touch is found, and what is near enough [m].
const ROUNDS: usize = 5;
const CLOSE_M: f64 = 0.004;
/// The same where it is one of several.
const ROUGHLY_M: f64 = 0.02;
/// Least change of the gap that is believed, for a metre aside.
const LEAST_SLOPE: f64 = 0.3;
/// Doubt about the turn until the passing below which one attitude stands for all [rad].
const SURE_RAD: f64 = 0.005;
/// Half of 14 points of a standard normal distribution in three dimensions; the others are their opposites. Their covariance
/// is the unit matrix (of 200,000 drawn sets, whitened, the best by fourth moments and by how the numbers of an axis spread).
const POINTS: [[f64; 3]; 7] = [
    [-1.3056, -1.3280, 1.3902],
    [0.8694, 0.2349, 0.7593],
    [-1.9040, 0.6610, 0.0481],
    [-0.7315, 0.0652, -1.8197],
    [0.4279, -0.5664, -0.5119],
    [0.2919, 0.8562, 0.8823],
    [0.3330, -1.9200, -0.3696],
];

/// An obstacle that turns while it passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// What it is; of a class that is not known it is a box.
    pub class: ObstacleClass,
    /// Full extents along its own axes [m].
    pub size_m: [f64; 3],
    /// Their standard deviations [m].
    pub size_sigma_m: [f64; 3],
    /// Rotation from its axes to those of position and velocity, now.
    pub attitude: UnitQuaternion<f64>,
    /// How it turns from now on, in the axes of position and velocity [rad/s].
    pub spin_radps: Vector3<f64>,
    /// Covariance of that [rad²/s²].
    pub spin_covariance: Matrix3<f64>,
    /// What each of its components wanders by in a second [rad/s]; grows with the root of time.
    pub spin_wander_radps: f64,
}

/// A course that is the mean one but for how far it passes: beside by a distance, at a known velocity.
struct Course<'a> {
    body: &'a Body,
    own_radius_m: f64,
    /// Unit vector from the own craft to where the mean one is nearest.
    aside: Vector3<f64>,
    velocity_mps: Vector3<f64>,
    /// When the mean one is nearest [s].
    time_s: f64,
    /// Between which times contact is possible [s].
    between_s: [f64; 2],
}

impl Body {
    /// At what distance the middle of the body touches a craft that it passes as `seen`: what [`touch`] says of all
    /// attitudes, but `tumbling_m` and `sigma_m` for those in which it may be when it passes.
    ///
    /// [`touch`] itself where that makes no difference, since the body surely comes nearer than its narrowest side or stays
    /// beyond its longest; ever more of it the worse the miss is known, and all of it from a deviation of the body's half
    /// diagonal on.
    pub(super) fn passing(
        &self,
        own_radius_m: f64,
        position_m: &Vector3<f64>,
        velocity_mps: &Vector3<f64>,
        seen: &ClosestApproach,
        horizon_s: f64,
    ) -> Touch {
        let all = touch(own_radius_m, self.class, self.size_m, self.size_sigma_m);
        let [time_s, distance_m, sigma_m] = [seen.time_s, seen.distance_m, seen.distance_sigma_m].map(f64::from);
        let narrow_m = own_radius_m + inner_m(self.class, &self.size_m);
        let is_open = distance_m + OPEN * sigma_m > narrow_m && distance_m < all.bounding_m + OPEN * sigma_m;
        // What is known of the miss as against the body's size.
        let known = 1.0 - (sigma_m / (all.bounding_m - own_radius_m).max(1e-9)).powi(2);
        let Some(aside) = (position_m + velocity_mps * time_s).try_normalize(1e-6) else { return all };
        if !is_open || known <= 0.0 {
            return all;
        }
        // Elsewhere the sphere about the body does not touch, even as near as it may pass.
        let half_m = (all.bounding_m * all.bounding_m - narrow_m * narrow_m).max(0.0).sqrt();
        let half_s = half_m / velocity_mps.norm().max(1e-3);
        let course = Course {
            body: self,
            own_radius_m,
            aside,
            velocity_mps: *velocity_mps,
            time_s,
            between_s: [(time_s - half_s).max(0.0), (time_s + half_s).min(horizon_s.max(time_s))],
        };
        let (mean_m, spread_m) = course.over_spins(all.tumbling_m);
        Touch {
            tumbling_m: all.tumbling_m + known * (mean_m - all.tumbling_m),
            sigma_m: all.sigma_m.hypot(known * spread_m),
            ..all
        }
    }
}

impl Course<'_> {
    /// Mean and standard deviation of the distance of touch over what the spin may be [m].
    fn over_spins(&self, guess_m: f64) -> (f64, f64) {
        let Body { spin_radps, spin_covariance, spin_wander_radps, .. } = self.body;
        let wander = spin_wander_radps * spin_wander_radps * self.time_s / 3.0;
        let covariance = spin_covariance + Matrix3::from_diagonal_element(wander);
        if covariance.trace().max(0.0).sqrt() * self.between_s[1] < SURE_RAD {
            return (self.touch_m(spin_radps, guess_m, CLOSE_M), 0.0);
        }
        let root = root(&covariance);
        let (mut sum, mut squares) = (0.0, 0.0);
        for point in POINTS {
            let beside = root * Vector3::from(point);
            for spin_radps in [spin_radps + beside, spin_radps - beside] {
                let touch_m = self.touch_m(&spin_radps, guess_m, ROUGHLY_M);
                sum += touch_m;
                squares += touch_m * touch_m;
            }
        }
        let count = 2.0 * POINTS.len() as f64;
        let mean_m = sum / count;
        (mean_m, (squares / count - mean_m * mean_m).max(0.0).sqrt())
    }

    /// How far beside the own craft the body passes that just touches, to `close_m` of gap, if it turns like this [m].
    fn touch_m(&self, spin_radps: &Vector3<f64>, guess_m: f64, close_m: f64) -> f64 {
        let (mut beside_m, mut before) = (guess_m, None);
        for _ in 0..ROUNDS {
            let gap_m = self.least_m(spin_radps, beside_m) - self.own_radius_m;
            if gap_m.abs() < close_m {
                break;
            }
            // The secant; a metre aside is a metre of gap where the surface lies straight beside, and less elsewhere.
            let slope =
                before.map_or(1.0, |(at_m, gap_before_m): (f64, f64)| (gap_m - gap_before_m) / (beside_m - at_m));
            before = Some((beside_m, gap_m));
            beside_m -= gap_m / slope.clamp(LEAST_SLOPE, 1.0);
        }
        beside_m
    }

    /// The least distance of the body that passes this far beside [m]: looked at in steps, a parabola through the least.
    fn least_m(&self, spin_radps: &Vector3<f64>, beside_m: f64) -> f64 {
        let [from_s, to_s] = self.between_s;
        let time_s = to_s - from_s;
        let steps = (time_s * spin_radps.norm() / TURN_RAD).max(time_s * self.velocity_mps.norm() / MOVE_M);
        let steps = steps.clamp(LOOKS[0], LOOKS[1]).ceil();
        let step_s = time_s / steps;
        let turn = Rotation3::from_scaled_axis(spin_radps * step_s);
        let mut attitude = Rotation3::from_scaled_axis(spin_radps * from_s) * self.body.attitude.to_rotation_matrix();
        let mut place = self.aside * beside_m + self.velocity_mps * (from_s - self.time_s);
        let mut last = [f64::INFINITY; 2];
        let mut least = f64::INFINITY;
        for _ in 0..=steps as usize {
            let own = attitude.inverse_transform_vector(&-place);
            let distance_m = distance_m(self.body.class, &self.body.size_m, &own);
            least = least.min(distance_m).min(lowest(last[0], last[1], distance_m));
            last = [last[1], distance_m];
            attitude = turn * attitude;
            place += self.velocity_mps * step_s;
        }
        least
    }
}

/// The least of the parabola through three values at equal steps, where that is about the middle one; else the middle one.
fn lowest(before: f64, middle: f64, after: f64) -> f64 {
    let bend = before - 2.0 * middle + after;
    if !bend.is_finite() || middle > before || middle > after || bend <= 0.0 {
        return middle;
    }
    (middle - (after - before).powi(2) / (8.0 * bend)).max(0.0)
}
