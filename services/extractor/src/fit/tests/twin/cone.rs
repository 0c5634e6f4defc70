use nalgebra::Vector3;

use super::silhouette::{Passing, Upright, ellipse};
use super::{Meeting, Twin};

/// The cone √(x² + y²) ≤ (1 − z)/2, |z| ≤ 1: apex at z = 1, base of radius 1 at z = −1.
pub(crate) struct Cone;

impl Twin for Cone {
    const ROUND: bool = true;

    fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        // The side's radius at the ray's height is w + t v: x² + y² = (w + t v)², a t² + 2 b t + c = 0.
        let (w, v) = (0.5 * (1.0 - origin.z), -0.5 * direction.z);
        let a = direction.x * direction.x + direction.y * direction.y - v * v;
        let b = origin.x * direction.x + origin.y * direction.y - w * v;
        let c = origin.x * origin.x + origin.y * origin.y - w * w;

        let mut first: Option<Meeting> = None;
        let discriminant = b * b - a * c;
        if discriminant >= 0.0 {
            let q = -(b + discriminant.sqrt().copysign(b));
            let (one, other) = (q / a, c / q);
            let (near, far) = if one < other { (one, other) } else { (other, one) };
            // The equation has a second cone above the apex: a root may lie on that one, and the other count.
            for distance in [near, far] {
                let z = origin.z + direction.z * distance;
                if distance > 0.0 && z.abs() <= 1.0 {
                    let point = origin + direction * distance;
                    first = Some(Meeting { distance, normal: Vector3::new(point.x, point.y, 0.25 * (1.0 - point.z)) });
                    break;
                }
            }
        }
        let distance = (-1.0 - origin.z) / direction.z; // infinite or NaN for a ray along the base
        let (x, y) = (origin.x + direction.x * distance, origin.y + direction.y * distance);
        if distance > 0.0 && x * x + y * y <= 1.0 && first.is_none_or(|side| distance < side.distance) {
            first = Some(Meeting { distance, normal: -Vector3::z() });
        }
        first
    }

    /// The outline is the ellipse of the base and two lines that touch it and meet at the apex, where that lies outside
    /// the ellipse. Heights are counted from the base's middle.
    fn pass(half_m: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Passing {
        let (radius_m, half_height_m) = (half_m.x, half_m.z);
        let view = Upright::new(origin, direction);
        let (apex, depth_m) = (2.0 * half_height_m * view.height, radius_m * view.depth);
        let (x, y) = (view.x, view.y + 0.5 * apex);
        let on_base = |normal: &Vector3<f64>| Upright::on_rim(normal, radius_m, -half_height_m);

        let (arc, [arc_x, arc_y]) = ellipse(x, y, radius_m, depth_m);
        let arc_normal = view.lift(arc_x, arc_y);
        let by_arc = Passing { distance_m: arc, normal: arc_normal, point_m: on_base(&arc_normal) };
        if apex <= depth_m {
            return by_arc;
        }
        // Where the line from the apex touches the ellipse.
        let share = depth_m / apex;
        let (touch_x, touch_y) = (radius_m * (1.0 - share * share).sqrt(), depth_m * share);
        let (run, rise) = (-touch_x, apex - touch_y);
        let length = (run * run + rise * rise).sqrt();
        let (line_x, line_y) = (rise / length, -run / length);
        let along = ((x - touch_x) * run + (y - touch_y) * rise) / length;
        let line = (x - touch_x) * line_x + (y - touch_y) * line_y;
        if along < 0.0 && arc > line {
            return by_arc;
        }
        let (off_x, off_y) = (x, y - apex);
        if along > length && line > 0.0 {
            let distance_m = (off_x * off_x + off_y * off_y).sqrt();
            if distance_m > 1e-9 {
                let normal = view.lift(off_x / distance_m, off_y / distance_m);
                return Passing { distance_m, normal, point_m: Vector3::new(0.0, 0.0, half_height_m) };
            }
        }
        // Within, the base may be nearer than the side: to first order, from the arc below the ray.
        let below = depth_m * (1.0 - (x / radius_m).powi(2)).max(0.0).sqrt();
        let (out_x, out_y) = (x / (radius_m * radius_m), -below / (depth_m * depth_m));
        let steepness = (out_x * out_x + out_y * out_y).sqrt();
        let base = (y + below) * out_y / steepness;
        if line < 0.0 && base > line {
            let normal = view.lift(out_x / steepness, out_y / steepness);
            return Passing { distance_m: base, normal, point_m: on_base(&normal) };
        }
        let normal = view.lift(line_x, line_y);
        let foot = on_base(&normal);
        let tip = Vector3::new(0.0, 0.0, half_height_m);
        Passing { distance_m: line, normal, point_m: foot + (tip - foot) * (along / length).clamp(0.0, 1.0) }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        (half_m.x * half_m.x + half_m.z * half_m.z).sqrt()
    }
}
