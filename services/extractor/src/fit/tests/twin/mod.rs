//! The fit's residuals one ray at a time: what the wide ones must equal to the bit.

mod cone;
mod cuboid;
mod cylinder;
mod ellipsoid;
mod silhouette;

use nalgebra::{Matrix3, Vector3};

pub(crate) use self::silhouette::Passing;
use crate::fit::residuals::{Measure, Parts, believe};
use crate::fit::system::{MOST, System, parameters};
use crate::fit::{Beliefs, Body, Kind, Ray};

/// Where a ray meets a surface first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// Multiple of the ray's direction.
    pub(crate) distance: f64,
    /// Outward normal there, of any length.
    pub(crate) normal: Vector3<f64>,
}

/// A solid as one ray sees it.
pub(crate) trait Twin {
    const ROUND: bool;
    fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting>;
    fn pass(half_m: &Vector3<f64>, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Passing;
    fn bounding_radius(half_m: &Vector3<f64>) -> f64;
}

/// What a body is fitted to, ray by ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays<'a> {
    pub(crate) hits: &'a [Ray],
    pub(crate) misses: &'a [Ray],
    pub(crate) sigma_m: f64,
    pub(crate) beliefs: &'a Beliefs,
}

/// As the fit's `measure`.
pub(crate) fn measure(kind: Kind, body: &Body, rays: &Rays<'_>, how: Measure, limit: f64) -> (System, Parts) {
    match kind {
        Kind::Cuboid => measure_as::<cuboid::Cuboid>(body, rays, how, limit),
        Kind::Ellipsoid => measure_as::<ellipsoid::Ellipsoid>(body, rays, how, limit),
        Kind::Cylinder => measure_as::<cylinder::Cylinder>(body, rays, how, limit),
        Kind::Cone => measure_as::<cone::Cone>(body, rays, how, limit),
    }
}

/// Least |cosine| between a ray and a normal in a derivative: a grazing ray's range would jump with every step.
const GRAZING: f64 = 0.02;
/// Residual of a hit that the body is not in the way of, at its outline.
const BESIDE: f64 = 3.0;
/// How much faster it grows with the distance than a range does: directions are known better than ranges.
const BESIDE_GROWTH: f64 = 2.0;
/// Residual of a miss that the body is in the way of, at its outline.
const IN_THE_WAY: f64 = 0.5;
/// A miss is violated when the body lies this many standard deviations before its end.
const BEFORE: f64 = 3.0;
/// Residual from which on it is softened.
const SOFT: f64 = 4.0;

fn measure_as<S: Twin>(body: &Body, rays: &Rays<'_>, how: Measure, limit: f64) -> (System, Parts) {
    let mut system = System::zero();
    let mut parts = Parts::default();
    let sight = Sight::new(body);
    for ray in rays.hits {
        let (residual, factor, normal, point) = hit::<S>(&sight, ray, rays.sigma_m, how);
        parts.strayed += u32::from(residual.abs() > BEFORE);
        parts.hits += residual * residual;
        add(&mut system, S::ROUND, residual, factor, &normal, &point);
        if system.cost >= limit {
            return (system, parts);
        }
    }
    let radius_m = S::bounding_radius(&sight.half_m);
    for ray in rays.misses {
        let along_m = body.centre_m.dot(&ray.direction);
        let off_m2 = body.centre_m.norm_squared() - along_m * along_m;
        if along_m - radius_m > ray.range_m || off_m2 > radius_m * radius_m {
            continue;
        }
        if let Some((residual, factor, normal, point)) = miss::<S>(&sight, ray, rays.sigma_m, how) {
            parts.violated += 1;
            parts.misses += residual * residual;
            add(&mut system, S::ROUND, residual, factor, &normal, &point);
            if system.cost >= limit {
                return (system, parts);
            }
        }
    }
    let before = system.cost;
    believe(&mut system, &body.ln_half, S::ROUND, rays.beliefs);
    parts.beliefs = system.cost - before;
    (system, parts)
}

/// The sensor as the body sees it.
struct Sight {
    to_body: Matrix3<f64>,
    half_m: Vector3<f64>,
    per_half: Vector3<f64>,
    /// The sensor, body frame [m].
    origin: Vector3<f64>,
    /// The sensor in units of the half extents.
    unit_origin: Vector3<f64>,
}

