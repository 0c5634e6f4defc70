use nalgebra::Vector3;

use super::silhouette::{Passing, Upright, ellipse};
use super::{Meeting, Twin};

/// The cylinder x² + y² ≤ 1, |z| ≤ 1.
pub(crate) struct Cylinder;

impl Twin for Cylinder {
    const ROUND: bool = true;

    /// A ray is inside while it is inside the endless cylinder and between the planes of the caps.
    fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        let inverse = 1.0 / direction.z;
        let (one, other) = ((-1.0 - origin.z) * inverse, (1.0 - origin.z) * inverse);
        let (low, high) = if one < other { (one, other) } else { (other, one) };

        // x² + y² = 1: a t² + 2 b t + c = 0.
        let a = direction.x * direction.x + direction.y * direction.y;
        let b = origin.x * direction.x + origin.y * direction.y;
        let c = origin.x * origin.x + origin.y * origin.y - 1.0;
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let (near, far) = if a > 1e-18 {
            let root = discriminant.sqrt();
            ((-b - root) / a, (-b + root) / a)
        } else if c <= 0.0 {
            (f64::NEG_INFINITY, f64::INFINITY) // along the axis, inside
        } else {
            return None; // along the axis, beside
        };
        let distance = near.max(low);
        // Written so that NaN fails.
        if !(distance > 0.0 && distance <= far.min(high)) {
            return None;
        }
        let normal = if low > near {
            Vector3::new(0.0, 0.0, -direction.z.signum())
        } else {
            let point = origin + direction * distance;
            Vector3::new(point.x, point.y, 0.0)
        };
        Some(Meeting { distance, normal })
    }

    /// The outline is two upright lines between two ellipses, those of the caps.
    fn pass(half_m: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Passing {
        let (radius_m, half_height_m) = (half_m.x, half_m.z);
        let view = Upright::new(origin, direction);
        let (top, depth_m) = (half_height_m * view.height, radius_m * view.depth);
        let end = 1.0_f64.copysign(view.y);
        let above = view.y.abs() - top;
        if above <= 0.0 {
            let side = view.x - radius_m;
            let cap = above - depth_m * (1.0 - (view.x / radius_m).powi(2)).max(0.0).sqrt();
            if side >= cap {
                let normal = view.lift(1.0, 0.0);
                let z_m = if view.height > 1e-9 { view.y / view.height } else { 0.0 };
                return Passing { distance_m: side, normal, point_m: Upright::on_rim(&normal, radius_m, z_m) };
            }
            let normal = view.lift(0.0, end);
            return Passing {
                distance_m: cap,
                normal,
                point_m: Upright::on_rim(&normal, radius_m, half_height_m * end),
            };
        }
        let (distance_m, [x, y]) = ellipse(view.x, above, radius_m, depth_m);
        let normal = view.lift(x, y * end);
        Passing { distance_m, normal, point_m: Upright::on_rim(&normal, radius_m, half_height_m * end) }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        (half_m.x * half_m.x + half_m.z * half_m.z).sqrt()
    }
}
