//! Sums of the loss's derivatives over rows, and the split that they say gains most.

use std::ops::{Add, AddAssign, Sub};

use super::BoostingParams;
use super::bins::Binned;

/// Over some rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sum {
    /// Of first derivatives of the loss by the score.
    pub(super) gradient: f64,
    /// Of second derivatives, or what stands for them.
    pub(super) hessian: f64,
    pub(super) rows: u32,
}

impl Add for Sum {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            gradient: self.gradient + other.gradient,
            hessian: self.hessian + other.hessian,
            rows: self.rows + other.rows,
        }
    }
}

impl AddAssign for Sum {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Sum {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            gradient: self.gradient - other.gradient,
            hessian: self.hessian - other.hessian,
            rows: self.rows - other.rows,
        }
    }
}

/// Least sum of second derivatives of a leaf.
const MIN_HESSIAN: f64 = 1e-3;
/// Least gain of a split: anything less is rounding.
const MIN_GAIN: f64 = 1e-9;

impl Sum {
    /// A row's first and second derivative.
    pub(super) fn add_row(&mut self, [gradient, hessian]: [f32; 2]) {
        self.gradient += f64::from(gradient);
        self.hessian += f64::from(hessian);
        self.rows += 1;
    }

    /// Newton's step: what added to the score of all these rows lessens their loss most.
    pub(super) fn step(&self, lambda_l2: f64) -> f64 {
        if self.hessian < MIN_HESSIAN { 0.0 } else { -self.gradient / (self.hessian + lambda_l2) }
    }

    /// Twice what that step lessens the loss by, to second order.
    fn score(&self, lambda_l2: f64) -> f64 {
        self.gradient * self.gradient / (self.hessian + lambda_l2)
    }

    fn may_be_leaf(&self, params: &BoostingParams) -> bool {
        self.rows as usize >= params.min_rows && self.hessian >= MIN_HESSIAN
    }
}

/// Bins up to `bin` of a feature go left, those after it right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    pub(super) gain: f64,
    pub(super) feature: usize,
    pub(super) bin: u8,
    pub(super) left: Sum,
    pub(super) right: Sum,
}

impl Split {
    /// How much dividing lessens the loss, doubled; `None` where one side may not be a leaf.
    pub(super) fn gain(left: &Sum, right: &Sum, params: &BoostingParams) -> Option<f64> {
        if !left.may_be_leaf(params) || !right.may_be_leaf(params) {
            return None;
        }
        let whole = *left + *right;
        let lambda = params.lambda_l2;
        Some(left.score(lambda) + right.score(lambda) - whole.score(lambda)).filter(|&gain| gain > MIN_GAIN)
    }
}

/// A sum for each bin of each feature in use.
pub(super) struct Histogram {
    sums: Vec<Sum>,
}

impl Histogram {
    /// Of some rows and their derivatives, for the `features` in use.
    pub(super) fn of(binned: &Binned, features: &[u32], rows: &[u32], gradients: &[[f32; 2]]) -> Self {
        let mut sums = Vec::with_capacity(features.iter().map(|&feature| binned.bins(feature as usize)).sum());
        for &feature in features {
            let column = binned.column(feature as usize);
            // As many as a bin has values, so that no index is out of bounds.
            let mut of_feature = [Sum::default(); 256];
            for (&row, &derivatives) in rows.iter().zip(gradients) {
                of_feature[usize::from(column[row as usize])].add_row(derivatives);
            }
            sums.extend_from_slice(&of_feature[..binned.bins(feature as usize)]);
        }
        Self { sums }
    }

    /// That of the rows which are in this one and not in `part`.
    pub(super) fn without(mut self, part: &Self) -> Self {
        for (sum, of_part) in self.sums.iter_mut().zip(&part.sums) {
            *sum = *sum - *of_part;
        }
        self
    }

    /// The split of greatest gain; of equals the first feature's lowest.
    pub(super) fn best_split(
        &self,
        binned: &Binned,
        features: &[u32],
        whole: &Sum,
        params: &BoostingParams,
    ) -> Option<Split> {
        let mut best: Option<Split> = None;
        let mut rest = &self.sums[..];
        for &feature in features {
            let feature = feature as usize;
            let (of_feature, others) = rest.split_at(binned.bins(feature));
            rest = others;
            let mut left = Sum::default();
            for (bin, &sum) in of_feature[..of_feature.len() - 1].iter().enumerate() {
                // After a bin without rows the split is the one before it again; what it sums to is rounding.
                if sum.rows == 0 {
                    continue;
                }
                left += sum;
                let right = *whole - left;
                let gain = Split::gain(&left, &right, params);
                if let Some(gain) = gain.filter(|&gain| best.is_none_or(|best| gain > best.gain)) {
                    best = Some(Split { gain, feature, bin: bin as u8, left, right });
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::bins::Quantiles;
    use super::super::tests::params;
    use super::super::{AllCores, LabelledRows};
    use super::*;

    #[test]
    fn the_rest_of_a_histogram_is_that_of_the_other_rows_and_no_split_stands_behind_an_empty_bin() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut splits = 0;
        for _ in 0..50 {
            let features: Vec<f32> = (0..400).map(|_| random.random_range(0..100) as f32).collect();
            // Of many orders of magnitude: what is left of an empty bin is not 0.
            let gradients: Vec<[f32; 2]> = (0..200)
                .map(|_| {
                    let size = 10.0_f32.powi(random.random_range(-12..1));
                    [size * random.random_range(-1.0..1.0), size * random.random_range(0.1..1.0)]
                })
                .collect();
            let table = LabelledRows { features: &features, classes: &[0; 200], weights: None };
            let binned = Quantiles::of(&AllCores, &table, 2).bin(&AllCores, &table);
            let of = |is_in: fn(&u32) -> bool| {
                let rows: Vec<u32> = (0..200).filter(is_in).collect();
                let gradients: Vec<[f32; 2]> = rows.iter().map(|&row| gradients[row as usize]).collect();
                let mut whole = Sum::default();
                gradients.iter().for_each(|&derivatives| whole.add_row(derivatives));
                (Histogram::of(&binned, &[0, 1], &rows, &gradients), rows, whole)
            };
            // A grandchild.
            let rest =
                of(|_| true).0.without(&of(|row| row % 2 == 0).0).without(&of(|row| row % 14 < 12 && row % 2 == 1).0);
            let (expected, rows, whole) = of(|row| row % 14 == 13);
            for (found, expected) in rest.sums.iter().zip(&expected.sums) {
                assert_eq!(found.rows, expected.rows);
                assert!((found.gradient - expected.gradient).abs() < 1e-9);
                assert!((found.hessian - expected.hessian).abs() < 1e-9);
            }
            let params = BoostingParams { min_rows: 2, lambda_l2: 0.0, ..params() };
            let best = |histogram: &Histogram| {
                histogram.best_split(&binned, &[0, 1], &whole, &params).map(|split| (split.feature, split.bin))
            };
            assert_eq!(best(&rest), best(&expected));
            if let Some((feature, bin)) = best(&rest) {
                assert!(rows.iter().any(|&row| binned.column(feature)[row as usize] == bin));
                splits += 1;
            }
        }
        assert!(splits > 25, "{splits}");
    }
}
