use nalgebra::Vector3;

use super::silhouette::Passing;
use super::{Meeting, Twin};
use crate::fit::frames::any_across;

/// The ball x² + y² + z² ≤ 1, to which every ellipsoid scales.
pub(crate) struct Ellipsoid;

impl Twin for Ellipsoid {
    const ROUND: bool = false;

    /// |o + t d|² = 1, the nearer root.
    fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        let a = direction.norm_squared();
        let b = origin.dot(direction);
        // From the point nearest the centre: b² − a c would cancel for a small ball far away.
        let nearest = origin - direction * (b / a);
        let discriminant = a * (1.0 - nearest.norm_squared());
        if discriminant < 0.0 {
            return None;
        }
        let distance = (-b - discriminant.sqrt()) / a;
        (distance > 0.0).then(|| Meeting { distance, normal: origin + direction * distance })
    }

    /// To first order: the ray's nearest point in the unit frame, and the slope of its level there.
    fn pass(half_m: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Passing {
        let unit_origin = origin.component_div(half_m);
        let unit_direction = direction.component_div(half_m);
        let nearest = unit_origin - unit_direction * (unit_origin.dot(&unit_direction) / unit_direction.norm_squared());
        let level = nearest.norm();
        let slope = nearest.component_div(half_m);
        let steepness = slope.norm();
        if level < 1e-9 || steepness < 1e-12 {
            let normal = any_across(direction);
            return Passing { distance_m: -half_m.min(), normal, point_m: normal * half_m.min() };
        }
        Passing {
            distance_m: level * (level - 1.0) / steepness,
            normal: slope / steepness,
            point_m: nearest.component_mul(half_m) / level,
        }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        half_m.max()
    }
}
