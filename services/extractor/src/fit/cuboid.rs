use nalgebra::Vector3;
use pulp::Simd;

use super::silhouette::Passing;
use super::wide::{WideVector, dot, minus};
use super::{Meeting, UnitSolid};

/// The cuboid |x|, |y|, |z| ≤ 1.
pub(crate) struct Cuboid;

impl UnitSolid for Cuboid {
    const ROUND: bool = false;

    /// By slabs (Kay & Kajiya 1986): the last plane entered, if that is before the first one left.
    #[inline(always)]
    fn meet<S: Simd>(origin: WideVector<S>, direction: WideVector<S>) -> Meeting<S> {
        let all = |value| origin[0].all(value);
        let (mut enter, mut leave) = (all(f64::NEG_INFINITY), all(f64::INFINITY));
        let mut normal = [all(0.0); 3];
        for axis in 0..3 {
            // A ray along the slab gives infinities of opposite sign inside it, of one sign beside it.
            let inverse = all(1.0) / direction[axis];
            let (one, other) = ((all(-1.0) - origin[axis]) * inverse, (all(1.0) - origin[axis]) * inverse);
            let swap = one.less(other);
            let (near, far) = (swap.choose(one, other), swap.choose(other, one));
            let later = near.greater(enter);
            enter = later.choose(near, enter);
            let mut of_axis = [all(0.0); 3];
            of_axis[axis] = -all(1.0).copysign(direction[axis]);
            normal = later.choose_vector(of_axis, normal);
            leave = leave.min(far);
        }
        Meeting { found: !(enter.at_most(all(0.0)) | enter.greater(leave)), distance: enter, normal }
    }

    /// The outline is a hexagon of edges, two along each axis: the one that the ray is farthest out of.
    #[inline(always)]
    fn pass<S: Simd>(half_m: WideVector<S>, origin: WideVector<S>, direction: WideVector<S>) -> Passing<S> {
        let all = |value| origin[0].all(value);
        let mut distance_m = all(f64::NEG_INFINITY);
        let mut normal = [all(1.0), all(0.0), all(0.0)];
        let mut along = normal;
        for edge in 0..3 {
            let (next, last) = ((edge + 1) % 3, (edge + 2) % 3);
            let length = (direction[next] * direction[next] + direction[last] * direction[last]).sqrt();
            let (u, v) = (-direction[last] / length, direction[next] / length);
            let out = u * origin[next] + v * origin[last];
            let beyond_m = out.abs() - half_m[next] * u.abs() - half_m[last] * v.abs();
            // One seen end-on has no length.
            let farther = !length.less(all(1e-6)) & beyond_m.greater(distance_m);
            distance_m = farther.choose(beyond_m, distance_m);
            let mirrored = out.less(all(0.0));
            let mut across = [all(0.0); 3];
            (across[next], across[last]) = (mirrored.choose(-u, u), mirrored.choose(-v, v));
            normal = farther.choose_vector(across, normal);
            let mut axis = [all(0.0); 3];
            axis[edge] = all(1.0);
            along = farther.choose_vector(axis, along);
        }
        // The edge's middle, then where along the edge the ray passes it.
        let [x, y, z] = [along[0].greater(all(0.5)), along[1].greater(all(0.5)), along[2].greater(all(0.5))];
        let middle_m = [
            x.choose(all(0.0), half_m[0].copysign(normal[0])),
            y.choose(all(0.0), half_m[1].copysign(normal[1])),
            z.choose(all(0.0), half_m[2].copysign(normal[2])),
        ];
        let offset = minus(origin, middle_m);
        let lean = y.choose(direction[1], z.choose(direction[2], direction[0]));
        let half_edge_m = y.choose(half_m[1], z.choose(half_m[2], half_m[0]));
        let level = y.choose(offset[1], z.choose(offset[2], offset[0]));
        let there = (level - dot(offset, direction) * lean) / (all(1.0) - lean * lean).max(all(1e-12));
        let share = there / half_edge_m;
        let there = there.clamp(-half_edge_m, half_edge_m);
        let point_m = [x.choose(there, middle_m[0]), y.choose(there, middle_m[1]), z.choose(there, middle_m[2])];
        Passing { distance_m, normal, point_m, along: share }
    }

    fn bounding_radius(half_m: &Vector3<f64>) -> f64 {
        half_m.norm()
    }
}
