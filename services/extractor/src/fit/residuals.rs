use std::marker::PhantomData;

use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};

use super::rays::{Beam, MOST_LANES};
use super::sight::{BEFORE, Sight, hit, miss};
use super::system::{Row, Sums, System, parameters};
use super::{Beliefs, Body, UnitSolid};

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
    /// The instructions that rays are measured with; they change no bit.
    pub(crate) arch: Arch,
    pub(crate) hits: &'a Beam,
    pub(crate) misses: &'a Beam,
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

/// Sum of squares of all residuals of a body, with first derivatives.
///
/// A hit: range of the body along its ray less the range measured; where the ray passes the body by, its distance from the
/// outline. A miss that the body is in the way of: its depth within the outline. Beliefs: ln of the half extents about their
/// mean, and the mean.
///
/// Stops where the sum reaches `limit`: what it gives then costs that much or more, and says nothing else.
pub(crate) fn measure<K: UnitSolid>(body: &Body, rays: &Rays<'_>, how: Measure, limit: f64) -> (System, Parts) {
    let (mut system, mut parts) = if K::ROUND {
        rays.arch.dispatch(Sum::<K, true> { body, rays, how, limit, solid: PhantomData })
    } else {
        rays.arch.dispatch(Sum::<K, false> { body, rays, how, limit, solid: PhantomData })
    };
    if system.cost >= limit {
        return (system, parts);
    }
    let before = system.cost;
    believe(&mut system, &body.ln_half, K::ROUND, rays.beliefs);
    parts.beliefs = system.cost - before;
    (system, parts)
}

/// The sum over hits and misses; rays are looked at many at once, and added one by one.
struct Sum<'a, K, const ROUND: bool> {
    body: &'a Body,
    rays: &'a Rays<'a>,
    how: Measure,
    limit: f64,
    solid: PhantomData<K>,
}

impl<K: UnitSolid, const ROUND: bool> WithSimd for Sum<'_, K, ROUND> {
    type Output = (System, Parts);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { body, rays, how, limit, .. } = self;
        let sight = Sight::new::<K>(simd, body, rays.sigma_m);
        let mut sums = Sums::<S, ROUND>::zero(simd);
        let mut parts = Parts::default();
        let mut rows = [Row::ZERO; MOST_LANES];

        for first in (0..rays.hits.len()).step_by(S::F64_LANES) {
            hit::<K, S>(&sight, rays.hits.group(simd, first / S::F64_LANES), how).store::<ROUND>(&mut rows);
            for row in rows.iter().take(S::F64_LANES.min(rays.hits.len() - first)) {
                parts.strayed += u32::from(row.0[parameters(ROUND)].abs() > BEFORE);
                sums.add(row);
                parts.hits = sums.cost;
                if sums.cost >= limit {
                    return (sums.system(), parts);
                }
            }
        }
        for first in (0..rays.misses.len()).step_by(S::F64_LANES) {
            let group = rays.misses.group(simd, first / S::F64_LANES);
            let Some((violated, residuals)) = miss::<K, S>(&sight, group, how) else { continue };
            residuals.store::<ROUND>(&mut rows);
            let mut chosen = [0.0; MOST_LANES];
            violated.choose(sight.all(1.0), sight.all(0.0)).store(&mut chosen);
            let lanes = rows.iter().zip(&chosen).take(S::F64_LANES.min(rays.misses.len() - first));
            for (row, _) in lanes.filter(|&(_, &chosen)| chosen > 0.0) {
                let residual = row.0[parameters(ROUND)];
                parts.violated += 1;
                parts.misses += residual * residual;
                sums.add(row);
                if sums.cost >= limit {
                    return (sums.system(), parts);
                }
            }
        }
        (sums.system(), parts)
    }
}

/// Adds what is believed of a body's half extents: their spread about their mean, and the mean.
pub(crate) fn believe(system: &mut System, ln_half: &Vector3<f64>, round: bool, beliefs: &Beliefs) {
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
