//! A normal distribution cut off by linear bounds: what rays that just met a body, or just passed it, leave of a guess.

use nalgebra::{SMatrix, SVector};

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

/// Parameters of a body, truth less fit.
pub(crate) type Vector = SVector<f64, MOST>;
/// Their covariance.
pub(crate) type Square = SMatrix<f64, MOST, MOST>;

/// Bounds on a body's parameters: its outline moves towards a ray by at most so much. Bounds lie side by side, parameter
/// by parameter.
#[derive(Debug)]
pub(crate) struct Bounds {
    /// How fast the outline moves towards the ray, by parameter.
    rows: [Vec<f64>; MOST],
    /// How far it is off [m]; negative where the fit is beyond.
    slack_m: Vec<f64>,
    /// Variance and mean of how far the outline has moved, as is known by now; infinite for bounds that bear already.
    variance: Vec<f64>,
    mean: Vec<f64>,
    /// Covariance of that and of how far the outline has moved towards one of the rays.
    along: Vec<f64>,
}

/// A normal distribution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub(crate) mean: Vector,
    pub(crate) covariance: Square,
}

/// A bound that bears, as a measurement of how far the outline has moved: its precision, and that times what it says.
#[derive(Clone, Copy, Debug)]
struct Bearing {
    row: Vector,
    slack_m: f64,
    precision: f64,
    pull: f64,
}

/// How a distribution changes when one of its bounds is weighed: by these multiples of `along` and its square.
#[derive(Clone, Copy, Debug)]
struct Change {
    along: Vector,
    shift: f64,
    shrink: f64,
}

impl Bounds {
    /// Room for `most` bounds.
    pub(crate) fn new(most: usize) -> Self {
        let column = || Vec::with_capacity(most);
        Self {
            rows: std::array::from_fn(|_| column()),
            slack_m: column(),
            variance: column(),
            mean: column(),
            along: column(),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.rows.iter_mut().for_each(Vec::clear);
        self.slack_m.clear();
    }

    /// Adds a bound: `sign` times `row`, over all parameters, moves the outline by at most `slack_m`.
    pub(crate) fn push(&mut self, row: &[f64], sign: f64, slack_m: f64) {
        for (place, column) in self.rows.iter_mut().enumerate() {
            column.push(sign * row.get(place).copied().unwrap_or(0.0));
        }
        self.slack_m.push(slack_m);
    }

    /// What is left of a distribution about 0, by expectation propagation (Minka 2001): each bound that bears is replaced
    /// by the measurement that leaves the same mean and variance of what it bounds. The one that is overstepped farthest
    /// comes first, and so on while one is. Bounds are soft, by the standard deviation `blur_m`.
    ///
    /// Many rays that bound the same edge do not add up: once one bears, the others are far off.
    #[inline(always)]
    pub(crate) fn narrow(&mut self, covariance: &Square, blur_m: f64) -> Normal {
        let mut normal = Normal { mean: Vector::zeros(), covariance: *covariance };
        self.begin(covariance);
        let mut bearing = [Bearing { row: Vector::zeros(), slack_m: 0.0, precision: 0.0, pull: 0.0 }; MOST_BEARING];
        let mut count = 0;
        while count < MOST_BEARING {
            let Some(place) = self.overstepped(blur_m) else { break };
            let row = Vector::from_fn(|axis, _| self.rows[axis][place]);
            bearing[count] = Bearing { row, slack_m: self.slack_m[place], precision: 0.0, pull: 0.0 };
            let change = bearing[count].weigh(&mut normal, blur_m);
            self.follow(&change);
            self.variance[place] = f64::INFINITY;
            count += 1;
        }
        for _ in 0..ROUNDS {
            for bound in &mut bearing[..count] {
                bound.weigh(&mut normal, blur_m);
            }
        }
        normal
    }

    #[inline(always)]
    fn begin(&mut self, covariance: &Square) {
        let count = self.slack_m.len();
        for column in [&mut self.variance, &mut self.mean, &mut self.along] {
            column.clear();
            column.resize(count, 0.0);
        }
        for axis in 0..MOST {
            self.move_along(&covariance.column(axis).into());
            for ((variance, along), row) in self.variance.iter_mut().zip(&self.along).zip(&self.rows[axis]) {
                *variance += row * along;
            }
        }
    }

    /// Fills `along` for a change of all parameters.
    #[inline(always)]
    fn move_along(&mut self, change: &Vector) {
        self.along.fill(0.0);
        for (column, by) in self.rows.iter().zip(change.iter()) {
            for (along, row) in self.along.iter_mut().zip(column) {
                *along += row * by;
            }
        }
    }

    /// The bound that the distribution, out to [`OUT`] standard deviations, oversteps farthest.
    #[inline(always)]
    fn overstepped(&self, blur_m: f64) -> Option<usize> {
        let (mut place, mut farthest_m) = (None, 0.0);
        let bounds = self.slack_m.iter().zip(&self.mean).zip(&self.variance);
        for (number, ((slack_m, mean), variance)) in bounds.enumerate() {
            let over_m = mean + OUT * (variance + blur_m * blur_m).sqrt() - slack_m;
            if over_m > farthest_m && over_m.is_finite() {
                (place, farthest_m) = (Some(number), over_m);
            }
        }
        place
    }

    #[inline(always)]
    fn follow(&mut self, change: &Change) {
        self.move_along(&change.along);
        let bounds = self.variance.iter_mut().zip(&mut self.mean).zip(&self.along);
        for ((variance, mean), along) in bounds {
            *variance = (*variance - change.shrink * along * along).max(LEAST);
            *mean += change.shift * along;
        }
    }
}

impl Bearing {
    /// Takes what this bound said before out of the distribution, and puts in what it says now.
    #[inline(always)]
    fn weigh(&mut self, normal: &mut Normal, blur_m: f64) -> Change {
        let along = normal.covariance * self.row;
        let variance = self.row.dot(&along).max(LEAST);
        let mean = self.row.dot(&normal.mean);
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
        normal.covariance -= along * along.transpose() * change.shrink;
        normal.mean += along * change.shift;
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
