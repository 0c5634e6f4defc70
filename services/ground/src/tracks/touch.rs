//! How far a body's surface is from a point, and from the sensor on its course.

use nalgebra::Vector3;
use simulator::{Body, Obstacle, Shape};

/// Step in which a course near the sensor is looked at \[s\]: at 1 m/s a centimetre.
const STEP_S: f64 = 0.01;

/// No course here leaves a scene.
const FAR_M: f64 = 1e6;

/// Halvings in the search for an ellipsoid's nearest point: beyond the resolution of a double.
const HALVINGS: u32 = 80;

/// How near an obstacle comes to the sensor within some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// Least distance of its centre \[m\].
    pub(crate) centre_m: f64,
    /// Least distance of its surface \[m\], 0 inside; `INFINITY` where it stays farther than `near_m` for sure.
    pub(crate) surface_m: f64,
}

/// The nearest that an obstacle comes from `from_s` to `from_s + horizon_s`. Its surface is looked at where it may be
/// within `near_m` of the sensor.
pub(crate) fn nearest(obstacle: &Obstacle, from_s: f64, horizon_s: f64, near_m: f64) -> Nearest {
    let motion = &obstacle.motion;
    let centre_m = |time_s: f64| motion.position_m + motion.velocity_mps * time_s;
    let speed = motion.velocity_mps.norm_squared();
    let closest_s = if speed > 0.0 { -motion.position_m.dot(&motion.velocity_mps) / speed } else { from_s };
    let closest_s = closest_s.clamp(from_s, from_s + horizon_s);
    let reach_m = near_m + obstacle.body.bounding_radius_m();
    let mut surface_m = f64::INFINITY;
    for step in 0..=(horizon_s / STEP_S).ceil() as u32 {
        let time_s = from_s + (f64::from(step) * STEP_S).min(horizon_s);
        let centre_m = centre_m(time_s);
        if centre_m.norm() <= reach_m {
            let attitude = motion.pose(time_s, FAR_M).attitude;
            surface_m = surface_m.min(surface_distance_m(&obstacle.body, attitude.inverse() * -centre_m));
        }
    }
    Nearest { centre_m: centre_m(closest_s).norm(), surface_m }
}

/// Distance of a point in the body's frame from the body \[m\], 0 inside. A mesh counts as the ball round it.
fn surface_distance_m(body: &Body, point: Vector3<f64>) -> f64 {
    let Body::Solid { shape, size_m } = body else { return (point.norm() - body.bounding_radius_m()).max(0.0) };
    let half = 0.5 * size_m;
    let across = point.x.hypot(point.y);
    match shape {
        Shape::Box => (point.abs() - half).map(|beyond| beyond.max(0.0)).norm(),
        Shape::Cylinder => (across - half.x).max(0.0).hypot((point.z.abs() - half.z).max(0.0)),
        Shape::Cone => cone_m(half.x, half.z, [across, point.z]),
        Shape::Ellipsoid => ellipsoid_m(half, point),
    }
}

/// Distance from a cone of this radius and half height, in the half plane through its axis: across, up.
fn cone_m(radius: f64, half_height: f64, [across, up]: [f64; 2]) -> f64 {
    let (apex, rim, middle) = ([0.0, half_height], [radius, -half_height], [0.0, -half_height]);
    // Inside: above the base and on the axis' side of the flank.
    if up >= -half_height && across <= radius * (half_height - up) / (2.0 * half_height) {
        return 0.0;
    }
    segment_m(apex, rim, [across, up]).min(segment_m(rim, middle, [across, up]))
}

fn segment_m(from: [f64; 2], to: [f64; 2], point: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let off = [point[0] - from[0], point[1] - from[1]];
    let share = (along[0] * off[0] + along[1] * off[1]) / (along[0] * along[0] + along[1] * along[1]);
    let share = share.clamp(0.0, 1.0);
    (off[0] - share * along[0]).hypot(off[1] - share * along[1])
}

