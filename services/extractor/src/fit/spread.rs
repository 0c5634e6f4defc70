//! How far the truth may lie from a fitted body.

use nalgebra::{SVector, Vector3};

use super::UnitSolid;
use super::bounds::Bounds;
use super::descent::Descent;
use super::outcome::Square;
use super::outline::second_moment;
use super::residuals::{Measure, Rays, measure};
use super::system::{MOST, parameters};

/// Cosine between axis and line of sight from which on a body is tried longer: of round ones, of others.
const AWAY: [f64; 2] = [0.5, 0.8];
/// How much longer, as a share of its length, and the range of lengths that each try stands for.
const LONGER: [(f64, f64); 3] = [(0.5, 0.5), (1.0, 0.75), (2.0, 1.5)];
/// Likelihood over the fit's below which a body does not count.
const UNLIKELY: f64 = 0.01;

/// Covariance of the fit's parameters about the fit, in their own order, by the best descent of a solid and the `others`;
/// none where it is no number.
///
/// - What rays leave ([`second_moment`]); wider where ranges are off by more than their noise explains, by that ratio
///   (Birge 1932).
/// - What lies behind ([`stretch`]): bounds are straight, and how an outline changes with what is seen aslant is not.
/// - Other minima, as likely as they are.
pub(crate) fn spread<'a, K: UnitSolid>(
    best: &Descent,
    others: impl Iterator<Item = &'a Descent>,
    rays: &Rays<'_>,
    bounds: &mut Bounds,
) -> Option<Square> {
    let excess = best.parts.hits / rays.hits.len().max(1) as f64;
    let mut covariance = second_moment::<K>(best, rays, bounds)? * excess.max(1.0);
    stretch::<K>(best, rays, &mut covariance);
    mix::<K>(best, others, &mut covariance);
    let sound = (0..parameters(K::ROUND)).all(|place| covariance[(place, place)] > 0.0);
    (sound && covariance.iter().all(|entry| entry.is_finite())).then_some(covariance)
}

/// Widens the covariance of a body whose far end may as well be farther away.
///
/// Along the axis nearest to the line of sight (of a round body: its own) the body is made longer, its near end kept, and
/// measured again: what is as likely as the fit counts as much.
fn stretch<K: UnitSolid>(best: &Descent, rays: &Rays<'_>, covariance: &mut Square) {
    let body = &best.body;
    let Some(sight) = body.centre_m.try_normalize(1e-9) else { return };
    let view = body.rotation.tr_mul(&sight);
    let axis = if K::ROUND { 2 } else { view.iamax() };
    if view[axis].abs() < AWAY[usize::from(!K::ROUND)] {
        return;
    }
    let growth = parameters(K::ROUND) + axis - 3;
    let away_m = body.ln_half[axis].exp().copysign(view[axis]);
    // As much as the whole of a normal distribution: a range of this length, all as likely as its middle.
    let mut weight = (std::f64::consts::TAU * covariance[(growth, growth)].max(0.0)).sqrt();
    let mut moment = 0.0;
    for (longer, range) in LONGER {
        let mut tried = *body;
        tried.ln_half[axis] += longer.ln_1p();
        tried.centre_m += body.rotation * Vector3::ith(axis, away_m * longer);
        let limit = best.cost() - 2.0 * UNLIKELY.ln();
        let likelihood = likelihood(best.cost(), measure::<K>(&tried, rays, Measure::Range, limit).0.cost);
        if likelihood <= UNLIKELY {
            break;
        }
        weight += likelihood * range;
        moment += likelihood * range * longer * longer;
    }
    if moment > 0.0 {
        // As its length grows by all of it, its middle moves by half.
        let mut way = SVector::<f64, MOST>::ith(growth, 1.0);
        way[axis] = away_m;
        *covariance += way * way.transpose() * (moment / weight);
    }
}

/// Adds other minima of the solid, each with its likelihood.
fn mix<'a, K: UnitSolid>(best: &Descent, others: impl Iterator<Item = &'a Descent>, covariance: &mut Square) {
    let (mut weight, mut moment) = (1.0, Square::zeros());
    for other in others {
        let likelihood = likelihood(best.cost(), other.cost());
        if likelihood <= UNLIKELY {
            break;
        }
        weight += likelihood;
        let way = way_to::<K>(best, other);
        moment += way * way.transpose() * likelihood;
    }
    *covariance += moment / weight;
}

/// From one body to another, in the first one's parameters but for turns. Axes that are not told apart are those that are
/// most alike.
fn way_to<K: UnitSolid>(from: &Descent, to: &Descent) -> SVector<f64, MOST> {
    let (from, to) = (&from.body, &to.body);
    let shift = from.rotation.tr_mul(&(to.centre_m - from.centre_m));
    let alike = from.rotation.tr_mul(&to.rotation);
    let longer = Vector3::from_fn(|axis, _| {
        let same = if K::ROUND { axis } else { alike.row(axis).transpose().iamax() };
        (to.ln_half[same] - from.ln_half[axis]).exp() - 1.0
    });
    let mut way = SVector::<f64, MOST>::zeros();
    way.fixed_rows_mut::<3>(0).copy_from(&shift);
    if K::ROUND {
        (way[5], way[6]) = (longer.x, longer.z);
    } else {
        way.fixed_rows_mut::<3>(6).copy_from(&longer);
    }
    way
}

/// Of a body that costs so much, in units of the best one's.
fn likelihood(best: f64, cost: f64) -> f64 {
    (0.5 * (best - cost)).exp().min(1.0)
}
