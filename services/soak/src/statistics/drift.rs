use recorder::Merge;
use serde::{Deserialize, Serialize};

use super::trend::theil_sen;
use super::windows::Window;

/// Fewest answers of a window whose p99 says something.
const LEAST_ANSWERS: u64 = 200;

/// How latency changed in the course of a run, away from faults.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Drift {
    /// Median of the first third of the run [ms].
    pub p50_first_ms: Option<f64>,
    /// Of the last third [ms].
    pub p50_last_ms: Option<f64>,
    /// Change of the median from the first third to the last [%].
    pub p50_pct: Option<f64>,
    /// p99 of the first third [ms].
    pub p99_first_ms: Option<f64>,
    /// Of the last third [ms].
    pub p99_last_ms: Option<f64>,
    /// Change of p99 from the first third to the last [%].
    pub p99_pct: Option<f64>,
    /// Median of the slopes between all pairs of windows' medians [% of the first third's an hour].
    pub p50_pct_per_h: Option<f64>,
    /// The same of p99.
    pub p99_pct_per_h: Option<f64>,
}

impl Drift {
    /// From windows in order of time, each with its begin [s]. All null of fewer than three windows with answers.
    pub(crate) fn of<'a>(windows: impl Iterator<Item = (f64, &'a Window)>) -> Self {
        let windows: Vec<_> = windows.filter(|(_, window)| window.calm_count() > 0).collect();
        if windows.len() < 3 {
            return Self::default();
        }
        let third = windows.len() / 3;
        let together = |windows: &[(f64, &Window)]| {
            let mut all = Window::default();
            windows.iter().for_each(|(_, window)| all.merge(window));
            all
        };
        let (first, last) = (together(&windows[..third]), together(&windows[windows.len() - third..]));
        let change = |quantile: f64| {
            let (first, last) = (first.calm_ms(quantile)?, last.calm_ms(quantile)?);
            (first > 0.0).then(|| 100.0 * (last - first) / first)
        };
        let trend = |quantile: f64, least: u64| {
            let full = windows.iter().filter(|(_, window)| window.calm_count() >= least);
            let points: Vec<_> =
                full.filter_map(|(t_s, window)| Some((t_s / 3600.0, window.calm_ms(quantile)?))).collect();
            let first = first.calm_ms(quantile).filter(|first| *first > 0.0)?;
            theil_sen(&points).map(|per_h| 100.0 * per_h / first)
        };
        Self {
            p50_first_ms: first.calm_ms(0.5),
            p50_last_ms: last.calm_ms(0.5),
            p50_pct: change(0.5),
            p99_first_ms: first.calm_ms(0.99),
            p99_last_ms: last.calm_ms(0.99),
            p99_pct: change(0.99),
            p50_pct_per_h: trend(0.5, 1),
            p99_pct_per_h: trend(0.99, LEAST_ANSWERS),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latency_that_rises_by_a_tenth_is_said_so() {
        let windows: Vec<Window> = (0..30)
            .map(|place| {
                let mut window = Window::default();
                let level = if place < 15 { 10_000_000 } else { 11_000_000 };
                (0..300).for_each(|n| window.add(level + n * 1_000, true));
                // A fault's latencies are not looked at.
                window.add(5_000_000_000, false);
                window
            })
            .collect();
        let drift = Drift::of(windows.iter().enumerate().map(|(place, window)| (60.0 * place as f64, window)));
        assert!((drift.p50_pct.unwrap() - 10.0).abs() < 0.5, "{drift:?}");
        assert!((drift.p99_pct.unwrap() - 10.0).abs() < 0.5, "{drift:?}");
        assert!(drift.p50_pct_per_h.unwrap() > 5.0, "{drift:?}");
        assert_eq!(Drift::of(std::iter::empty()), Drift::default());
    }
}
