use nalgebra::Vector3;

use super::silhouette::Passing;
use super::{Meeting, Twin};

/// The cuboid |x|, |y|, |z| ≤ 1.
pub(crate) struct Cuboid;

impl Twin for Cuboid {
    const ROUND: bool = false;

    /// By slabs (Kay & Kajiya 1986): the last plane entered, if that is before the first one left.
    fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        let (mut enter, mut leave, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
        for i in 0..3 {
            // A ray along the slab gives infinities of opposite sign inside it, of one sign beside it.
            let inverse = 1.0 / direction[i];
            let (one, other) = ((-1.0 - origin[i]) * inverse, (1.0 - origin[i]) * inverse);
            let (near, far) = if one < other { (one, other) } else { (other, one) };
            if near > enter {
                (enter, axis) = (near, i);
            }
            leave = leave.min(far);
        }
        if enter <= 0.0 || enter > leave {
            return None;
        }
        let mut normal = Vector3::zeros();
        normal[axis] = -direction[axis].signum();
        Some(Meeting { distance: enter, normal })
    }

    /// The outline is a hexagon of edges, two along each axis: the one that the ray is farthest out of.
    fn pass(half_m: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Passing {
        let mut nearest = (f64::NEG_INFINITY, 0, Vector3::x());
        for edge in 0..3 {
            let (next, last) = ((edge + 1) % 3, (edge + 2) % 3);
            let length = (direction[next] * direction[next] + direction[last] * direction[last]).sqrt();
            if length < 1e-6 {
                continue; // seen end-on
            }
            let (u, v) = (-direction[last] / length, direction[next] / length);
            let out = u * origin[next] + v * origin[last];
            let distance_m = out.abs() - half_m[next] * u.abs() - half_m[last] * v.abs();
            if distance_m > nearest.0 {
                let mut normal = Vector3::zeros();
                (normal[next], normal[last]) = if out < 0.0 { (-u, -v) } else { (u, v) };
                nearest = (distance_m, edge, normal);
            }
        }
        let (distance_m, edge, normal) = nearest;
        let mut point_m = half_m.zip_map(&normal, f64::copysign);
        // Where along the edge the ray passes it.
        point_m[edge] = 0.0;
        let offset = origin - point_m;
        let lean = direction[edge];
        let there = (offset[edge] - offset.dot(direction) * lean) / (1.0 - lean * lean).max(1e-12);
        point_m[edge] = there.clamp(-half_m[edge], half_m[edge]);
        Passing { distance_m, normal, point_m }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        half_m.norm()
    }
}
