use pulp::{Simd, WithSimd};

use crate::Neighbours;
use crate::neighbours::MAX_OTHERS;

/// Below this share of the largest possible value, the system of Eq. 4 is taken as singular. Returns on a straight line
/// reach 1e-10 by the rounding of `f32` coordinates, those of real surfaces 1e-7 and more.
const SINGULAR: f64 = 1e-9;

/// Points that are worked on side by side.
const LANES: usize = 8;

/// One number for each of them.
type Lanes = [f64; LANES];

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
        let mut first = 0;
        for (here, normals) in points.chunks(LANES).zip(normals.chunks_mut(LANES)) {
            let mut offsets = [[[0.0; LANES]; 3]; MAX_OTHERS];
            for (lane, point) in here.iter().enumerate() {
                for (offset, &other) in offsets.iter_mut().zip(neighbours.of(first + lane)) {
                    let other = points[other as usize];
                    for axis in 0..3 {
                        // Relative to the point: its neighbours are near, so nothing is lost in the differences.
                        offset[axis][lane] = f64::from(other[axis]) - f64::from(point[axis]);
                    }
                }
            }
            let mut at = [[0.0; LANES]; 3];
            for (lane, point) in here.iter().enumerate() {
                for axis in 0..3 {
                    at[axis][lane] = f64::from(point[axis]);
                }
            }
            let found = normals_at(&at, &offsets[..neighbours.each()]);
            for (lane, normal) in normals.iter_mut().enumerate() {
                *normal = std::array::from_fn(|axis| found[axis][lane]);
            }
            first += LANES;
        }
    }
}

/// The normals of points, each given with the offsets of its neighbours [m].
#[inline(always)]
fn normals_at(here: &[Lanes; 3], offsets: &[[Lanes; 3]]) -> [[f32; LANES]; 3] {
    let mut sum = [[0.0; LANES]; 3];
    for offset in offsets {
        for axis in 0..3 {
            for lane in 0..LANES {
                sum[axis][lane] += offset[axis][lane];
            }
        }
    }
    let count = offsets.len() as f64 + 1.0;
    let mean: [Lanes; 3] = sum.map(|sums| sums.map(|sum| sum / count));
    // xx, xy, xz, yy, yz, zz; the point itself is at 0.
    let mut scatter = [[0.0; LANES]; 6];
    for lane in 0..LANES {
        scatter_of([0.0; 3], &mean, lane, &mut scatter);
    }
    for offset in offsets {
        for lane in 0..LANES {
            scatter_of([offset[0][lane], offset[1][lane], offset[2][lane]], &mean, lane, &mut scatter);
        }
    }
    let mut normals = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let here = [here[0][lane], here[1][lane], here[2][lane]];
        let centre = std::array::from_fn(|axis| here[axis] + mean[axis][lane]);
        let normal = normal_of(scatter.map(|entry| entry[lane]), centre, here);
        for axis in 0..3 {
            normals[axis][lane] = normal[axis];
        }
    }
    normals
}

#[inline(always)]
fn scatter_of(offset: [f64; 3], mean: &[Lanes; 3], lane: usize, scatter: &mut [Lanes; 6]) {
    let (x, y, z) = (offset[0] - mean[0][lane], offset[1] - mean[1][lane], offset[2] - mean[2][lane]);
    scatter[0][lane] += x * x;
    scatter[1][lane] += x * y;
    scatter[2][lane] += x * z;
    scatter[3][lane] += y * y;
    scatter[4][lane] += y * z;
    scatter[5][lane] += z * z;
}

/// Eq. 4 for the scatter about a centre; without a branch, for it runs side by side.
#[inline(always)]
fn normal_of(scatter: [f64; 6], centre: [f64; 3], here: [f64; 3]) -> [f32; 3] {
    let normal = times_adjugate(scatter, centre); // Eq. (4)

    let trace = scatter[0] + scatter[3] + scatter[5];
    let length = norm(normal);
    let determined = is_normal(length) & (length > SINGULAR * trace * trace * norm(centre));
    // cᵀ adj(S) c is never negative but by rounding.
    let sign = if dot(normal, centre) < 0.0 { -1.0 } else { 1.0 };
    let range = norm(here);
    let has_view = is_normal(range);
    std::array::from_fn(|axis| {
        let view = if has_view { here[axis] / range } else { [0.0, 0.0, 1.0][axis] };
        (if determined { sign * normal[axis] / length } else { view }) as f32
    })
}

/// adj(S) c for a symmetric S, given as xx, xy, xz, yy, yz, zz.
#[inline(always)]
fn times_adjugate([xx, xy, xz, yy, yz, zz]: [f64; 6], c: [f64; 3]) -> [f64; 3] {
    let a = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
    let b = [a[1], xx * zz - xz * xz, xy * xz - xx * yz];
    let d = [a[2], b[2], xx * yy - xy * xy];
    [dot(a, c), dot(b, c), dot(d, c)]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

/// Whether a length is neither 0, nor so small that its digits are fewer, nor infinite, nor no number.
#[inline(always)]
fn is_normal(length: f64) -> bool {
    (length >= f64::MIN_POSITIVE) & (length < f64::INFINITY)
}
