//! Residuals of single rays, many rays side by side.

use nalgebra::Vector3;
use pulp::Simd;

use super::rays::MOST_LANES;
use super::residuals::Measure;
use super::system::{MOST, Row, parameters};
use super::wide::{Which, Wide, WideVector, along, cross, dot, minus, norm, opposite, plus, scale, shrink, times};
use super::{Body, UnitSolid};

/// Least |cosine| between a ray and a normal in a derivative: a grazing ray's range would jump with every step.
const GRAZING: f64 = 0.02;
/// Residual of a hit that the body is not in the way of, at its outline.
const BESIDE: f64 = 3.0;
/// How much faster it grows with the distance than a range does: directions are known better than ranges.
const BESIDE_GROWTH: f64 = 2.0;
/// Residual of a miss that the body is in the way of, at its outline.
const IN_THE_WAY: f64 = 0.5;
/// A miss is violated when the body lies this many standard deviations before its end.
pub(crate) const BEFORE: f64 = 3.0;
/// Residual from which on it is softened.
const SOFT: f64 = 4.0;

/// Share of an edge, about its middle, that a ray beside it bounds: at the ends the body could grow past the ray.
const WITHIN: f64 = 0.9;

/// The sensor as the body sees it.
pub(crate) struct Sight<S: Simd> {
    /// The body's middle [m], sensor frame.
    centre_m: WideVector<S>,
    /// Columns of the rotation from the sensor's frame to the body's.
    to_body: [WideVector<S>; 3],
    half_m: WideVector<S>,
    per_half: WideVector<S>,
    /// The sensor, body frame [m].
    origin: WideVector<S>,
    /// The sensor in units of the half extents.
    unit_origin: WideVector<S>,
    /// Of the ball round the body's middle that holds it [m].
    radius_m: f64,
    sigma_m: f64,
    per_m: f64,
}

impl<S: Simd> Sight<S> {
    #[inline(always)]
    pub(crate) fn new<K: UnitSolid>(simd: S, body: &Body, sigma_m: f64) -> Self {
        let to_body = body.rotation.transpose();
        let half_m = body.ln_half.map(f64::exp);
        let per_half = half_m.map(|half| 1.0 / half);
        let origin = -(to_body * body.centre_m);
        let wide = |v: &Vector3<f64>| [Wide::splat(simd, v.x), Wide::splat(simd, v.y), Wide::splat(simd, v.z)];
        let column = |at: usize| wide(&to_body.column(at).into_owned());
        Self {
            centre_m: wide(&body.centre_m),
            to_body: [column(0), column(1), column(2)],
            half_m: wide(&half_m),
            per_half: wide(&per_half),
            origin: wide(&origin),
            unit_origin: wide(&origin.component_mul(&per_half)),
            radius_m: K::bounding_radius(&half_m),
            sigma_m,
            per_m: 1.0 / sigma_m,
        }
    }

    #[inline(always)]
    pub(crate) fn all(&self, value: f64) -> Wide<S> {
        self.origin[0].all(value)
    }

    /// Directions as the body sees them, in metres and in units of the half extents.
    #[inline(always)]
    fn directions(&self, direction: WideVector<S>) -> (WideVector<S>, WideVector<S>) {
        let [a, b, c] = self.to_body;
        let [x, y, z] = direction;
        let direction = plus(plus(scale(a, x), scale(b, y)), scale(c, z));
        (direction, times(direction, self.per_half))
    }
}

/// Residuals of some rays, what they change by when the surface moves outwards by 1 m, and the surface's normals and points,
/// body frame.
pub(crate) struct Residuals<S: Simd> {
    residual: Wide<S>,
    factor: Wide<S>,
    normal: WideVector<S>,
    point: WideVector<S>,
}

impl<S: Simd> Residuals<S> {
    /// Derivatives with respect to all parameters, and the residual after them: a row of each ray.
    #[inline(always)]
    pub(crate) fn store<const ROUND: bool>(&self, rows: &mut [Row; MOST_LANES]) {
        self.each::<ROUND>(|values, place| put(values, rows, place));
        put(self.residual, rows, parameters(ROUND));
    }

    /// Derivatives with respect to all parameters, parameter by parameter, from a lane on.
    #[inline(always)]
    pub(crate) fn store_columns<const ROUND: bool>(&self, columns: &mut [[f64; MOST_LANES]; MOST], lane: usize) {
        self.each::<ROUND>(|values, place| values.store(&mut columns[place][lane..]));
    }

    #[inline(always)]
    fn each<const ROUND: bool>(&self, mut put: impl FnMut(Wide<S>, usize)) {
        let normal = scale(self.normal, self.factor);
        let turn = cross(self.point, normal);
        let grow = times(normal, self.point);
        put(normal[0], 0);
        put(normal[1], 1);
        put(normal[2], 2);
        put(turn[0], 3);
        put(turn[1], 4);
        if ROUND {
            put(grow[0] + grow[1], 5);
            put(grow[2], 6);
        } else {
            put(turn[2], 5);
            put(grow[0], 6);
            put(grow[1], 7);
            put(grow[2], 8);
        }
    }

    /// These where chosen, else the others.
    #[inline(always)]
    fn or(self, chosen: Which<S>, other: Self) -> Self {
        Self {
            residual: chosen.choose(self.residual, other.residual),
            factor: chosen.choose(self.factor, other.factor),
            normal: chosen.choose_vector(self.normal, other.normal),
            point: chosen.choose_vector(self.point, other.point),
        }
    }
}

/// Puts each ray's number at `place` of its row.
#[inline(always)]
fn put<S: Simd>(values: Wide<S>, rows: &mut [Row; MOST_LANES], place: usize) {
    let mut lanes = [0.0; MOST_LANES];
    values.store(&mut lanes);
    for (row, lane) in rows.iter_mut().zip(lanes).take(S::F64_LANES) {
        row.0[place] = lane;
    }
}

