use nalgebra::Vector3;

use super::ellipse::ellipse;
use super::encounter::Encounter;
use super::normal::{REACH, nodes};
use super::paths::Paths;

/// Probability that the path comes within `touch_m` of the origin between now and the horizon.
pub(super) fn probability(encounter: &Encounter, touch_m: f64, horizon_s: f64) -> f64 {
    let (low, high) = encounter.range(touch_m, horizon_s);
    if low >= high {
        return 0.0;
    }
    let slices = nodes(low, high).into_iter();
    let sum: f64 =
        slices.map(|(z, weight)| weight * slice(encounter, z * encounter.along_sigma_m, touch_m, horizon_s)).sum();
    sum.min(1.0)
}

/// The same, given that the place along differs by `beyond_m` from its mean at τ.
///
/// The velocity is the mean one of each place: what the place at τ leaves open of it changes little (drawing from it made
/// no difference of 0.001 in the root mean square).
fn slice(encounter: &Encounter, beyond_m: f64, touch_m: f64, horizon_s: f64) -> f64 {
    let mean = [0, 1].map(|axis| encounter.across_m[axis] + encounter.across_slope[axis] * beyond_m);
    let velocity = encounter.velocity_mps + encounter.gain[0] * beyond_m;
    let line = |axis: usize, through: [f64; 2]| {
        let mut point_step = Vector3::zeros();
        point_step[axis + 1] = 1.0;
        let [one, other] = [0, 1].map(|axis| encounter.gain[axis + 1] * (through[axis] - mean[axis]));
        Paths {
            point_m: Vector3::new(encounter.along_m + beyond_m, through[0], through[1]),
            point_step,
            velocity_mps: velocity + one + other,
            velocity_step: encounter.gain[axis + 1],
            first_s: -encounter.tau_s,
            last_s: horizon_s - encounter.tau_s,
        }
    };
    // The places across from which paths come within reach make about an ellipse. Its chords are looked for where there is
    // probability: far from the mean, velocities that go with a place are no ones to expect.
    let window = |axis: usize, place: f64| {
        let reach = REACH * encounter.across_sigma_m[axis];
        place.clamp(mean[axis] - reach, mean[axis] + reach)
    };
    let through = [window(0, 0.0), window(1, 0.0)];
    let first = window(0, through[0] + line(0, through).middle());
    let second = line(1, [first, through[1]]);
    let middle = second.middle();
    let Some((low, high)) = second.within(middle, touch_m) else { return 0.0 };
    let (second_m, second_half_m) = (through[1] + 0.5 * (low + high), 0.5 * (high - low));
    let second = window(1, second_m);
    let Some((low, high)) = line(0, [first, second]).within(0.0, touch_m) else { return 0.0 };
    let (first_m, first_half_m) = (first + 0.5 * (low + high), 0.5 * (high - low));
    let half = half_axes([first_half_m, second_half_m], [first - first_m, second - second_m]);
    ellipse([first_m, second_m], half, mean, encounter.across_sigma_m)
}

/// Half axes of the ellipse that has these half chords: the first passes its centre at a distance of `beside[1]`, the
/// second at a distance of `beside[0]`.
fn half_axes(chords: [f64; 2], beside: [f64; 2]) -> [f64; 2] {
    let squares = [0, 1].map(|axis| chords[axis] * chords[axis] - beside[axis] * beside[axis]);
    if squares[0] <= 0.0 || squares[1] <= 0.0 {
        return chords;
    }
    let ratio = squares[0] / squares[1];
    [
        (chords[0] * chords[0] + ratio * beside[1] * beside[1]).sqrt(),
        (chords[1] * chords[1] + beside[0] * beside[0] / ratio).sqrt(),
    ]
}
