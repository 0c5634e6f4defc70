//! Whether posteriors mean what they say, and the temperature that makes them (Guo et al., "On calibration of modern
//! neural networks", ICML 2017).

use classifier::{MAX_TEMPERATURE, MIN_TEMPERATURE};

/// Bins of a reliability table, of equal width.
pub const RELIABILITY_BINS: usize = 15;

/// −ln of the posterior of `class` (under 4) with scores divided by `temperature`, in nats; finite for any finite
/// scores.
pub fn log_loss(scores: [f64; 4], class: usize, temperature: f64) -> f64 {
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = scores.iter().map(|score| ((score - most) / temperature).exp()).sum();
    sum.ln() - (scores[class] - most) / temperature
}

/// The temperature, 0.01 to 100, that makes the mean log loss of these scores and classes (under 4) least; 1 where
/// there are none. Scores should be of examples that the model has not seen. Where every verdict is right the loss
/// falls without end as the temperature does, and the least is taken; where scores mislead, the greatest.
pub fn best_temperature(scores: &[[f64; 4]], classes: &[u8]) -> f64 {
    const STEPS: usize = 60;
    if scores.is_empty() {
        return 1.0;
    }
    let loss = |log_temperature: f64| -> f64 {
        let temperature = log_temperature.exp();
        scores.iter().zip(classes).map(|(&scores, &class)| log_loss(scores, usize::from(class), temperature)).sum()
    };
    // The loss is convex in 1/T, so that it has one valley in ln T too. Golden section: one end of the two inner points
    // is always of use again.
    let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (MIN_TEMPERATURE.ln(), MAX_TEMPERATURE.ln());
    let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
    let mut at = inner(low, high);
    let mut losses = at.map(loss);
    for _ in 0..STEPS {
        if losses[0] <= losses[1] {
            high = at[1];
            at = [high - golden * (high - low), at[0]];
            losses = [loss(at[0]), losses[0]];
        } else {
            low = at[0];
            at = [at[1], low + golden * (high - low)];
            losses = [losses[1], loss(at[1])];
        }
    }
    ((low + high) / 2.0).exp().clamp(MIN_TEMPERATURE, MAX_TEMPERATURE)
}

/// How often verdicts are right, by how sure they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// Bin m holds the verdicts with a greatest posterior over m/15 and at most (m + 1)/15.
    pub bins: [ReliabilityBin; RELIABILITY_BINS],
}

/// Verdicts of about equal posterior.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReliabilityBin {
    /// How many.
    pub count: usize,
    /// Mean of their greatest posterior; 0 where there are none.
    pub confidence: f64,
    /// Share of them that is right; 0 where there are none.
    pub accuracy: f64,
}

impl Reliability {
    /// Of posteriors and the true classes (under 4). The verdict is the first class of greatest posterior.
    pub fn of(judged: impl IntoIterator<Item = ([f64; 4], u8)>) -> Self {
        let mut bins = [ReliabilityBin::default(); RELIABILITY_BINS];
        for (posterior, class) in judged {
            let verdict = (1..4).fold(0, |most, q| if posterior[q] > posterior[most] { q } else { most });
            let confidence = posterior[verdict];
            let place = (confidence * RELIABILITY_BINS as f64).ceil() as usize;
            let bin = &mut bins[place.saturating_sub(1).min(RELIABILITY_BINS - 1)];
            bin.count += 1;
            bin.confidence += confidence;
            bin.accuracy += f64::from(u8::from(verdict == usize::from(class)));
        }
        for bin in bins.iter_mut().filter(|bin| bin.count > 0) {
            bin.confidence /= bin.count as f64;
            bin.accuracy /= bin.count as f64;
        }
        Self { bins }
    }

