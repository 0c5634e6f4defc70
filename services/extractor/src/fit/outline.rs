//! What rays tell of a body that was fitted to them: ranges by Gauss's and Newton's matrix, the outline by bounds.

use std::marker::PhantomData;

use nalgebra::SVector;
use pulp::{Simd, WithSimd};

use super::UnitSolid;
use super::bounds::{Block, Bounds};
use super::descent::Descent;
use super::outcome::{Square, factor, inverse};
use super::rays::MOST_LANES;
use super::residuals::{Measure, Rays, believe};
use super::sight::{Sight, bound, hit};
use super::system::{MOST, Row, Sums, parameters};

/// Rays this far from the outline bound nothing: in metres, and in radians as the sensor sees it.
const REACH: (f64, f64) = (0.3, 0.03);
/// Standard deviation of where a ray passes, in those of a range: the fit holds it for as well known.
const BLUR: f64 = 0.5;

/// Second moment of the truth about the best fit, by ranges, outline and beliefs; none where no information comes together.
///
/// A ray that met the body bounds the outline from within, one that passed it by from without. The fit may lie at an end of
/// what they leave, so the moment is that about the fit, not about the mean.
pub(crate) fn second_moment<K: UnitSolid>(best: &Descent, rays: &Rays<'_>, bounds: &mut Bounds) -> Option<Square> {
    if K::ROUND {
        rays.arch.dispatch(Outline::<K, true> { best, rays, bounds, solid: PhantomData })
    } else {
        rays.arch.dispatch(Outline::<K, false> { best, rays, bounds, solid: PhantomData })
    }
}

struct Outline<'a, K, const ROUND: bool> {
    best: &'a Descent,
    rays: &'a Rays<'a>,
    bounds: &'a mut Bounds,
    solid: PhantomData<K>,
}

impl<K: UnitSolid, const ROUND: bool> WithSimd for Outline<'_, K, ROUND> {
    type Output = Option<Square>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { best, rays, bounds, .. } = self;
        let sight = Sight::new::<K>(simd, &best.body, rays.sigma_m);
        // A hit beside the body and a miss through it push the fit, but tell no more than that they bound it.
        let pushed = best.parts.strayed + best.parts.violated > 0;
        let curvature = if pushed { met::<K, S, ROUND>(simd, &sight, best, rays) } else { best.system.curvature };
        let covariance = inverse(&factor(&curvature, ROUND)?, ROUND);

        let reach_m = REACH.0.max(REACH.1 * best.body.centre_m.norm());
        bounds.clear();
        for (beam, within) in [(rays.hits, true), (rays.misses, false)] {
            for first in (0..beam.len()).step_by(MOST_LANES) {
                let (mut block, mut any) = (Block::NONE, false);
                for lane in (0..MOST_LANES.min(beam.len() - first)).step_by(S::F64_LANES) {
                    let group = beam.group(simd, (first + lane) / S::F64_LANES);
                    let (near, slack_m, residuals) = bound::<K, S>(&sight, group, within, reach_m);
                    any |= near.any();
                    residuals.store_columns::<ROUND>(&mut block.rows, lane);
                    near.choose(slack_m, sight.all(f64::INFINITY)).store(&mut block.slack_m[lane..]);
                }
                block.slack_m.iter_mut().skip(beam.len() - first).for_each(|slack_m| *slack_m = f64::INFINITY);
                if any {
                    bounds.push(&block);
                }
            }
        }
        let left = bounds.narrow(&covariance, parameters(ROUND), BLUR * rays.sigma_m);
        let mean = SVector::from(left.mean);
        Some(Square::from(left.covariance) + mean * mean.transpose())
    }
}

/// Information of the hits that the body is in the way of, and of the beliefs.
#[inline(always)]
fn met<K: UnitSolid, S: Simd, const ROUND: bool>(
    simd: S,
    sight: &Sight<S>,
    best: &Descent,
    rays: &Rays<'_>,
) -> [[f64; MOST]; MOST] {
    let mut sums = Sums::<S, ROUND>::zero(simd);
    let mut rows = [Row::ZERO; MOST_LANES];
    for first in (0..rays.hits.len()).step_by(S::F64_LANES) {
        let group = rays.hits.group(simd, first / S::F64_LANES);
        hit::<K, S>(sight, group, Measure::Range).store::<ROUND>(&mut rows);
        let mut slacks_m = [0.0; MOST_LANES];
        bound::<K, S>(sight, group, true, 0.0).1.store(&mut slacks_m);
        let lanes = rows.iter().zip(slacks_m).take(S::F64_LANES.min(rays.hits.len() - first));
        for (row, _) in lanes.filter(|&(_, slack_m)| slack_m >= 0.0) {
            sums.add(row);
        }
    }
    let mut system = sums.system();
    believe(&mut system, &best.body.ln_half, ROUND, rays.beliefs);
    system.curvature
}