/// Residuals of rays that ended on the cluster: met by the body, or beside it.
#[inline(always)]
pub(crate) fn hit<K: UnitSolid, S: Simd>(
    sight: &Sight<S>,
    rays: (WideVector<S>, Wide<S>),
    how: Measure,
) -> Residuals<S> {
    let (direction, range_m) = rays;
    let (direction, unit_direction) = sight.directions(direction);
    let meeting = K::meet(sight.unit_origin, unit_direction);
    let normal = times(meeting.normal, sight.per_half);
    let length = norm(normal);
    // A cone's apex has no normal.
    let normal = length.at_most(sight.all(0.0)).choose_vector(opposite(direction), shrink(normal, length));
    let point = along(sight.origin, direction, meeting.distance);
    let per_m = sight.all(sight.per_m);
    let beyond = (meeting.distance - range_m) * per_m;
    // The normal looks towards the sensor: when the surface moves out by 1 m, the range changes by 1/cosine.
    let cosine = dot(normal, direction).min(sight.all(-GRAZING));
    let met = match how {
        Measure::Near => Residuals { residual: -beyond * cosine, factor: -per_m, normal, point },
        Measure::Range => {
            let (residual, slope) = soften(meeting.found.choose(beyond, sight.all(0.0)));
            Residuals { residual, factor: per_m / cosine * slope, normal, point }
        }
    };
    if !(!meeting.found).any() {
        return met;
    }
    let passing = K::pass(sight.half_m, sight.origin, direction);
    let (normal, point) = (passing.normal, passing.point_m);
    let beside = passing.distance_m.max(sight.all(0.0)) * per_m;
    let passed = match how {
        Measure::Near => Residuals { residual: beside, factor: -per_m, normal, point },
        Measure::Range => {
            let beside = sight.all(BESIDE) + sight.all(BESIDE_GROWTH) * beside;
            let (residual, slope) = soften(meeting.found.choose(sight.all(0.0), beside));
            Residuals { residual, factor: sight.all(-BESIDE_GROWTH) * per_m * slope, normal, point }
        }
    };
    met.or(meeting.found, passed)
}

/// Residuals of rays that passed the cluster by, and which of them the body is in the way of; none where it is of none.
#[inline(always)]
pub(crate) fn miss<K: UnitSolid, S: Simd>(
    sight: &Sight<S>,
    rays: (WideVector<S>, Wide<S>),
    how: Measure,
) -> Option<(Which<S>, Residuals<S>)> {
    let (direction, range_m) = rays;
    let radius_m = sight.all(sight.radius_m);
    let along_m = dot(sight.centre_m, direction);
    let off_m2 = dot(sight.centre_m, sight.centre_m) - along_m * along_m;
    let near = !((along_m - radius_m).greater(range_m) | off_m2.greater(radius_m * radius_m));
    if !near.any() {
        return None;
    }
    let (direction, unit_direction) = sight.directions(direction);
    let meeting = K::meet(sight.unit_origin, unit_direction);
    let before_m = range_m - sight.all(BEFORE * sight.sigma_m);
    let violated = near & meeting.found & !meeting.distance.greater(before_m);
    if !violated.any() {
        return None;
    }
    let passing = K::pass(sight.half_m, sight.origin, direction);
    let per_m = sight.all(sight.per_m);
    let depth = (-passing.distance_m).max(sight.all(0.0)) * per_m;
    let (residual, slope) = match how {
        Measure::Near => (depth, sight.all(1.0)),
        Measure::Range => soften(violated.choose(depth + sight.all(IN_THE_WAY), sight.all(0.0))),
    };
    let residuals = Residuals { residual, factor: per_m * slope, normal: passing.normal, point: passing.point_m };
    Some((violated, residuals))
}

/// Bounds that rays set to the body's outline: from within where they met the cluster, else from without. Which of them are
/// nearer than `reach_m`, how far they are off [m] (positive on the side where they should be), and how fast the outline
/// moves towards them.
///
/// A ray bounds where it would have met the body: before its end, and not off the end of an edge, where another one bounds.
#[inline(always)]
pub(crate) fn bound<K: UnitSolid, S: Simd>(
    sight: &Sight<S>,
    rays: (WideVector<S>, Wide<S>),
    within: bool,
    reach_m: f64,
) -> (Which<S>, Wide<S>, Residuals<S>) {
    let (direction, range_m) = rays;
    let (direction, _) = sight.directions(direction);
    let passing = K::pass(sight.half_m, sight.origin, direction);
    let factor = sight.all(if within { -1.0 } else { 1.0 });
    let slack_m = passing.distance_m * factor;
    let mut near = slack_m.less(sight.all(reach_m));
    if !within {
        let there_m = dot(minus(passing.point_m, sight.origin), direction);
        near = near & there_m.less(range_m) & passing.along.abs().at_most(sight.all(WITHIN));
    }
    (near, slack_m, Residuals { residual: slack_m, factor, normal: passing.normal, point: passing.point_m })
}

/// Residuals whose size grows with their logarithm only beyond [`SOFT`], and the slopes. A logarithm takes long: rays that
/// do not count have residuals of 0.
#[inline(always)]
pub(crate) fn soften<S: Simd>(residual: Wide<S>) -> (Wide<S>, Wide<S>) {
    let one = residual.all(1.0);
    let excess = residual.abs() - residual.all(SOFT - 1.0);
    let hard = excess.at_most(one);
    if !(!hard).any() {
        return (residual, one);
    }
    let soft = (residual.all(SOFT) + hard.choose(one, excess).ln()).copysign(residual);
    (hard.choose(residual, soft), hard.choose(one, one / excess))
}
