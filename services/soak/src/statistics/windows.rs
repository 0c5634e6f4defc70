use hdrhistogram::Histogram;
use recorder::Merge;
use serde::{Deserialize, Serialize};

/// Longest latency told apart [µs]: 60 s.
const MOST_US: u64 = 60_000_000;
/// Digits of a latency that are kept.
const DIGITS: u8 = 3;

/// The latencies of a stretch of time. All its memory is made at once.
#[derive(Clone)]
pub(crate) struct Window {
    /// Of all sweeps that were answered [µs].
    all: Histogram<u32>,
    /// Of those that no fault touched [µs].
    calm: Histogram<u32>,
    /// Sweeps due that were late, broken or not answered.
    pub(crate) misses: u64,
    /// Processes started in place of others.
    pub(crate) restarts: u64,
}

impl Default for Window {
    fn default() -> Self {
        let histogram = || Histogram::new_with_bounds(1, MOST_US, DIGITS).expect("bounds that hold, being constants");
        Self { all: histogram(), calm: histogram(), misses: 0, restarts: 0 }
    }
}

impl Merge for Window {
    fn merge(&mut self, later: &Self) {
        let _ = self.all.add(&later.all); // of the same bounds
        let _ = self.calm.add(&later.calm);
        self.misses += later.misses;
        self.restarts += later.restarts;
    }
}

impl Window {
    /// Adds an answer; `calm` says that no fault was near.
    pub(crate) fn add(&mut self, latency_ns: u64, calm: bool) {
        self.all.saturating_record((latency_ns / 1000).max(1));
        if calm {
            self.calm.saturating_record((latency_ns / 1000).max(1));
        }
    }

    /// Answers that no fault touched.
    pub(crate) fn calm_count(&self) -> u64 {
        self.calm.len()
    }

    /// A quantile of those [ms]; none of none.
    pub(crate) fn calm_ms(&self, quantile: f64) -> Option<f64> {
        quantile_ms(&self.calm, quantile)
    }

    /// What it says, beginning `t_s` after the run.
    pub(crate) fn report(&self, t_s: f64) -> WindowReport {
        WindowReport {
            t_s,
            answered: self.all.len(),
            calm: self.calm.len(),
            p50_ms: quantile_ms(&self.all, 0.5),
            p99_ms: quantile_ms(&self.all, 0.99),
            max_ms: (!self.all.is_empty()).then(|| self.all.max() as f64 / 1e3),
            calm_p50_ms: self.calm_ms(0.5),
            calm_p99_ms: self.calm_ms(0.99),
            misses: self.misses,
            restarts: self.restarts,
        }
    }
}

fn quantile_ms(histogram: &Histogram<u32>, quantile: f64) -> Option<f64> {
    (!histogram.is_empty()).then(|| histogram.value_at_quantile(quantile) as f64 / 1e3)
}

/// The sweeps of a stretch of time.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct WindowReport {
    /// Its begin [s].
    pub t_s: f64,
    /// Sweeps answered.
    pub answered: u64,
    /// Of these, away from faults.
    pub calm: u64,
    /// Median latency [ms].
    pub p50_ms: Option<f64>,
    /// As its name says [ms].
    pub p99_ms: Option<f64>,
    /// The longest [ms].
    pub max_ms: Option<f64>,
    /// Median away from faults [ms].
    pub calm_p50_ms: Option<f64>,
    /// p99 away from faults [ms].
    pub calm_p99_ms: Option<f64>,
    /// Sweeps due that were late, broken or not answered.
    pub misses: u64,
    /// Processes started in place of others.
    pub restarts: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_become_one_have_the_latencies_of_both() {
        let mut sut = Window::default();
        (1..=100).for_each(|ms| sut.add(ms * 1_000_000, true));
        let mut later = Window::default();
        (1..=100).for_each(|_| later.add(500_000_000, false));
        later.misses = 3;
        sut.merge(&later);
        let report = sut.report(1.0);
        assert_eq!((report.answered, report.calm, report.misses), (200, 100, 3));
        assert!((report.p99_ms.unwrap() - 500.0).abs() < 1.0 && (report.calm_p50_ms.unwrap() - 50.0).abs() < 0.1);
        assert_eq!(Window::default().report(0.0).p50_ms, None);
    }
}
