use nalgebra::Vector3;
use pulp::Simd;

use super::silhouette::{Passing, Upright, ellipse};
use super::wide::{WideVector, along};
use super::{Meeting, UnitSolid};

/// The cylinder x² + y² ≤ 1, |z| ≤ 1.
pub(crate) struct Cylinder;

impl UnitSolid for Cylinder {
    const ROUND: bool = true;

    /// A ray is inside while it is inside the endless cylinder and between the planes of the caps.
    #[inline(always)]
    fn meet<S: Simd>(origin: WideVector<S>, direction: WideVector<S>) -> Meeting<S> {
        let all = |value| origin[0].all(value);
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
        let inverse = all(1.0) / dz;
        let (one, other) = ((all(-1.0) - oz) * inverse, (all(1.0) - oz) * inverse);
        let swap = one.less(other);
        let (low, high) = (swap.choose(one, other), swap.choose(other, one));

        // x² + y² = 1: a t² + 2 b t + c = 0.
        let a = dx * dx + dy * dy;
        let b = ox * dx + oy * dy;
        let c = ox * ox + oy * oy - all(1.0);
        let discriminant = b * b - a * c;
        let root = discriminant.sqrt();
        // Along the axis it is inside always or never.
        let leans = a.greater(all(1e-18));
        let near = leans.choose((-b - root) / a, all(f64::NEG_INFINITY));
        let far = leans.choose((-b + root) / a, all(f64::INFINITY));
        let crosses = !discriminant.less(all(0.0)) & (leans | c.at_most(all(0.0)));

        let distance = near.max(low);
        // Written so that NaN fails.
        let found = crosses & distance.greater(all(0.0)) & distance.at_most(far.min(high));
        let zero = all(0.0);
        let [x, y, _] = along(origin, direction, distance);
        let cap = [zero, zero, -all(1.0).copysign(dz)];
        Meeting { found, distance, normal: low.greater(near).choose_vector(cap, [x, y, zero]) }
    }

    /// The outline is two upright lines between two ellipses, those of the caps.
    #[inline(always)]
    fn pass<S: Simd>(half_m: WideVector<S>, origin: WideVector<S>, direction: WideVector<S>) -> Passing<S> {
        let all = |value| origin[0].all(value);
        let [zero, one] = [all(0.0), all(1.0)];
        let (radius_m, half_height_m) = (half_m[0], half_m[2]);
        let view = Upright::new(origin, direction);
        let (top, depth_m) = (half_height_m * view.height, radius_m * view.depth);
        let end = one.copysign(view.y);
        let above = view.y.abs() - top;

        // Beyond an end: its ellipse. Between them: a line, or an ellipse from within.
        let between = above.at_most(zero);
        let side = view.x - radius_m;
        let share = view.x / radius_m;
        let cap = above - depth_m * (one - share * share).max(zero).sqrt();
        let by_side = between & side.at_least(cap);
        let (arc, [arc_x, arc_y]) = ellipse(view.x, above, radius_m, depth_m);

        let x = by_side.choose(one, between.choose(zero, arc_x));
        let y = by_side.choose(zero, between.choose(end, arc_y * end));
        let normal = view.lift(x, y);
        let z_m = view.height.greater(all(1e-9)).choose(view.y / view.height, zero);
        Passing {
            distance_m: by_side.choose(side, between.choose(cap, arc)),
            normal,
            point_m: Upright::on_rim(normal, radius_m, by_side.choose(z_m, half_height_m * end)),
            along: zero,
        }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        (half_m.x * half_m.x + half_m.z * half_m.z).sqrt()
    }
}
