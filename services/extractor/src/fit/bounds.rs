//! A normal distribution cut off by linear bounds: what rays that just met a body, or just passed it, leave of a guess.

use super::rays::MOST_LANES;
use super::system::MOST;

/// Most bounds that are let bear: a body has nine parameters, so few more can matter.
const MOST_BEARING: usize = 16;
/// A bound this many standard deviations off bears on nothing.
const OUT: f64 = 2.0;
/// Rounds in which the bounds that bear are weighed anew, each beside all others.
const ROUNDS: usize = 2;
/// Least variance that is told from none, and most of one that a bound takes away.
const LEAST: f64 = 1e-14;
const MOST_TAKEN: f64 = 1.0 - 1e-9;

/// Bounds on a body's parameters: its outline moves towards a ray by at most so much.
#[derive(Debug)]
pub(crate) struct Bounds {
    blocks: Vec<Block>,
}

/// Bounds side by side.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Block {
    /// How fast the outline moves towards the ray, by parameter.
    pub(crate) rows: [[f64; MOST_LANES]; MOST],
    /// How far it is off [m]; negative where the fit is beyond, infinite for what is no bound, or bears already.
    pub(crate) slack_m: [f64; MOST_LANES],
    /// Variance and mean of how far the outline has moved, as is known by now.
    variance: [f64; MOST_LANES],
    mean: [f64; MOST_LANES],
}

impl Block {
    /// No bounds.
    pub(crate) const NONE: Self = Self {
        rows: [[0.0; MOST_LANES]; MOST],
        slack_m: [f64::INFINITY; MOST_LANES],
        variance: [0.0; MOST_LANES],
        mean: [0.0; MOST_LANES],
    };

    /// How far the outline moves when the first parameters change.
    #[inline(always)]
    fn moved(&self, change: &[f64]) -> [f64; MOST_LANES] {
        let mut moved = [0.0; MOST_LANES];
        for (row, by) in self.rows.iter().zip(change) {
            for (moved, row) in moved.iter_mut().zip(row) {
                *moved += row * by;
            }
        }
        moved
    }
}

/// A normal distribution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub(crate) mean: [f64; MOST],
    /// Row by row, symmetric.
    pub(crate) covariance: [[f64; MOST]; MOST],
}

/// A bound that bears, as a measurement of how far the outline has moved: its precision, and that times what it says.
#[derive(Clone, Copy, Debug)]
struct Bearing {
    row: [f64; MOST],
    slack_m: f64,
    precision: f64,
    pull: f64,
}

/// How a distribution changes when one of its bounds is weighed: by these multiples of `along` and its square.
#[derive(Clone, Copy, Debug)]
struct Change {
    along: [f64; MOST],
    shift: f64,
    shrink: f64,
}

impl Bounds {
    /// Room for the bounds of `most` blocks.
    pub(crate) fn new(most: usize) -> Self {
        Self { blocks: Vec::with_capacity(most) }
    }

    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
    }

    pub(crate) fn push(&mut self, block: &Block) {
        self.blocks.push(*block);
    }

    /// What is left of a distribution about 0, of the first `count` parameters, by expectation propagation (Minka 2001): each
    /// bound that bears is replaced by the measurement that leaves the same mean and variance of what it bounds. The one
    /// that is overstepped farthest comes first, and so on while one is. Bounds are soft, by the standard deviation
    /// `blur_m`. Takes the bounds that bear away.
    ///
    /// Many rays that bound the same edge do not add up: once one bears, the others are far off. Between two bounds a
    /// fifth more is left than should be.
    #[inline(always)]
    pub(crate) fn narrow(&mut self, covariance: &[[f64; MOST]; MOST], count: usize, blur_m: f64) -> Normal {
        let mut normal = Normal { mean: [0.0; MOST], covariance: *covariance };
        self.begin(covariance, count);
        let mut change = Change { along: [0.0; MOST], shift: 0.0, shrink: 0.0 };
        let mut bearing = [Bearing { row: [0.0; MOST], slack_m: 0.0, precision: 0.0, pull: 0.0 }; MOST_BEARING];
        let mut many = 0;
        while many < MOST_BEARING {
            let Some((block, lane)) = self.follow(&change, count, blur_m) else { break };
            let block = &mut self.blocks[block];
            let bound = &mut bearing[many];
            bound.row = block.rows.map(|row| row[lane]);
            bound.slack_m = std::mem::replace(&mut block.slack_m[lane], f64::INFINITY);
            change = bound.weigh(&mut normal, blur_m);
            many += 1;
        }
        for _ in 0..ROUNDS {
            for bound in &mut bearing[..many] {
                bound.weigh(&mut normal, blur_m);
            }
        }
        normal
    }

    #[inline(always)]
    fn begin(&mut self, covariance: &[[f64; MOST]; MOST], count: usize) {
        let mut by = *covariance;
        for (axis, row) in by.iter_mut().enumerate() {
            // Each pair of parameters counts twice.
            row[..axis].iter_mut().for_each(|entry| *entry *= 2.0);
        }
        for block in &mut self.blocks {
            let mut variance = [0.0; MOST_LANES];
            for axis in 0..count {
                let moved = block.moved(&by[axis][..=axis]);
                for ((variance, moved), row) in variance.iter_mut().zip(moved).zip(block.rows[axis]) {
                    *variance += moved * row;
                }
            }
            (block.variance, block.mean) = (variance, [0.0; MOST_LANES]);
        }
    }

    /// Changes the distribution of each bound, and gives the one, by block and lane, that it oversteps farthest, out to
    /// [`OUT`] standard deviations.
    #[inline(always)]
    fn follow(&mut self, change: &Change, count: usize, blur_m: f64) -> Option<(usize, usize)> {
        let (mut farthest_m, mut place) = ([0.0; MOST_LANES], [0; MOST_LANES]);
        for (number, block) in self.blocks.iter_mut().enumerate() {
            let moved = block.moved(&change.along[..count]);
            for lane in 0..MOST_LANES {
                let moved = moved[lane];
                let variance = block.variance[lane] - change.shrink * moved * moved;
                let variance = if variance > LEAST { variance } else { LEAST };
                let mean = block.mean[lane] + change.shift * moved;
                (block.variance[lane], block.mean[lane]) = (variance, mean);
                let over_m = mean + OUT * (variance + blur_m * blur_m).sqrt() - block.slack_m[lane];
                let farther = over_m > farthest_m[lane];
                farthest_m[lane] = if farther { over_m } else { farthest_m[lane] };
                place[lane] = if farther { number } else { place[lane] };
            }
        }
        let lane = (1..MOST_LANES).fold(0, |best, lane| if farthest_m[lane] > farthest_m[best] { lane } else { best });
        (farthest_m[lane] > 0.0).then_some((place[lane], lane))
    }
}

