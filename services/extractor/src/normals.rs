use pulp::{Simd, WithSimd};

use crate::Neighbours;
use crate::lanes::{LANES, Lanes, Row};
use crate::neighbours::MAX_OTHERS;

/// Below this share of the largest possible value, the system of Eq. 4 is taken as singular. Returns on a straight line
/// reach 1e-10 by the rounding of `f32` coordinates, those of real surfaces 1e-7 and more.
const SINGULAR: f64 = 1e-9;

/// Normals of a cluster's points by unconstrained least squares, Eq. 4: n = M⁻¹b with M = Σ p pᵀ, b = Σ p over the
/// point and its neighbours. Writes unit vectors, sensor frame, one for each of `points` [m].
///
/// n·p = 1 over the fitted plane, so every normal points away from the sensor: the sign is consistent.
///
/// M is near-singular whenever the surface is flat against its range, so Eq. 4 is not solved as it stands. With the
/// mean c and the scatter S = Σ (p − c)(p − c)ᵀ, M = S + k c cᵀ and b = k c, so M⁻¹b is parallel to S⁻¹c
/// (Sherman and Morrison), and that to adj(S) c, which needs no division and is exact on a plane, where S is singular.
///
/// Where adj(S) c vanishes (all points on one line, or on a plane through the sensor, or fewer than three points) no
/// normal is determined: the direction from the sensor to the point stands in for it; +z for a point at the sensor.
pub fn estimate_normals(points: &[[f32; 3]], neighbours: &Neighbours, normals: &mut [[f32; 3]]) {
    neighbours.arch().dispatch(Estimate { points, neighbours, normals });
}

struct Estimate<'a> {
    points: &'a [[f32; 3]],
    neighbours: &'a Neighbours,
    normals: &'a mut [[f32; 3]],
}

impl WithSimd for Estimate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { points, neighbours, normals } = self;
        let each = neighbours.each();
        for (group, (here, normals)) in points.chunks(LANES).zip(normals.chunks_mut(LANES)).enumerate() {
            let first = group * LANES;
            let (near, _) = neighbours.of_range(first..first + here.len());
            let (mut at, mut others) = (Group::default(), [Group::default(); MAX_OTHERS]);
            for (lane, &point) in here.iter().enumerate() {
                at.put(lane, point);
                for (group, &other) in others.iter_mut().zip(&near[lane * each..]).take(each) {
                    group.put(lane, points[other as usize]);
                }
            }
            let mut found = Group::default();
            for place in 0..Lanes::<S>::OF_ROW {
                let here = at.get(simd, place);
                let mut offsets = [[Lanes::splat(simd, 0.0); 3]; MAX_OTHERS];
                for (offset, other) in offsets.iter_mut().zip(&others).take(each) {
                    let there = other.get(simd, place);
                    for axis in 0..3 {
                        // Relative to the point: its neighbours are near, so nothing is lost in the differences.
                        offset[axis] = there[axis] - here[axis];
                    }
                }
                let normals = normals_at(simd, here, &offsets[..each]);
                for (normal, row) in normals.into_iter().zip(&mut found.0) {
                    normal.store(row, place);
                }
            }
            for (lane, normal) in normals.iter_mut().enumerate() {
                *normal = [found.0[0].0[lane] as f32, found.0[1].0[lane] as f32, found.0[2].0[lane] as f32];
            }
        }
    }
}

/// Vectors side by side.
#[derive(Clone, Copy, Default)]
struct Group([Row<f64>; 3]);

impl Group {
    #[inline(always)]
    fn put(&mut self, lane: usize, vector: [f32; 3]) {
        for (row, value) in self.0.iter_mut().zip(vector) {
            row.0[lane] = f64::from(value);
        }
    }

    #[inline(always)]
    fn get<S: Simd>(&self, simd: S, place: usize) -> [Lanes<S>; 3] {
        let [x, y, z] = &self.0;
        [Lanes::load(simd, x, place), Lanes::load(simd, y, place), Lanes::load(simd, z, place)]
    }
}

/// The normals of points, each given with the offsets of its neighbours [m].
#[inline(always)]
fn normals_at<S: Simd>(simd: S, here: [Lanes<S>; 3], offsets: &[[Lanes<S>; 3]]) -> [Lanes<S>; 3] {
    let splat = |value| Lanes::splat(simd, value);
    let zero = [splat(0.0); 3];
    let mut mean = zero;
    for offset in offsets {
        for axis in 0..3 {
            mean[axis] = mean[axis] + offset[axis];
        }
    }
    let count = splat(offsets.len() as f64 + 1.0);
    let mut centre = here;
    for axis in 0..3 {
        mean[axis] = mean[axis] / count;
        centre[axis] = here[axis] + mean[axis];
    }
    let mut scatter = [zero[0]; 6]; // xx, xy, xz, yy, yz, zz
    for offset in std::iter::once(&zero).chain(offsets) {
        let [x, y, z] = [offset[0] - mean[0], offset[1] - mean[1], offset[2] - mean[2]];
        for (sum, product) in scatter.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum = *sum + product;
        }
    }
    let mut normal = times_adjugate(scatter, centre); // Eq. (4)

    let (one, none) = (splat(1.0), splat(0.0));
    let trace = scatter[0] + scatter[3] + scatter[5];
    let length = norm(normal);
    let regular = (splat(SINGULAR) * trace * trace * norm(centre)).if_less(length, one, none);
    let determined = length.if_normal(regular, none);
    // cᵀ adj(S) c is never negative but by rounding.
    let sign = dot(normal, centre).if_less(none, splat(-1.0), one);
    for component in &mut normal {
        *component = sign * *component / length;
    }
    if determined.any_less(one) {
        let range = norm(here);
        for (axis, up) in [0.0, 0.0, 1.0].into_iter().enumerate() {
            let view = range.if_normal(here[axis] / range, splat(up));
            normal[axis] = determined.if_less(one, view, normal[axis]);
        }
    }
    normal
}

/// adj(S) c for a symmetric S, given as xx, xy, xz, yy, yz, zz.
#[inline(always)]
fn times_adjugate<S: Simd>([xx, xy, xz, yy, yz, zz]: [Lanes<S>; 6], c: [Lanes<S>; 3]) -> [Lanes<S>; 3] {
    let a = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
    let b = [a[1], xx * zz - xz * xz, xy * xz - xx * yz];
    let d = [a[2], b[2], xx * yy - xy * xy];
    [dot(a, c), dot(b, c), dot(d, c)]
}

#[inline(always)]
fn dot<S: Simd>(a: [Lanes<S>; 3], b: [Lanes<S>; 3]) -> Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn norm<S: Simd>(v: [Lanes<S>; 3]) -> Lanes<S> {
    dot(v, v).sqrt()
}