    /// Mean distance of accuracy from confidence over all verdicts, 0 to 1; 0 where there are none.
    pub fn expected_calibration_error(&self) -> f64 {
        let count: usize = self.bins.iter().map(|bin| bin.count).sum();
        let distance: f64 = self.bins.iter().map(|bin| bin.count as f64 * (bin.accuracy - bin.confidence).abs()).sum();
        distance / count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loss_is_minus_the_logarithm_of_the_posterior() {
        let scores = [1.0, 2.0, 3.0, 4.0].map(f64::ln);
        assert!((log_loss(scores, 1, 1.0) + 0.2_f64.ln()).abs() < 1e-12);
        assert!((log_loss(scores, 3, 0.5) + (16.0_f64 / 30.0).ln()).abs() < 1e-12);
        assert!((log_loss([0.0; 4], 2, 7.0) - 4.0_f64.ln()).abs() < 1e-12);
        assert_eq!(log_loss([1e6, 0.0, 0.0, 0.0], 1, 1.0), 1e6);
        assert_eq!(log_loss([1e6, 0.0, 0.0, 0.0], 0, 0.01), 0.0);
    }

    #[test]
    fn the_temperature_undoes_what_sharpened_the_posteriors() {
        // Of ten rows, as many of each class as the posterior says once the temperature is right.
        let classes = [0, 0, 0, 0, 0, 0, 1, 1, 2, 3];
        for temperature in [0.02, 0.4, 1.0, 2.5, 30.0] {
            let scores = [0.6, 0.2, 0.1, 0.1].map(|p: f64| temperature * p.ln());
            let found = best_temperature(&[scores; 10], &classes);
            assert!((found / temperature - 1.0).abs() < 1e-4, "{found} is not {temperature}");
        }
    }

    #[test]
    fn the_temperature_is_least_where_scores_are_always_right_and_greatest_where_they_mislead() {
        let scores = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
        assert!((best_temperature(&scores, &[0, 1]) / MIN_TEMPERATURE - 1.0).abs() < 1e-6);
        assert!((best_temperature(&scores, &[1, 0]) / MAX_TEMPERATURE - 1.0).abs() < 1e-6);
        assert_eq!(best_temperature(&[], &[]), 1.0);
        let equal = best_temperature(&[[0.0; 4]; 3], &[0, 1, 2]);
        assert!((MIN_TEMPERATURE..=MAX_TEMPERATURE).contains(&equal));
    }

    #[test]
    fn no_temperature_near_the_best_one_loses_less() {
        // A linear congruence for scores that agree with the class more often than not.
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let classes: Vec<u8> = [0, 1, 2, 3].repeat(100);
        let scores: Vec<[f64; 4]> = classes
            .iter()
            .map(|&class| std::array::from_fn(|q| 9.0 * random() + if q == usize::from(class) { 4.0 } else { 0.0 }))
            .collect();
        let loss = |temperature| -> f64 {
            scores.iter().zip(&classes).map(|(&s, &class)| log_loss(s, usize::from(class), temperature)).sum()
        };
        let best = best_temperature(&scores, &classes);
        assert!(best > 1.0, "{best}");
        for factor in [0.5, 0.99, 0.999, 1.001, 1.01, 2.0] {
            assert!(loss(best) < loss(best * factor));
        }
    }

    fn sure(p: f64, verdict: usize) -> [f64; 4] {
        std::array::from_fn(|q| if q == verdict { p } else { (1.0 - p) / 3.0 })
    }

    #[test]
    fn a_reliability_table_has_count_confidence_and_accuracy_of_each_bin() {
        let judged = [
            (sure(0.95, 0), 0),
            (sure(0.97, 1), 1),
            (sure(1.0, 2), 2),
            (sure(0.96, 3), 0),
            (sure(0.5, 1), 1),
            (sure(0.49, 1), 2),
        ];
        let table = Reliability::of(judged);
        let near = |bin: usize, count, confidence: f64, accuracy: f64| {
            let found = table.bins[bin];
            assert_eq!(found.count, count);
            assert!((found.confidence - confidence).abs() < 1e-12 && (found.accuracy - accuracy).abs() < 1e-12);
        };
        near(14, 4, 0.97, 0.75);
        near(7, 2, 0.495, 0.5);
        near(0, 0, 0.0, 0.0);
        assert_eq!(table.bins.iter().map(|bin| bin.count).sum::<usize>(), 6);
        let expected = (4.0 * 0.22 + 2.0 * 0.005) / 6.0;
        assert!((table.expected_calibration_error() - expected).abs() < 1e-12);
    }

    #[test]
    fn a_posterior_between_two_bins_is_in_the_lower() {
        let bin_of = |p| Reliability::of([(sure(p, 0), 0)]).bins.iter().position(|bin| bin.count == 1);
        assert_eq!(bin_of(0.4), Some(5));
        assert_eq!(bin_of(0.4_f64.next_up()), Some(6));
        assert_eq!(bin_of(0.6), Some(8));
        assert_eq!(bin_of(1.0), Some(14));
        assert_eq!(bin_of(0.25), Some(3));
    }

    #[test]
    fn nothing_judged_has_no_error_and_the_first_of_equal_classes_is_the_verdict() {
        assert_eq!(Reliability::of([]).expected_calibration_error(), 0.0);
        assert_eq!(Reliability::of([([0.25; 4], 0), ([0.25; 4], 1)]).bins[3].accuracy, 0.5);
    }
}
