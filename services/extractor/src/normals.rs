use crate::Neighbours;

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
    for (index, (point, normal)) in points.iter().zip(normals).enumerate() {
        *normal = normal_at(*point, neighbours.of(index).iter().map(|&other| points[other as usize]));
    }
}

fn normal_at(point: [f32; 3], others: impl Iterator<Item = [f32; 3]> + Clone) -> [f32; 3] {
    // Relative to the point: its neighbours are near, so nothing is lost in the differences.
    let here = point.map(f64::from);
    let offsets = others.map(|other| std::array::from_fn(|axis| f64::from(other[axis]) - here[axis]));
    let mut sum = [0.0; 3];
    let mut count = 1.0;
    for offset in offsets.clone() {
        sum = plus(sum, offset);
        count += 1.0;
    }
    let mean = sum.map(|s| s / count);
    let mut scatter = [0.0; 6]; // xx, xy, xz, yy, yz, zz
    for offset in std::iter::once([0.0; 3]).chain(offsets) {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| offset[axis] - mean[axis]);
        for (entry, product) in scatter.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *entry += product;
        }
    }
    let centre = plus(here, mean);
    let normal = times_adjugate(scatter, centre); // Eq. (4)

    let trace = scatter[0] + scatter[3] + scatter[5];
    let length = norm(normal);
    let singular = length <= SINGULAR * trace * trace * norm(centre) || !length.is_normal();
    if singular {
        return unit(here).unwrap_or([0.0, 0.0, 1.0]).map(|c| c as f32);
    }
    // cᵀ adj(S) c is never negative but by rounding.
    let sign = if dot(normal, centre) < 0.0 { -1.0 } else { 1.0 };
    normal.map(|c| (sign * c / length) as f32)
}

/// adj(S) c for a symmetric S, given as xx, xy, xz, yy, yz, zz.
fn times_adjugate([xx, xy, xz, yy, yz, zz]: [f64; 6], c: [f64; 3]) -> [f64; 3] {
    let a = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
    let b = [a[1], xx * zz - xz * xz, xy * xz - xx * yz];
    let d = [a[2], b[2], xx * yy - xy * xy];
    [dot(a, c), dot(b, c), dot(d, c)]
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = norm(v);
    (length.is_normal()).then(|| v.map(|c| c / length))
}
