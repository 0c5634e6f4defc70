use serde::Serialize;

/// How many of how many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Share {
    /// Those that count.
    pub count: u32,
    /// All.
    pub of: u32,
}

impl Share {
    /// Of one verdict for each.
    pub(crate) fn of(verdicts: impl IntoIterator<Item = bool>) -> Self {
        let mut share = Self::default();
        for verdict in verdicts {
            share.add(verdict);
        }
        share
    }

    pub(crate) fn add(&mut self, counts: bool) {
        self.count += u32::from(counts);
        self.of += 1;
    }

    /// In per cent; none of none.
    pub fn per_cent(self) -> Option<f64> {
        (self.of > 0).then(|| 100.0 * f64::from(self.count) / f64::from(self.of))
    }

    /// Standard error \[%\], taken as binomial; none of none.
    pub fn standard_error_per_cent(self) -> Option<f64> {
        let share = self.per_cent()? / 100.0;
        Some(100.0 * (share * (1.0 - share) / f64::from(self.of)).sqrt())
    }
}

/// The value below which this share of them lies, `at` 0 to 1, the lower of two; none of none. NaN counts as largest.
pub(crate) fn quantile(mut values: Vec<f64>, at: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((at * last as f64) as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_nothing_is_none() {
        let share = Share::of([true, true, false, true]);
        assert_eq!((share.count, share.of), (3, 4));
        assert_eq!(share.per_cent(), Some(75.0));
        assert!((share.standard_error_per_cent().unwrap() - 21.650_635).abs() < 1e-5);
        assert_eq!(Share::default().per_cent(), None);
        assert_eq!(Share::default().standard_error_per_cent(), None);
    }

    #[test]
    fn a_quantile_is_one_of_the_values() {
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(vec![4.0, 3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(vec![1.0, f64::NAN], 1.0).map(f64::is_nan), Some(true));
        assert_eq!(quantile(Vec::new(), 0.5), None);
    }
}
