use pulp::{Simd, WithSimd};

use crate::Neighbours;
use crate::lanes::{LANES, Lanes};
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
    fn with_simd<S: Simd>(self, _: S) {
        let Self { points, neighbours, normals } = self;
        let each = neighbours.each();
        for (group, (here, normals)) in points.chunks(LANES).zip(normals.chunks_mut(LANES)).enumerate() {
            let first = group * LANES;
            let (near, _) = neighbours.of_range(first..first + here.len());
            let mut at = [Lanes::splat(0.0); 3];
            let mut offsets = [[Lanes::splat(0.0); 3]; MAX_OTHERS];
            for (lane, point) in here.iter().enumerate() {
                for axis in 0..3 {
                    at[axis].0[lane] = f64::from(point[axis]);
                }
                for (offset, &other) in offsets.iter_mut().zip(&near[lane * each..]).take(each) {
                    for axis in 0..3 {
                        offset[axis].0[lane] = f64::from(points[other as usize][axis]);
                    }
                }
            }
            let offsets = &mut offsets[..each];
            for offset in offsets.iter_mut() {
                for axis in 0..3 {
                    // Relative to the point: its neighbours are near, so nothing is lost in the differences.
                    offset[axis] = offset[axis] - at[axis];
                }
            }
            let found = normals_at(at, offsets);
            for (lane, normal) in normals.iter_mut().enumerate() {
                *normal = std::array::from_fn(|axis| found[axis].0[lane] as f32);
            }
        }
    }
}

/// The normals of points, each given with the offsets of its neighbours [m].
#[inline(always)]
fn normals_at(here: [Lanes; 3], offsets: &[[Lanes; 3]]) -> [Lanes; 3] {
    let zero = [Lanes::splat(0.0); 3];
    let mut sum = zero;
    for offset in offsets {
        sum = std::array::from_fn(|axis| sum[axis] + offset[axis]);
    }
    let count = Lanes::splat(offsets.len() as f64 + 1.0);
    let mean = sum.map(|sum| sum / count);
    let mut scatter = [zero[0]; 6]; // xx, xy, xz, yy, yz, zz
    for offset in std::iter::once(&zero).chain(offsets) {
        let [x, y, z] = std::array::from_fn(|axis| offset[axis] - mean[axis]);
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        scatter = std::array::from_fn(|entry| scatter[entry] + products[entry]);
    }
    let centre = std::array::from_fn(|axis| here[axis] + mean[axis]);
    let normal = times_adjugate(scatter, centre); // Eq. (4)

    let trace = scatter[0] + scatter[3] + scatter[5];
    let length = norm(normal);
    let regular = length.greater(Lanes::splat(SINGULAR) * trace * trace * norm(centre));
    let normal_length = length.is_normal();
    let determined = std::array::from_fn(|lane| regular[lane] & normal_length[lane]);
    // cᵀ adj(S) c is never negative but by rounding.
    let sign = dot(normal, centre).map(|product| if product < 0.0 { -1.0 } else { 1.0 });
    let range = norm(here);
    let has_view = range.is_normal();
    std::array::from_fn(|axis| {
        let view = (here[axis] / range).or(has_view, Lanes::splat([0.0, 0.0, 1.0][axis]));
        (sign * normal[axis] / length).or(determined, view)
    })
}

/// adj(S) c for a symmetric S, given as xx, xy, xz, yy, yz, zz.
#[inline(always)]
fn times_adjugate([xx, xy, xz, yy, yz, zz]: [Lanes; 6], c: [Lanes; 3]) -> [Lanes; 3] {
    let a = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
    let b = [a[1], xx * zz - xz * xz, xy * xz - xx * yz];
    let d = [a[2], b[2], xx * yy - xy * xy];
    [dot(a, c), dot(b, c), dot(d, c)]
}

#[inline(always)]
fn dot(a: [Lanes; 3], b: [Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn norm(v: [Lanes; 3]) -> Lanes {
    dot(v, v).sqrt()
}
