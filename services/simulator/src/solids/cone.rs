use nalgebra::Vector3;

use super::{Meeting, Surface, roots};

/// The cone √(x² + y²) ≤ (1 − z)/2, |z| ≤ 1: apex at z = 1, base of radius 1 at z = −1.
pub(crate) struct UnitCone;

impl Surface for UnitCone {
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        // The side's radius at the ray's height is w + t v.
        let (w, v) = (0.5 * (1.0 - origin.z), -0.5 * direction.z);
        // x² + y² = (w + t v)²: a t² + 2 b t + c = 0.
        let c = origin.xy().norm_squared() - w * w;
        if c <= 0.0 && origin.z.abs() <= 1.0 {
            return Some(Meeting::at_origin(direction));
        }
        let a = direction.xy().norm_squared() - v * v;
        let b = origin.xy().dot(&direction.xy()) - w * v;

        let mut first: Option<Meeting> = None;
        if let Some((near, far)) = roots(a, b, c) {
            // The equation has a second cone above the apex: a root may lie on that one, and the other count.
            for distance in [near, far] {
                let point = origin + direction * distance;
                if distance >= 0.0 && point.z.abs() <= 1.0 {
                    let normal = Vector3::new(point.x, point.y, 0.25 * (1.0 - point.z));
                    first = Some(Meeting { distance, normal });
                    break;
                }
            }
        }
        let distance = (-1.0 - origin.z) / direction.z; // infinite or NaN for a ray along the base
        let rim = (origin + direction * distance).xy().norm_squared();
        if distance >= 0.0 && rim <= 1.0 && first.is_none_or(|side| distance < side.distance) {
            first = Some(Meeting { distance, normal: -Vector3::z() });
        }
        first
    }
}
