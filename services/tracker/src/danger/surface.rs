use lidar::ObstacleClass;
use nalgebra::Vector3;

/// Rounds in the search for an ellipsoid's nearest point.
const ROUNDS: usize = 6;

/// Distance of a point from a solid of this class and full extents, in its own axes, the middle of its box at the origin
/// [m]; 0 inside. A class that is not known is a box.
pub(super) fn distance_m(class: ObstacleClass, size_m: &[f64; 3], point: &Vector3<f64>) -> f64 {
    let half = Vector3::from(*size_m) * 0.5;
    let across = point.x.hypot(point.y);
    match class {
        ObstacleClass::Ellipsoidal => ellipsoid_m(&half, point),
        ObstacleClass::Cylindrical => (across - half.x).max(0.0).hypot((point.z.abs() - half.z).max(0.0)),
        ObstacleClass::Conical => cone_m(half.x, half.z, [across, point.z]),
        _ => (point.abs() - half).sup(&Vector3::zeros()).norm(),
    }
}

/// Distance of the middle of the solid's box from its surface [m].
pub(super) fn inner_m(class: ObstacleClass, size_m: &[f64; 3]) -> f64 {
    let [x, y, z] = size_m.map(|extent| 0.5 * extent);
    match class {
        // The flank is as far from the middle of the axis as half the height, times the sine of the opening.
        ObstacleClass::Conical => z.min(z * x / x.hypot(2.0 * z).max(1e-9)),
        ObstacleClass::Cylindrical => x.min(z),
        _ => x.min(y).min(z),
    }
}

/// In the half plane through a cone's axis: across, up. Base and flank.
fn cone_m(radius: f64, half_height: f64, [across, up]: [f64; 2]) -> f64 {
    if up >= -half_height && 2.0 * half_height * across <= radius * (half_height - up) {
        return 0.0;
    }
    let base = (across - radius).max(0.0).hypot(up + half_height);
    let (run, rise) = (radius, -2.0 * half_height);
    let share = (across * run + (up - half_height) * rise) / (run * run + rise * rise).max(1e-18);
    let share = share.clamp(0.0, 1.0);
    base.min((across - share * run).hypot(up - half_height - share * rise))
}

/// The nearest point of an ellipsoid is aᵢ² yᵢ/(t + aᵢ²), t the root of a convex, falling function (D. Eberly, "Distance
/// from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013); Newton's method from before the root.
fn ellipsoid_m(half: &Vector3<f64>, point: &Vector3<f64>) -> f64 {
    let half = half.map(|one| one.max(1e-6));
    let square = half.component_mul(&half);
    let weighted = half.component_mul(&point.abs());
    if point.component_div(&half).norm_squared() <= 1.0 {
        return 0.0;
    }
    let mut t = (weighted - square).max().max(0.0);
    for _ in 0..ROUNDS {
        let (mut value, mut slope) = (-1.0, 0.0);
        for axis in 0..3 {
            let sum = t + square[axis];
            let part = (weighted[axis] / sum).powi(2);
            value += part;
            slope -= 2.0 * part / sum;
        }
        t -= value / slope;
    }
    let beside = Vector3::from_fn(|axis, _| t * point[axis] / (t + square[axis]));
    beside.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE_M: [f64; 3] = [1.0, 1.0, 2.0];

    #[test]
    fn a_point_before_a_face_is_as_far_as_the_face() {
        let point = Vector3::new(0.0, 0.0, -3.0);
        for class in ObstacleClass::SOLIDS {
            assert!((distance_m(class, &SIZE_M, &point) - 2.0).abs() < 1e-9, "{class:?}");
            assert_eq!(distance_m(class, &SIZE_M, &Vector3::new(0.0, 0.0, -0.9)), 0.0, "{class:?}");
        }
        let corner = Vector3::new(1.5, 1.5, 2.0);
        assert!((distance_m(ObstacleClass::Rectangular, &SIZE_M, &corner) - 3.0_f64.sqrt()).abs() < 1e-12);
        let tip = Vector3::new(0.0, 0.0, 3.0);
        assert!((distance_m(ObstacleClass::Conical, &SIZE_M, &tip) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn an_ellipsoid_is_as_far_as_the_nearest_of_its_points() {
        let size_m = [0.6, 1.4, 3.0];
        for point in [Vector3::new(1.0, 0.2, 0.3), Vector3::new(-0.4, 2.0, 2.5), Vector3::new(0.02, 0.01, 4.0)] {
            let mut least = f64::INFINITY;
            for (u, v) in (0..400).flat_map(|u| (0..800).map(move |v| (u, v))) {
                let (u, v) = (f64::from(u) * std::f64::consts::PI / 400.0, f64::from(v) * std::f64::consts::PI / 400.0);
                let on = Vector3::new(0.3 * u.sin() * v.cos(), 0.7 * u.sin() * v.sin(), 1.5 * u.cos());
                least = least.min((on - point).norm());
            }
            let found = distance_m(ObstacleClass::Ellipsoidal, &size_m, &point);
            assert!((found - least).abs() < 2e-4, "{point}: {found} {least}");
        }
    }

    #[test]
    fn the_ball_inside_touches_the_surface() {
        for class in ObstacleClass::SOLIDS {
            let inner_m = inner_m(class, &SIZE_M);
            let at = |radius: f64| {
                (0..100).map(move |step| {
                    let angle = f64::from(step) * std::f64::consts::PI / 100.0;
                    distance_m(class, &SIZE_M, &Vector3::new(radius * angle.sin(), 0.0, radius * angle.cos()))
                })
            };
            assert!(at(inner_m * 0.999).all(|distance| distance == 0.0), "{class:?}");
            assert!(at(inner_m * 1.01).any(|distance| distance > 0.0), "{class:?}");
        }
    }
}
