use nalgebra::{Matrix3, Vector3};

use super::system::{System, parameters};
use super::{Beliefs, Body, Ray, UnitSolid};

/// How hits are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    /// By their distance along the surface's normal: well-behaved far from the solution.
    Near,
    /// By range along the ray, large residuals softened: the likelihood.
    Range,
}

/// What a body is fitted to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays<'a> {
    pub(crate) hits: &'a [Ray],
    pub(crate) misses: &'a [Ray],
    /// Standard deviation of a range [m].
    pub(crate) sigma_m: f64,
    pub(crate) beliefs: &'a Beliefs,
}

impl Rays<'_> {
    /// Residuals that one evaluation costs.
    pub(crate) fn count(&self) -> usize {
        self.hits.len() + self.misses.len()
    }
}

/// Sums by kind of residual.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Parts {
    pub(crate) hits: f64,
    pub(crate) misses: f64,
    pub(crate) beliefs: f64,
    /// Hits off by more than 3 standard deviations.
    pub(crate) strayed: u32,
    /// Misses that the body is in the way of.
    pub(crate) violated: u32,
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

/// Sum of squares of all residuals of a body, with first derivatives.
///
/// A hit: range of the body along its ray less the range measured; where the ray passes the body by, its distance from the
/// outline. A miss that the body is in the way of: its depth within the outline. Beliefs: ln of the half extents about their
/// mean, and the mean.
///
/// Stops where the sum reaches `limit`: what it gives then costs that much or more, and says nothing else.
pub(crate) fn measure<S: UnitSolid>(body: &Body, rays: &Rays<'_>, how: Measure, limit: f64) -> (System, Parts) {
    let mut system = System::zero();
    let mut parts = Parts::default();
    let sight = Sight::new(body);
    for ray in rays.hits {
        let (residual, factor, normal, point) = hit::<S>(&sight, ray, rays.sigma_m, how);
        parts.strayed += u32::from(residual.abs() > BEFORE);
        parts.hits += residual * residual;
        system.add(S::ROUND, residual, factor, &normal, &point);
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
            system.add(S::ROUND, residual, factor, &normal, &point);
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
#[inline(always)]
fn hit<S: UnitSolid>(sight: &Sight, ray: &Ray, sigma_m: f64, how: Measure) -> Residual {
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
#[inline(always)]
fn miss<S: UnitSolid>(sight: &Sight, ray: &Ray, sigma_m: f64, how: Measure) -> Option<Residual> {
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

/// Adds what is believed of a body's half extents: their spread about their mean, and the mean.
fn believe(system: &mut System, ln_half: &Vector3<f64>, round: bool, beliefs: &Beliefs) {
    let (count, values) = if round { (2, [ln_half.x, ln_half.z, 0.0]) } else { (3, [ln_half.x, ln_half.y, ln_half.z]) };
    let first = parameters(round) - count;
    let share = 1.0 / count as f64;
    let mean = values[..count].iter().sum::<f64>() * share;
    for (k, value) in values[..count].iter().enumerate() {
        let own = |j| if j == k { 1.0 } else { 0.0 };
        let row: [f64; 3] = std::array::from_fn(|j| (own(j) - share) / beliefs.ln_proportion_sigma);
        system.add_sizes(first, count, (value - mean) / beliefs.ln_proportion_sigma, &row);
    }
    let row = [share / beliefs.ln_half_sigma; 3];
    system.add_sizes(first, count, (mean - beliefs.ln_half_mean) / beliefs.ln_half_sigma, &row);
}

#[cfg(test)]
mod tests;
