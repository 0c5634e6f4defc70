use std::f64::consts::PI;

use lidar::ObstacleClass;
use nalgebra::Matrix6;

/// At what distance between centres the own craft and an obstacle touch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// Own radius and the radius of the sphere about the obstacle, seen from the middle of its box [m]: nothing nearer
    /// than this is missed, whatever its attitude. What conjunction analysis calls the combined hard-body radius, and
    /// what [`super::closest_approach`] should be given.
    pub bounding_m: f64,
    /// Radius of the disc as large as what the two cover of a plane on the average over all attitudes [m]: for a tumbling
    /// obstacle whose miss is uncertain by more than its size, as likely to be touched as the obstacle itself.
    pub tumbling_m: f64,
    /// Standard deviation of `bounding_m` [m].
    pub sigma_m: f64,
}

/// Power mean of Thomsen's formula for the surface of an ellipsoid (1 % off at worst; the exponent is K. Thomsen's, 2004).
fn power_mean(values: [f64; 3]) -> f64 {
    const P: f64 = 1.6075;
    (values.iter().map(|value| value.powf(P)).sum::<f64>() / 3.0).powf(1.0 / P)
}

/// At what distance an own craft of `own_radius_m` touches an obstacle of this class and size.
///
/// `size_m` are full extents as in [`messages::Solid`], with their standard deviations; of a class that is not known the
/// obstacle is a box. A size of 0 leaves the own radius. Mean over attitudes by Steiner's and Cauchy's formulas for convex
/// bodies: a body of surface S and mean width w, grown by r, covers π·(S/4π + w·r + r²) of a plane.
pub fn touch(own_radius_m: f64, class: ObstacleClass, size_m: [f64; 3], size_sigma_m: [f64; 3]) -> Touch {
    let [a, b, c] = size_m;
    let (radius, height) = (0.5 * a, c);
    let slant = radius.hypot(height);
    // Surface and mean width; what the sphere about the body is made of.
    let (surface, width, round) = match class {
        ObstacleClass::Ellipsoidal if a.min(b).min(c) > 0.0 => {
            let [a, b, c] = size_m.map(|extent| 0.5 * extent);
            (
                4.0 * PI * a * b * c * power_mean([1.0 / a, 1.0 / b, 1.0 / c]),
                2.0 * power_mean([a, b, c]),
                [1.0, 1.0, 1.0],
            )
        }
        ObstacleClass::Cylindrical => {
            (2.0 * PI * radius * (radius + height), 0.5 * height + 0.5 * PI * radius, [1.0, 0.0, 1.0])
        }
        ObstacleClass::Conical => {
            let opening = radius.atan2(height);
            (PI * radius * (radius + slant), 0.5 * (height + radius * (0.5 * PI + opening)), [1.0, 0.0, 1.0])
        }
        _ => (2.0 * (a * b + b * c + c * a), 0.5 * (a + b + c), [1.0, 1.0, 1.0]),
    };
    let (bounding, variance) = if class == ObstacleClass::Ellipsoidal {
        let longest = (0..3).max_by(|&one, &other| size_m[one].total_cmp(&size_m[other])).unwrap_or(0);
        (0.5 * size_m[longest], (0.5 * size_sigma_m[longest]).powi(2))
    } else {
        let diagonal = (0..3).map(|axis| round[axis] * size_m[axis] * size_m[axis]).sum::<f64>().sqrt();
        let slope = |axis: usize| round[axis] * size_m[axis] / (2.0 * diagonal.max(1e-9)) * size_sigma_m[axis];
        (0.5 * diagonal, (0..3).map(|axis| slope(axis) * slope(axis)).sum())
    };
    Touch {
        bounding_m: own_radius_m + bounding,
        tumbling_m: (surface / (4.0 * PI) + width * own_radius_m + own_radius_m * own_radius_m).sqrt(),
        sigma_m: variance.sqrt(),
    }
}

impl Touch {
    /// The covariance of position and velocity with that of the size in it: where position is well known, a size that is
    /// too small by δ is a position too far by δ; where it is not, the size hardly matters.
    pub fn widened(&self, covariance: &Matrix6<f64>) -> Matrix6<f64> {
        let mut wider = *covariance;
        for axis in 0..3 {
            wider[(axis, axis)] += self.sigma_m * self.sigma_m;
        }
        wider
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SURE: [f64; 3] = [0.0; 3];

    #[test]
    fn a_ball_touches_at_the_sum_of_both_radii() {
        let ball = touch(1.5, ObstacleClass::Ellipsoidal, [2.0; 3], [0.2; 3]);
        assert!((ball.bounding_m - 2.5).abs() < 1e-12);
        assert!((ball.tumbling_m - 2.5).abs() < 1e-12);
        assert!((ball.sigma_m - 0.1).abs() < 1e-12);
        let nothing = touch(1.5, ObstacleClass::Unclassified, SURE, SURE);
        assert_eq!((nothing.bounding_m, nothing.tumbling_m, nothing.sigma_m), (1.5, 1.5, 0.0));
    }

    #[test]
    fn a_tumbling_body_covers_less_than_the_sphere_about_it() {
        for class in ObstacleClass::SOLIDS {
            let body = touch(1.0, class, [0.8, 0.8, 2.0], SURE);
            assert!(body.tumbling_m < body.bounding_m, "{class:?}");
            // And more than a ball inside: half the shortest extent is too much only for the cone's.
            assert!(body.tumbling_m > 1.25, "{class:?}");
        }
        let cube = touch(0.0, ObstacleClass::Rectangular, [1.0; 3], SURE);
        assert!((cube.tumbling_m - (1.5 / PI).sqrt()).abs() < 1e-12, "Cauchy: a quarter of six faces");
        assert!((cube.bounding_m - 0.75_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_flat_cylinder_and_a_flat_cone_are_the_same_disc() {
        let size = [2.0, 2.0, 1e-9];
        let (cylinder, cone) =
            (touch(0.7, ObstacleClass::Cylindrical, size, SURE), touch(0.7, ObstacleClass::Conical, size, SURE));
        assert!((cylinder.tumbling_m - cone.tumbling_m).abs() < 1e-6);
        // A disc of radius 1: surface 2π, mean width π/2.
        assert!((cylinder.tumbling_m - (0.5 + 0.35 * PI + 0.49).sqrt()).abs() < 1e-6);
    }

    #[test]
    fn the_uncertainty_of_a_size_is_that_of_the_longest_way_through() {
        let rod = touch(1.0, ObstacleClass::Cylindrical, [0.1, 0.1, 4.0], [0.01, 0.01, 0.5]);
        assert!((rod.sigma_m - 0.25).abs() < 1e-3);
        let wider = rod.widened(&Matrix6::identity());
        assert!((wider[(0, 0)] - 1.0 - rod.sigma_m * rod.sigma_m).abs() < 1e-12);
        assert_eq!(wider[(3, 3)], 1.0);
    }
}
