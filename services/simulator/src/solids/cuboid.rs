use nalgebra::Vector3;

use super::{Meeting, Surface, slab};

/// The box |x|, |y|, |z| ≤ 1.
pub(crate) struct UnitBox;

impl Surface for UnitBox {
    /// By slabs (Kay & Kajiya 1986): the last plane entered before the first is left.
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        if origin.amax() <= 1.0 {
            return Some(Meeting::at_origin(direction));
        }
        let (mut enter, mut leave, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
        for i in 0..3 {
            let (near, far) = slab(origin[i], direction[i]);
            if near > enter {
                (enter, axis) = (near, i);
            }
            leave = leave.min(far);
        }
        if enter < 0.0 || enter > leave {
            return None;
        }
        let mut normal = Vector3::zeros();
        normal[axis] = -direction[axis].signum();
        Some(Meeting { distance: enter, normal })
    }
}
