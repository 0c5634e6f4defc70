//! Features as small whole numbers: the thresholds that a split may use, from the quantiles of the training values.

use super::{LabelledRows, Workers};

/// Values of a binned feature at most.
const BINS: usize = 255;

/// Thresholds of each feature, ascending: a value's bin is how many of them it is greater than. Unknown values are
/// greater than none, as in [`classifier::BoostedTrees`].
pub(super) struct Quantiles {
    thresholds: Vec<Vec<f32>>,
}

impl Quantiles {
    pub(super) fn of(workers: &impl Workers, rows: &LabelledRows, features: usize) -> Self {
        let of_feature = |&feature: &usize| thresholds(rows.features.iter().skip(feature).step_by(features).copied());
        Self { thresholds: workers.map(&Vec::from_iter(0..features), of_feature) }
    }

    pub(super) fn bin(&self, workers: &impl Workers, rows: &LabelledRows) -> Binned {
        let features = self.thresholds.len();
        let columns = workers.map(&Vec::from_iter(0..features), |&feature| {
            let thresholds = &self.thresholds[feature];
            let bin = |&value: &f32| thresholds.partition_point(|&threshold| value > threshold) as u8;
            rows.features.iter().skip(feature).step_by(features).map(bin).collect()
        });
        Binned { bins: self.thresholds.iter().map(|of_one| of_one.len() + 1).collect(), columns }
    }

    /// The threshold between a bin and the next.
    pub(super) fn threshold(&self, feature: usize, bin: u8) -> f32 {
        self.thresholds[feature][usize::from(bin)]
    }
}

/// A table of bins.
pub(super) struct Binned {
    bins: Vec<usize>,
    columns: Vec<Vec<u8>>,
}

impl Binned {
    pub(super) fn features(&self) -> usize {
        self.columns.len()
    }

    pub(super) fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// How many bins a feature has, 1 to 255.
    pub(super) fn bins(&self, feature: usize) -> usize {
        self.bins[feature]
    }

    /// A feature's bin in each row.
    pub(super) fn column(&self, feature: usize) -> &[u8] {
        &self.columns[feature]
    }
}

/// Thresholds that cut the values into at most [`BINS`] bins: one for each value if there are few, else of about equal
/// counts, frequent values by themselves. Unknown values, where there are any, have the first bin alone.
fn thresholds(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let (mut known, unknown): (Vec<f32>, Vec<f32>) = values.partition(|&value| value > f32::MIN);
    known.sort_unstable_by(f32::total_cmp);
    let mut thresholds = Vec::new();
    if !unknown.is_empty() && !known.is_empty() {
        thresholds.push(f32::MIN);
    }
    let mut bins = BINS - thresholds.len();
    let counted: Vec<(f32, usize)> = known.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect();
    let frequent = known.len().div_ceil(bins);
    let is_frequent = |count: usize| counted.len() <= BINS || count >= frequent;

    // What stands in open bins of infrequent values, and how many those may be.
    let rare = |&&(_, count): &&(f32, usize)| !is_frequent(count);
    let mut rest: usize = counted.iter().filter(rare).map(|(_, count)| count).sum();
    let mut rare_bins = bins.saturating_sub(counted.len() - counted.iter().filter(rare).count());
    let mut in_bin = 0;
    for pair in counted.windows(2) {
        let [(value, count), (next, next_count)] = [pair[0], pair[1]];
        in_bin += count;
        // It falls short of its share by less than the next value would take it over.
        let full = (2 * in_bin + next_count) * rare_bins > 2 * rest;
        if bins > 1 && (is_frequent(count) || is_frequent(next_count) || full) {
            thresholds.push(between(value, next));
            bins -= 1;
            if !is_frequent(count) {
                rest -= in_bin;
                rare_bins = rare_bins.saturating_sub(1).max(1);
            }
            in_bin = 0;
        }
    }
    thresholds
}

/// A finite number that `above` is greater than and `below` is not.
fn between(below: f32, above: f32) -> f32 {
    let middle = ((f64::from(below) + f64::from(above)) / 2.0) as f32;
    if middle >= below && middle < above { middle } else { below }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(values: &[f32], thresholds: &[f32]) -> Vec<usize> {
        let mut counts = vec![0; thresholds.len() + 1];
        for value in values {
            counts[thresholds.iter().filter(|&threshold| value > threshold).count()] += 1;
        }
        counts
    }

    fn of(values: &[f32]) -> Vec<f32> {
        let found = thresholds(values.iter().copied());
        assert!(found.is_sorted_by(|a, b| a < b) && found.iter().all(|threshold| threshold.is_finite()), "{found:?}");
        assert!(found.len() < BINS);
        assert!(counts(values, &found).iter().all(|&count| count > 0) || values.is_empty());
        found
    }

    #[test]
    fn few_values_have_a_bin_each_with_thresholds_halfway() {
        assert_eq!(of(&[3.0, 1.0, 3.0, 2.0, 1.0]), [1.5, 2.5]);
        assert!(of(&[-0.0, 0.0]).is_empty());
        assert!(of(&[]).is_empty());
        assert_eq!(of(&[1.0, 1.0_f32.next_up()]), [1.0]);
        assert_eq!(of(&[1.0, f32::INFINITY]), [1.0]);
        assert_eq!(of(&[f32::MAX, f32::INFINITY]), [f32::MAX]);
        let all: Vec<f32> = (0..255).map(|value| value as f32).collect();
        assert_eq!(of(&all).len(), 254);
    }

    #[test]
    fn unknown_values_have_the_first_bin_alone() {
        assert_eq!(of(&[f32::NAN, -1e30, 2.0]), [f32::MIN, between(-1e30, 2.0)]);
        assert_eq!(of(&[f32::NEG_INFINITY, 2.0]), [f32::MIN]);
        assert!(of(&[f32::NAN, f32::NAN]).is_empty());
        let mut many: Vec<f32> = (0..10_000).map(|value| value as f32).collect();
        many.push(f32::NAN);
        let found = of(&many);
        assert_eq!((found.len(), counts(&many, &found)[0]), (254, 1));
    }

    #[test]
    fn many_values_have_bins_of_about_equal_counts() {
        let values: Vec<f32> = (0..100_000).map(|value| (value as f32).sqrt()).collect();
        let found = of(&values);
        let counts = counts(&values, &found);
        assert_eq!(found.len(), 254);
        assert!(counts.iter().all(|count| (380..=405).contains(count)), "{counts:?}");
    }

    #[test]
    fn frequent_values_have_bins_of_their_own() {
        let mut values: Vec<f32> = (0..50_000).map(|value| value as f32 / 100.0 - 250.0).collect();
        values.extend([0.0; 50_000]);
        values.extend([100.0; 20_000]);
        let found = of(&values);
        let counts = counts(&values, &found);
        assert!(counts.contains(&50_001) && counts.contains(&20_001), "{counts:?}");
        let rare: Vec<_> = counts.iter().filter(|&&count| count < 20_000).collect();
        assert!(rare.len() > 245 && rare.iter().all(|&&count| count < 250), "{counts:?}");
    }

    #[test]
    fn no_more_bins_than_allowed_whatever_the_counts() {
        // Frequent values between rare ones: each would close a bin of rare ones.
        for frequent in [1, 2, 100, 126, 127, 128, 200, 253] {
            let mut values = Vec::new();
            for value in 0..1_000 {
                let count = if value % 2 == 1 && value < 2 * frequent { 1_000 } else { 1 };
                values.extend(std::iter::repeat_n(value as f32, count));
            }
            of(&values);
        }
    }
}
