//! Naive Bayes (Sec. V-1): Eq. 7 with the smoothing it needs, and the number of draws that a descriptor is worth.

use classifier::{BINS, NaiveBayes, NaiveBayesError};

use crate::Example;

/// What was fitted, and how well it does where it was not fitted.
pub(crate) struct Fitted {
    pub(crate) model: NaiveBayes,
    pub(crate) smoothing: f64,
    /// Share of the training set that cross-validation got right.
    pub(crate) cross_validated: f64,
}

/// Fits to `examples`, choosing the smoothing with the best cross-validation (the first of equals).
pub(crate) fn fit(examples: &[Example], smoothing: &[f64], folds: usize) -> Result<Fitted, NaiveBayesError> {
    let mut best: Option<(f64, f64, f64)> = None;
    for &candidate in smoothing {
        let (right, scores) = cross_validate(examples, candidate, folds);
        if best.is_none_or(|(most, ..)| right > most) {
            best = Some((right, candidate, likeliest_draws(&scores)));
        }
    }
    let (cross_validated, smoothing, draws) = best.unwrap_or((0.0, 1.0, 1.0));
    let model = NaiveBayes::new(log_phi(examples.iter(), smoothing), [0.25_f64.ln(); 4], draws)?;
    Ok(Fitted { model, smoothing, cross_validated })
}

/// ln φ_{k|q}, Eq. 7. The paper divides by the number of examples, which makes no probability where examples have
/// several draws each; here each example counts as one draw spread over its bins, and each bin has `smoothing` more.
fn log_phi<'a>(examples: impl Iterator<Item = &'a Example>, smoothing: f64) -> Vec<[f64; 4]> {
    let mut weight = vec![[smoothing; 4]; BINS];
    let mut sum = [smoothing * BINS as f64; 4];
    for example in examples {
        let Some(class) = example.class.solid_index() else { continue };
        for bin in &example.bins {
            weight[bin.index as usize][class] += f64::from(bin.weight); // Eq. (7)
        }
        sum[class] += 1.0;
    }
    weight.iter().map(|row| std::array::from_fn(|class| (row[class] / sum[class]).ln())).collect()
}

/// Share that is right, and of each example its class's place and Σ h_k ln φ_{k|q}, each found without its own fold.
fn cross_validate(examples: &[Example], smoothing: f64, folds: usize) -> (f64, Vec<(usize, [f64; 4])>) {
    let mut scores = Vec::with_capacity(examples.len());
    for fold in 0..folds {
        let others = examples.iter().enumerate().filter(|(place, _)| place % folds != fold).map(|(_, example)| example);
        let log_phi = log_phi(others, smoothing);
        for example in examples.iter().skip(fold).step_by(folds) {
            let Some(class) = example.class.solid_index() else { continue };
            let score = std::array::from_fn(|q| {
                example.bins.iter().map(|bin| f64::from(bin.weight) * log_phi[bin.index as usize][q]).sum()
            });
            scores.push((class, score));
        }
    }
    let right = scores.iter().filter(|(class, score)| (0..4).all(|q| q == *class || score[q] < score[*class])).count();
    (right as f64 / scores.len().max(1) as f64, scores)
}

/// The number of draws under which the true classes are likeliest, 0.1 to 1000: the log-likelihood is concave in it.
fn likeliest_draws(scores: &[(usize, [f64; 4])]) -> f64 {
    let log_likelihood = |draws: f64| -> f64 {
        scores
            .iter()
            .map(|(class, score)| {
                let most = score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let sum: f64 = score.iter().map(|s| (draws * (s - most)).exp()).sum();
                draws * (score[*class] - most) - sum.ln()
            })
            .sum()
    };
    let (mut low, mut high) = (0.1_f64, 1_000.0_f64);
    for _ in 0..60 {
        // Thirds of the logarithm.
        let third = (high / low).powf(1.0 / 3.0);
        let (a, b) = (low * third, high / third);
        if log_likelihood(a) < log_likelihood(b) { low = a } else { high = b }
    }
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use lidar::ObstacleClass;
    use messages::Bin;

    use super::*;

    fn example(class: usize, bins: &[(u32, f32)]) -> Example {
        let bins = bins.iter().map(|&(index, weight)| Bin { index, weight }).collect();
        Example { class: ObstacleClass::SOLIDS[class], points: 9, range_m: 4.0, bins }
    }

    #[test]
    fn phi_is_the_mean_histogram_smoothed_and_sums_to_one() {
        let examples = [example(0, &[(3, 1.0)]), example(0, &[(3, 0.5), (4, 0.5)]), example(2, &[(9, 1.0)])];
        let log_phi = log_phi(examples.iter(), 0.01);
        assert!((log_phi[3][0].exp() - 1.51 / 19.28).abs() < 1e-12);
        assert!((log_phi[4][0].exp() - 0.51 / 19.28).abs() < 1e-12);
        assert!((log_phi[9][2].exp() - 1.01 / 18.28).abs() < 1e-12);
        assert!((log_phi[9][1].exp() - 1.0 / 1_728.0).abs() < 1e-12);
        for class in 0..4 {
            let sum: f64 = log_phi.iter().map(|row| row[class].exp()).sum();
            assert!((sum - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn draws_are_few_where_scores_mislead_and_many_where_they_do_not() {
        let sure: Vec<_> =
            (0..100).map(|i| (i % 4, std::array::from_fn(|q| if q == i % 4 { 0.0 } else { -1.0 }))).collect();
        assert!(likeliest_draws(&sure) > 20.0);
        let misled: Vec<_> =
            (0..100).map(|i| (i % 4, std::array::from_fn(|q| if q == i % 3 { 0.0 } else { -1.0 }))).collect();
        assert!(likeliest_draws(&misled) < 2.0);
    }
}
