//! The slope of a series, and how sure it is.
//!
//! Least squares over (x, y), with a 95 % interval that allows for autocorrelation: the residuals' lag-1 autocorrelation r makes of n
//! points n (1 − r) / (1 + r) independent ones, and the standard error and Student's degrees of freedom are those of so many
//! (B. D. Santer et al., J. Geophys. Res. 105, 7337, 2000, Eqs. 3 to 6). Negative r is taken as 0, so that the interval is never
//! narrower than the ordinary one.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Share of a distribution below the upper end of a 95 % interval.
const UPPER: f64 = 0.975;

/// Fewer degrees of freedom say nothing.
const LEAST_FREEDOM: f64 = 1.0;

/// A straight line through a series.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Slope {
    /// Change of y for one x.
    pub slope: f64,
    /// Where its 95 % interval begins and ends; null where the points are too few, or hang together too much, to say.
    pub interval: Option<[f64; 2]>,
    /// Lag-1 autocorrelation of the residuals, 0 at least.
    pub autocorrelation: f64,
    /// Independent points that the series is worth.
    pub effective_points: f64,
    /// Points.
    pub points: usize,
}

impl Slope {
    /// The line through the points, in order of x. None of fewer than three points, or where all x are the same.
    pub fn of(points: &[(f64, f64)]) -> Option<Self> {
        let n = points.len() as f64;
        if points.len() < 3 {
            return None;
        }
        let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / n;
        let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
        let sxx: f64 = points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
        let sxy: f64 = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
        if !(sxx > 0.0 && sxy.is_finite()) {
            return None;
        }
        let slope = sxy / sxx;
        let residuals: Vec<f64> = points.iter().map(|(x, y)| y - mean_y - slope * (x - mean_x)).collect();
        let squares: f64 = residuals.iter().map(|residual| residual * residual).sum();
        // Rounding alone is no scatter: a series that is a line to the last digits has no residuals.
        let scale: f64 = points.iter().map(|(_, y)| y * y).sum();
        if squares <= scale * 1e-24 {
            let interval = Some([slope, slope]);
            return Some(Self { slope, interval, autocorrelation: 0.0, effective_points: n, points: points.len() });
        }
        let products: f64 = residuals.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let autocorrelation = (products / squares).clamp(0.0, 1.0);
        let effective_points = n * (1.0 - autocorrelation) / (1.0 + autocorrelation);
        let freedom = effective_points - 2.0;
        let quantile = (freedom >= LEAST_FREEDOM).then(|| StudentsT::new(0.0, 1.0, freedom).ok()).flatten();
        let interval = quantile.map(|student| {
            let half = student.inverse_cdf(UPPER) * (squares / freedom / sxx).sqrt();
            [slope - half, slope + half]
        });
        Some(Self { slope, interval, autocorrelation, effective_points, points: points.len() })
    }

    /// Whether the interval includes 0. One that cannot be had does.
    pub fn may_be_zero(&self) -> bool {
        self.interval.is_none_or(|[low, high]| low <= 0.0 && high >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a small generator, so that the figures below can be made again elsewhere.
    fn noise(count: usize) -> Vec<f64> {
        let mut state = 12_345_u64;
        let next = || {
            state = (1_103_515_245 * state + 12_345) % 2_147_483_648;
            state as f64 / 2_147_483_648.0 - 0.5
        };
        std::iter::repeat_with(next).take(count).collect()
    }

    #[test]
    fn the_line_and_its_interval_are_those_of_ordinary_least_squares_where_nothing_hangs_together() {
        // scipy.stats.linregress and scipy.stats.t.ppf on the same points.
        let points: Vec<_> = noise(40).iter().enumerate().map(|(x, e)| (x as f64, 3.0 + 0.01 * x as f64 + e)).collect();
        let sut = Slope::of(&points).unwrap();
        let [low, high] = sut.interval.unwrap();
        assert_eq!(sut.autocorrelation, 0.0);
        for (value, expected) in [(sut.slope, SCIPY[0]), (low, SCIPY[1]), (high, SCIPY[2])] {
            assert!((value - expected).abs() < 1e-9, "{value} {expected}");
        }
        assert!(!sut.may_be_zero());
    }

    #[test]
    fn what_hangs_together_widens_the_interval() {
        let (mut level, mut points) = (0.0, Vec::new());
        for (x, e) in noise(120).into_iter().enumerate() {
            level = 0.8 * level + e;
            points.push((x as f64, 100.0 + level));
        }
        let sut = Slope::of(&points).unwrap();
        let [low, high] = sut.interval.unwrap();
        for (value, expected) in [(sut.autocorrelation, CHAINED[0]), (low, CHAINED[1]), (high, CHAINED[2])] {
            assert!((value - expected).abs() < 1e-9, "{value} {expected}");
        }
        assert!(sut.may_be_zero());
    }

    // slope, slope -+ t.ppf(0.975, 38) * stderr; autocorrelation of the residuals, slope -+ t.ppf(0.975, ne - 2) * stderr *
    // sqrt(118 / (ne - 2)) with ne = 120 (1 - r) / (1 + r).
    const SCIPY: [f64; 3] = [0.009432572178144227, 0.0023839985959156883, 0.016481145760372767];
    const CHAINED: [f64; 3] = [0.6796593972647631, -0.007877371501028872, 0.002210507766503756];

    #[test]
    fn a_leak_is_told_from_a_level() {
        let leak: Vec<_> = (0..60).map(|x| (f64::from(x), 10_000.0 + f64::from(x * 4 / 3))).collect();
        assert!(!Slope::of(&leak).unwrap().may_be_zero());
        let level: Vec<_> = (0..60).map(|x| (f64::from(x), 10_000.0)).collect();
        let sut = Slope::of(&level).unwrap();
        assert_eq!((sut.slope, sut.interval), (0.0, Some([0.0, 0.0])));
        assert!(sut.may_be_zero());
    }

    #[test]
    fn one_step_alone_is_no_trend_that_could_be_told() {
        let step: Vec<_> = (0..60).map(|x| (f64::from(x), if x < 30 { 100.0 } else { 104.0 })).collect();
        assert!(Slope::of(&step).unwrap().may_be_zero());
    }

    #[test]
    fn too_few_points_have_no_slope() {
        assert_eq!(Slope::of(&[(0.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(Slope::of(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]), None);
    }
}
