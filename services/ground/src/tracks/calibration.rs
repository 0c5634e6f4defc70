//! Whether a probability means what it says.

/// Bins of a reliability table, of equal width.
pub const PROBABILITY_BINS: usize = 10;

/// 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Predictions of about equal probability.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbabilityBin {
    /// How many.
    pub count: u32,
    /// How many of them came true.
    pub happened: u32,
    /// Sum of their probabilities.
    sum: f64,
}

impl ProbabilityBin {
    /// Mean of the probabilities; none of none.
    pub fn predicted(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }

    /// Share that came true; none of none.
    pub fn share(&self) -> Option<f64> {
        (self.count > 0).then(|| f64::from(self.happened) / f64::from(self.count))
    }

    /// 95 % interval of that share, taken as binomial (E. B. Wilson, "Probable inference, the law of succession, and
    /// statistical inference", 1927); none of none.
    pub fn interval(&self) -> Option<[f64; 2]> {
        let (share, count) = (self.share()?, f64::from(self.count));
        let weight = Z * Z / count;
        let middle = share + 0.5 * weight;
        let half = Z * (share * (1.0 - share) / count + weight / (4.0 * count)).sqrt();
        Some([middle - half, middle + half].map(|end| (end / (1.0 + weight)).clamp(0.0, 1.0)))
    }
}

/// Predicted probabilities beside what happened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProbabilityTable {
    /// Bin m holds probabilities from m/10, and the last also 1.
    pub bins: [ProbabilityBin; PROBABILITY_BINS],
    /// Sum of (probability − what happened)².
    squares: f64,
}

impl ProbabilityTable {
    /// Of probabilities and whether it happened.
    pub(crate) fn of(predicted: impl IntoIterator<Item = (f64, bool)>) -> Self {
        let mut table = Self::default();
        for (probability, happened) in predicted {
            let place = (probability * PROBABILITY_BINS as f64) as usize;
            let bin = &mut table.bins[place.min(PROBABILITY_BINS - 1)];
            bin.count += 1;
            bin.happened += u32::from(happened);
            bin.sum += probability;
            table.squares += (probability - f64::from(u8::from(happened))).powi(2);
        }
        table
    }

    /// How many.
    pub fn count(&self) -> u32 {
        self.bins.iter().map(|bin| bin.count).sum()
    }

    /// Mean distance of what happened from what was predicted, bin by bin, over all; none of none.
    pub fn expected_calibration_error(&self) -> Option<f64> {
        let off = |bin: &ProbabilityBin| Some((bin.predicted()? - bin.share()?).abs() * f64::from(bin.count));
        let sum: f64 = self.bins.iter().filter_map(off).sum();
        (self.count() > 0).then(|| sum / f64::from(self.count()))
    }

    /// Mean squared error of the probability (G. W. Brier, 1950), 0 to 1; none of none.
    pub fn brier(&self) -> Option<f64> {
        (self.count() > 0).then(|| self.squares / f64::from(self.count()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_counts_what_happened_by_what_was_said() {
        let sut = ProbabilityTable::of([(0.0, false), (0.05, true), (0.95, true), (1.0, true), (0.3, false)]);
        assert_eq!(sut.bins.map(|bin| bin.count), [2, 0, 0, 1, 0, 0, 0, 0, 0, 2]);
        assert_eq!((sut.bins[0].share(), sut.bins[9].predicted(), sut.bins[5].share()), (Some(0.5), Some(0.975), None));
        // Two off by 0.475, one by 0.3, two by 0.025.
        assert!((sut.expected_calibration_error().unwrap() - (0.95 + 0.3 + 0.05) / 5.0).abs() < 1e-12);
        assert!((sut.brier().unwrap() - (0.95 * 0.95 + 0.05 * 0.05 + 0.09) / 5.0).abs() < 1e-12);
        assert_eq!(ProbabilityTable::default().expected_calibration_error(), None);
    }

    #[test]
    fn the_interval_is_wilsons() {
        // scipy.stats.binomtest(k, n).proportion_ci(method="wilson"), scipy 1.17.1.
        for (happened, count, ends) in GOLDEN {
            let [low, high] = ProbabilityBin { count, happened, sum: 0.0 }.interval().unwrap();
            assert!((low - ends[0]).abs() < 1e-12 && (high - ends[1]).abs() < 1e-12, "{happened} of {count}");
        }
    }

    const GOLDEN: [(u32, u32, [f64; 2]); 3] = [
        (0, 7, [0.0, 0.35433043506668743]),
        (5, 20, [0.11186170140766571, 0.468700877618744]),
        (99, 100, [0.9455138038212946, 0.9982325679358593]),
    ];
}
