use nalgebra::Vector3;

use super::{Meeting, Surface, roots, slab};

/// The cylinder x² + y² ≤ 1, |z| ≤ 1.
pub(crate) struct UnitCylinder;

impl Surface for UnitCylinder {
    /// A ray is inside while it is inside the endless cylinder and between the planes of the caps.
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        // x² + y² = 1: a t² + 2 b t + c = 0.
        let c = origin.xy().norm_squared() - 1.0;
        if c <= 0.0 && origin.z.abs() <= 1.0 {
            return Some(Meeting::at_origin(direction));
        }
        let a = direction.xy().norm_squared();
        let (near, far) = if a > 0.0 {
            roots(a, origin.xy().dot(&direction.xy()), c)?
        } else if c <= 0.0 {
            (f64::NEG_INFINITY, f64::INFINITY)
        } else {
            return None;
        };
        let (low, high) = slab(origin.z, direction.z);
        let distance = near.max(low);
        if distance < 0.0 || distance > far.min(high) {
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
}