/// Distance from an ellipsoid: the nearest point is aᵢ² yᵢ/(t + aᵢ²), with the t ≥ 0 that puts it on the surface
/// (D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013).
fn ellipsoid_m(half: Vector3<f64>, point: Vector3<f64>) -> f64 {
    let square = half.component_mul(&half);
    let weighted = half.component_mul(&point);
    let excess = |t: f64| (0..3).map(|axis| (weighted[axis] / (t + square[axis])).powi(2)).sum::<f64>() - 1.0;
    if excess(0.0) <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, weighted.norm());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    let on = Vector3::from_fn(|axis, _| square[axis] * point[axis] / (high + square[axis]));
    (point - on).norm()
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use simulator::Motion;

    use super::*;

    /// Whether a point of the body's frame lies in it, straight from its definition.
    fn is_inside(shape: Shape, half: Vector3<f64>, p: Vector3<f64>) -> bool {
        let across = p.x.hypot(p.y);
        match shape {
            Shape::Box => (p.abs() - half).max() <= 0.0,
            Shape::Ellipsoid => p.component_div(&half).norm() <= 1.0,
            Shape::Cylinder => across <= half.x && p.z.abs() <= half.z,
            Shape::Cone => p.z.abs() <= half.z && across <= half.x * 0.5 * (1.0 - p.z / half.z),
        }
    }

    #[test]
    fn nothing_of_a_body_is_nearer_than_its_distance_and_something_is_as_near() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for shape in Shape::ALL {
            let size_m = Vector3::new(1.0, if shape.is_round() { 1.0 } else { 0.6 }, 2.0);
            let half = 0.5 * size_m;
            let body = Body::Solid { shape, size_m };
            for _ in 0..20 {
                let point = Vector3::from_fn(|_, _| random.random_range(-2.0..2.0));
                let mut least = f64::INFINITY;
                for place in 0..40 * 40 * 80 {
                    let grid = [place % 40, place / 40 % 40, place / 1_600].map(|step| 0.025 * (f64::from(step) + 0.5));
                    let inner = Vector3::new(grid[0] - 0.5, grid[1] - 0.5, grid[2] - 1.0);
                    if is_inside(shape, half, inner) {
                        least = least.min((inner - point).norm());
                    }
                }
                let found = surface_distance_m(&body, point);
                // A grid of 2.5 cm has a point within half its diagonal of the nearest, and a little more at edges and a cone's tip.
                let room_m = if shape == Shape::Cone { 0.12 } else { 0.06 };
                assert!(found <= least + 1e-9 && least < found + room_m, "{shape:?} {point}: {found} is not {least}");
                assert_eq!(found == 0.0, is_inside(shape, half, point), "{shape:?} {point}");
            }
        }
    }

    #[test]
    fn a_course_is_as_near_as_its_nearest_moment_within_the_horizon() {
        let motion = Motion {
            position_m: Vector3::new(-10.0, 2.0, 0.0),
            attitude: UnitQuaternion::identity(),
            velocity_mps: Vector3::new(1.0, 0.0, 0.0),
            spin_radps: Vector3::zeros(),
        };
        let body = Body::Solid { shape: Shape::Box, size_m: Vector3::new(1.0, 2.0, 1.0) };
        let sut = Obstacle { body, motion, albedo: 0.5 };
        let all = nearest(&sut, 0.0, 20.0, 5.0);
        assert!((all.centre_m - 2.0).abs() < 1e-9 && (all.surface_m - 1.0).abs() < 1e-9, "{all:?}");
        let half = nearest(&sut, 0.0, 5.0, 1.0);
        assert!((half.centre_m - 29.0_f64.sqrt()).abs() < 1e-9 && half.surface_m == f64::INFINITY, "{half:?}");
        let gone = nearest(&sut, 12.0, 5.0, 5.0);
        assert!((gone.centre_m - 8.0_f64.sqrt()).abs() < 1e-9, "{gone:?}");
    }
}