impl Bearing {
    /// Takes what this bound said before out of the distribution, and puts in what it says now.
    #[inline(always)]
    fn weigh(&mut self, normal: &mut Normal, blur_m: f64) -> Change {
        let mut along = [0.0; MOST];
        for (row, by) in normal.covariance.iter().zip(self.row) {
            for (along, entry) in along.iter_mut().zip(row) {
                *along += entry * by;
            }
        }
        let dot = |other: &[f64; MOST]| self.row.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
        let variance = dot(&along).max(LEAST);
        let mean = dot(&normal.mean);
        // Without this bound.
        let without = 1.0 / (1.0 / variance - self.precision).max(1e-9);
        let before = without * (mean / variance - self.pull);
        // Cut off.
        let soft = without + blur_m * blur_m;
        let off = (self.slack_m - before) / soft.sqrt();
        let hazard = hazard(off);
        let taken = (without / soft * hazard * (hazard + off)).clamp(0.0, MOST_TAKEN);
        let after = before - without * hazard / soft.sqrt();
        let left = without * (1.0 - taken);

        let precision = taken / left;
        let pull = after / left - before / without;
        let (sharper, further) = (precision - self.precision, pull - self.pull);
        (self.precision, self.pull) = (precision, pull);
        let share = 1.0 + sharper * variance;
        let change = Change { along, shift: (further - sharper * mean) / share, shrink: sharper / share };
        for ((row, mean), one) in normal.covariance.iter_mut().zip(&mut normal.mean).zip(along) {
            let by = one * change.shrink;
            for (entry, other) in row.iter_mut().zip(along) {
                *entry -= by * other;
            }
            *mean += one * change.shift;
        }
        change
    }
}

/// φ(x)/Φ(x) of the standard normal distribution: minus the mean of what lies below x.
fn hazard(x: f64) -> f64 {
    if x < 0.0 {
        return 1.0 / mills(-x);
    }
    let density = (-0.5 * x * x).exp() * 0.398_942_280_401_432_7;
    density / (1.0 - density * mills(x))
}

/// Mills' ratio (1 − Φ(x))/φ(x), x ≥ 0: a polynomial (Abramowitz & Stegun 1964, 26.2.17), a continued fraction (26.2.14)
/// beyond 3. Within 1e-4 of itself.
fn mills(x: f64) -> f64 {
    if x < 3.0 {
        let t = 1.0 / (1.0 + 0.231_641_9 * x);
        let sum = ((1.330_274_429 * t - 1.821_255_978) * t + 1.781_477_937) * t - 0.356_563_782;
        return (sum * t + 0.319_381_53) * t;
    }
    1.0 / (1..=12).rev().fold(x, |below, step| x + f64::from(step) / below)
}

#[cfg(test)]
mod tests;