impl Sight {
    fn new(body: &Body) -> Self {
        let to_body = body.rotation.transpose();
        let half_m = body.ln_half.map(f64::exp);
        let per_half = half_m.map(|half| 1.0 / half);
        let origin = -(to_body * body.centre_m);
        Self { to_body, half_m, per_half, origin, unit_origin: origin.component_mul(&per_half) }
    }
}

/// Residual, what it changes by when the surface moves outwards by 1 m, and the surface's normal and point, body frame.
type Residual = (f64, f64, Vector3<f64>, Vector3<f64>);

/// Residual of a ray that ended on the cluster: met by the body, or beside it.
fn hit<S: Twin>(sight: &Sight, ray: &Ray, sigma_m: f64, how: Measure) -> Residual {
    let per_m = 1.0 / sigma_m;
    let direction = sight.to_body * ray.direction;
    let unit_direction = direction.component_mul(&sight.per_half);
    let Some(meeting) = S::meet(&sight.unit_origin, &unit_direction) else {
        let passing = S::pass(&sight.half_m, &sight.origin, &direction);
        let beside = passing.distance_m.max(0.0) * per_m;
        return match how {
            Measure::Near => (beside, -per_m, passing.normal, passing.point_m),
            Measure::Range => {
                let (residual, slope) = soften(BESIDE + BESIDE_GROWTH * beside);
                (residual, -BESIDE_GROWTH * per_m * slope, passing.normal, passing.point_m)
            }
        };
    };
    // A cone's apex has no normal.
    let normal = meeting.normal.component_mul(&sight.per_half).try_normalize(0.0).unwrap_or(-direction);
    let point = sight.origin + direction * meeting.distance;
    let beyond = (meeting.distance - ray.range_m) * per_m;
    // The normal looks towards the sensor: when the surface moves out by 1 m, the range changes by 1/cosine.
    let cosine = normal.dot(&direction).min(-GRAZING);
    match how {
        Measure::Near => (-beyond * cosine, -per_m, normal, point),
        Measure::Range => {
            let (residual, slope) = soften(beyond);
            (residual, per_m / cosine * slope, normal, point)
        }
    }
}

/// Residual of a ray that passed the cluster by; none where the body is not in its way.
fn miss<S: Twin>(sight: &Sight, ray: &Ray, sigma_m: f64, how: Measure) -> Option<Residual> {
    let per_m = 1.0 / sigma_m;
    let direction = sight.to_body * ray.direction;
    let meeting = S::meet(&sight.unit_origin, &direction.component_mul(&sight.per_half))?;
    if meeting.distance > ray.range_m - BEFORE * sigma_m {
        return None;
    }
    let passing = S::pass(&sight.half_m, &sight.origin, &direction);
    let depth = (-passing.distance_m).max(0.0) * per_m;
    let (residual, slope) = match how {
        Measure::Near => (depth, 1.0),
        Measure::Range => soften(depth + IN_THE_WAY),
    };
    Some((residual, per_m * slope, passing.normal, passing.point_m))
}

/// A residual whose size grows with its logarithm only beyond [`SOFT`], and the slope.
fn soften(residual: f64) -> (f64, f64) {
    let excess = residual.abs() - (SOFT - 1.0);
    if excess <= 1.0 {
        return (residual, 1.0);
    }
    ((SOFT + excess.ln()).copysign(residual), 1.0 / excess)
}

/// Adds a residual whose derivative is `factor` times the way outward along `normal` of the surface's point.
fn add(system: &mut System, round: bool, residual: f64, factor: f64, normal: &Vector3<f64>, point: &Vector3<f64>) {
    let row = row(round, factor, normal, point);
    system.cost += residual * residual;
    let count = parameters(round);
    for i in 0..count {
        system.gradient[i] += row[i] * residual;
        for j in 0..=i {
            system.curvature[i][j] += row[i] * row[j];
        }
    }
}

fn row(round: bool, factor: f64, normal: &Vector3<f64>, point: &Vector3<f64>) -> [f64; MOST] {
    let n = normal * factor;
    let turn = point.cross(&n);
    let grow = n.component_mul(point);
    if round {
        [n.x, n.y, n.z, turn.x, turn.y, grow.x + grow.y, grow.z, 0.0, 0.0]
    } else {
        [n.x, n.y, n.z, turn.x, turn.y, turn.z, grow.x, grow.y, grow.z]
    }
}
