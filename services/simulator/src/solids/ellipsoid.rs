use nalgebra::Vector3;

use super::{Meeting, Surface};

/// The ball x² + y² + z² ≤ 1, to which every ellipsoid scales.
pub(crate) struct UnitBall;

impl Surface for UnitBall {
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        // |o + t d|² = 1: a t² + 2 b t + c = 0.
        let c = origin.norm_squared() - 1.0;
        if c <= 0.0 {
            return Some(Meeting::at_origin(direction));
        }
        let b = origin.dot(direction);
        if b >= 0.0 {
            return None;
        }
        let a = direction.norm_squared();
        // The discriminant from the point nearest the centre: b² − a c would cancel for a small ball far away.
        let nearest = origin - direction * (b / a);
        let discriminant = a * (1.0 - nearest.norm_squared());
        if discriminant < 0.0 {
            return None;
        }
        let distance = c / (discriminant.sqrt() - b);
        Some(Meeting { distance, normal: origin + direction * distance })
    }
}
