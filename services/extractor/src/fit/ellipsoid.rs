use nalgebra::Vector3;
use pulp::Simd;

use super::silhouette::Passing;
use super::wide::{WideVector, along, cross, dot, minus, norm, over, scale, shrink, times};
use super::{Meeting, UnitSolid};

/// The ball x² + y² + z² ≤ 1, to which every ellipsoid scales.
pub(crate) struct Ellipsoid;

impl UnitSolid for Ellipsoid {
    const ROUND: bool = false;

    /// |o + t d|² = 1, the nearer root.
    #[inline(always)]
    fn meet<S: Simd>(origin: WideVector<S>, direction: WideVector<S>) -> Meeting<S> {
        let all = |value| origin[0].all(value);
        let a = dot(direction, direction);
        let b = dot(origin, direction);
        // From the point nearest the centre: b² − a c would cancel for a small ball far away.
        let nearest = minus(origin, scale(direction, b / a));
        let discriminant = a * (all(1.0) - dot(nearest, nearest));
        // Of a negative number the root is none, and the distance too.
        let distance = (-b - discriminant.sqrt()) / a;
        Meeting { found: distance.greater(all(0.0)), distance, normal: along(origin, direction, distance) }
    }

    /// To first order: the ray's nearest point in the unit frame, and the slope of its level there.
    #[inline(always)]
    fn pass<S: Simd>(half_m: WideVector<S>, origin: WideVector<S>, direction: WideVector<S>) -> Passing<S> {
        let all = |value| origin[0].all(value);
        let unit_origin = over(origin, half_m);
        let unit_direction = over(direction, half_m);
        let back = dot(unit_origin, unit_direction) / dot(unit_direction, unit_direction);
        let nearest = minus(unit_origin, scale(unit_direction, back));
        let level = norm(nearest);
        let slope = over(nearest, half_m);
        let steepness = norm(slope);
        let mut passing = Passing {
            distance_m: level * (level - all(1.0)) / steepness,
            normal: shrink(slope, steepness),
            point_m: shrink(times(nearest, half_m), level),
            along: all(0.0),
        };
        let central = level.less(all(1e-9)) | steepness.less(all(1e-12));
        if central.any() {
            let upright = direction[0].abs().less(all(0.8));
            let [zero, one] = [all(0.0), all(1.0)];
            let across = cross(direction, [upright.choose(one, zero), upright.choose(zero, one), zero]);
            let length = norm(across);
            let normal = shrink(across, length);
            let least_m = half_m[0].min(half_m[1]).min(half_m[2]);
            passing = Passing {
                distance_m: central.choose(-least_m, passing.distance_m),
                normal: central.choose_vector(normal, passing.normal),
                point_m: central.choose_vector(scale(normal, least_m), passing.point_m),
                along: passing.along,
            };
        }
        passing
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        half_m.max()
    }
}
