use nalgebra::Vector3;
use pulp::Simd;

use super::silhouette::{Passing, Upright, ellipse};
use super::wide::{WideVector, along, minus};
use super::{Meeting, UnitSolid};

/// The cone √(x² + y²) ≤ (1 − z)/2, |z| ≤ 1: apex at z = 1, base of radius 1 at z = −1.
pub(crate) struct Cone;

impl UnitSolid for Cone {
    const ROUND: bool = true;

    #[inline(always)]
    fn meet<S: Simd>(origin: WideVector<S>, direction: WideVector<S>) -> Meeting<S> {
        let all = |value| origin[0].all(value);
        let [zero, one] = [all(0.0), all(1.0)];
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
        // The side's radius at the ray's height is w + t v: x² + y² = (w + t v)², a t² + 2 b t + c = 0.
        let (w, v) = (all(0.5) * (one - oz), all(-0.5) * dz);
        let a = dx * dx + dy * dy - v * v;
        let b = ox * dx + oy * dy - w * v;
        let c = ox * ox + oy * oy - w * w;

        let discriminant = b * b - a * c;
        let q = -(b + discriminant.sqrt().copysign(b));
        let (first, second) = (q / a, c / q);
        let swap = first.less(second);
        let (near, far) = (swap.choose(first, second), swap.choose(second, first));
        // The equation has a second cone above the apex: a root may lie on that one, and the other count.
        let crosses = discriminant.at_least(zero);
        let by_near = crosses & near.greater(zero) & (oz + dz * near).abs().at_most(one);
        let by_far = crosses & far.greater(zero) & (oz + dz * far).abs().at_most(one);
        let side = by_near.choose(near, far);
        let by_side = by_near | by_far;
        let [x, y, z] = along(origin, direction, side);
        let normal = [x, y, all(0.25) * (one - z)];

        let base = (all(-1.0) - oz) / dz; // infinite or NaN for a ray along the base
        let (x, y) = (ox + dx * base, oy + dy * base);
        let by_base = base.greater(zero) & (x * x + y * y).at_most(one) & (!by_side | base.less(side));
        Meeting {
            found: by_side | by_base,
            distance: by_base.choose(base, side),
            normal: by_base.choose_vector([-zero, -zero, -one], normal),
        }
    }

    /// The outline is the ellipse of the base and two lines that touch it and meet at the apex, where that lies outside
    /// the ellipse. Heights are counted from the base's middle.
    #[inline(always)]
    fn pass<S: Simd>(half_m: WideVector<S>, origin: WideVector<S>, direction: WideVector<S>) -> Passing<S> {
        let all = |value| origin[0].all(value);
        let [zero, one] = [all(0.0), all(1.0)];
        let (radius_m, half_height_m) = (half_m[0], half_m[2]);
        let view = Upright::new(origin, direction);
        let (apex, depth_m) = (all(2.0) * half_height_m * view.height, radius_m * view.depth);
        let (x, y) = (view.x, view.y + all(0.5) * apex);

        let (arc, [arc_x, arc_y]) = ellipse(x, y, radius_m, depth_m);
        // Where the line from the apex touches the ellipse.
        let share = depth_m / apex;
        let (touch_x, touch_y) = (radius_m * (one - share * share).sqrt(), depth_m * share);
        let (run, rise) = (-touch_x, apex - touch_y);
        let length = (run * run + rise * rise).sqrt();
        let (line_x, line_y) = (rise / length, -run / length);
        let along_m = ((x - touch_x) * run + (y - touch_y) * rise) / length;
        let line = (x - touch_x) * line_x + (y - touch_y) * line_y;
        let by_arc = apex.at_most(depth_m) | (along_m.less(zero) & arc.greater(line));

        let (off_x, off_y) = (x, y - apex);
        let off_m = (off_x * off_x + off_y * off_y).sqrt();
        let by_tip = !by_arc & along_m.greater(length) & line.greater(zero) & off_m.greater(all(1e-9));

        // Within, the base may be nearer than the side: to first order, from the arc below the ray.
        let across = x / radius_m;
        let below = depth_m * (one - across * across).max(zero).sqrt();
        let (out_x, out_y) = (x / (radius_m * radius_m), -below / (depth_m * depth_m));
        let steepness = (out_x * out_x + out_y * out_y).sqrt();
        let base = (y + below) * out_y / steepness;
        let by_base = !by_arc & !by_tip & line.less(zero) & base.greater(line);

        let pick = |on_arc, on_tip, on_base, on_line| {
            by_arc.choose(on_arc, by_tip.choose(on_tip, by_base.choose(on_base, on_line)))
        };
        let normal = view.lift(
            pick(arc_x, off_x / off_m, out_x / steepness, line_x),
            pick(arc_y, off_y / off_m, out_y / steepness, line_y),
        );
        let foot = Upright::on_rim(normal, radius_m, -half_height_m);
        let tip = [zero, zero, half_height_m];
        let up = (along_m / length).clamp(zero, one);
        let on_line = along(foot, minus(tip, foot), up);
        Passing {
            distance_m: pick(arc, off_m, base, line),
            normal,
            point_m: (by_arc | by_base).choose_vector(foot, by_tip.choose_vector(tip, on_line)),
            along: zero,
        }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        (half_m.x * half_m.x + half_m.z * half_m.z).sqrt()
    }
}
