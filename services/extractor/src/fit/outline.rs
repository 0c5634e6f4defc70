//! What rays tell of a body that was fitted to them: ranges by Gauss's and Newton's matrix, the outline by bounds.

use std::marker::PhantomData;

use pulp::{Simd, WithSimd};

use super::bounds::{Bounds, Square};
use super::outcome::inverse;
use super::rays::MOST_LANES;
use super::residuals::{Measure, Rays, believe};
use super::sight::{Sight, beside, hit};
use super::system::{Row, Sums, System, parameters};
use super::{Body, UnitSolid};

/// Rays this far from the outline bound nothing: in metres, and in radians as the sensor sees it.
const REACH: (f64, f64) = (0.3, 0.03);
/// Standard deviation of where a ray passes, in those of a range: the fit holds it for as well known.
const BLUR: f64 = 0.5;

/// Second moment of the truth about the fit, by ranges, outline and beliefs; none where no information comes together.
///
/// A ray that met the body bounds the outline from within, one that passed it by from without. The fit may lie at an end of
/// what they leave, so the moment is that about the fit, not about the mean.
pub(crate) fn second_moment<K: UnitSolid>(body: &Body, rays: &Rays<'_>, bounds: &mut Bounds) -> Option<Square> {
    if K::ROUND {
        rays.arch.dispatch(Outline::<K, true> { body, rays, bounds, solid: PhantomData })
    } else {
        rays.arch.dispatch(Outline::<K, false> { body, rays, bounds, solid: PhantomData })
    }
}

struct Outline<'a, K, const ROUND: bool> {
    body: &'a Body,
    rays: &'a Rays<'a>,
    bounds: &'a mut Bounds,
    solid: PhantomData<K>,
}

impl<K: UnitSolid, const ROUND: bool> WithSimd for Outline<'_, K, ROUND> {
    type Output = Option<Square>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> Self::Output {
        let system = self.gather(simd);
        let (covariance, _) = inverse(&system.curvature, ROUND)?;
        let left = self.bounds.narrow(&covariance, BLUR * self.rays.sigma_m);
        Some(left.covariance + left.mean * left.mean.transpose())
    }
}

impl<K: UnitSolid, const ROUND: bool> Outline<'_, K, ROUND> {
    /// Information of the hits that the body is in the way of, and of the beliefs; puts what bounds the outline in `bounds`.
    #[inline(always)]
    fn gather<S: Simd>(&mut self, simd: S) -> System {
        let Self { body, rays, bounds, .. } = self;
        let count = parameters(ROUND);
        let reach_m = REACH.0.max(REACH.1 * body.centre_m.norm());
        let sight = Sight::new::<K>(simd, body, rays.sigma_m);
        let mut sums = Sums::<S, ROUND>::zero(simd);
        let (mut met, mut passed) = ([Row::ZERO; MOST_LANES], [Row::ZERO; MOST_LANES]);
        bounds.clear();
        for first in (0..rays.hits.len()).step_by(S::F64_LANES) {
            let group = rays.hits.group(simd, first / S::F64_LANES);
            hit::<K, S>(&sight, group, Measure::Range).store::<ROUND>(&mut met);
            beside::<K, S>(&sight, group).1.store::<ROUND>(&mut passed);
            for (met, passed) in met.iter().zip(&passed).take(S::F64_LANES.min(rays.hits.len() - first)) {
                let outside_m = passed.0[count];
                if outside_m <= 0.0 {
                    sums.add(met);
                }
                if outside_m > -reach_m {
                    bounds.push(&passed.0[..count], -1.0, -outside_m);
                }
            }
        }
        for first in (0..rays.misses.len()).step_by(S::F64_LANES) {
            let (tells, residuals) = beside::<K, S>(&sight, rays.misses.group(simd, first / S::F64_LANES));
            residuals.store::<ROUND>(&mut passed);
            let mut chosen = [0.0; MOST_LANES];
            tells.choose(sight.all(1.0), sight.all(0.0)).store(&mut chosen);
            let lanes = passed.iter().zip(&chosen).take(S::F64_LANES.min(rays.misses.len() - first));
            for (passed, _) in lanes.filter(|&(_, &chosen)| chosen > 0.0) {
                let outside_m = passed.0[count];
                if outside_m < reach_m {
                    bounds.push(&passed.0[..count], 1.0, outside_m);
                }
            }
        }
        let mut system = sums.system();
        believe(&mut system, &body.ln_half, ROUND, rays.beliefs);
        system
    }
}
