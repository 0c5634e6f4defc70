use messages::Bin;

use crate::BINS;

/// The Naive Bayes classifier of Sec. V-1. Classes in the order of [`lidar::ObstacleClass::SOLIDS`].
///
/// Every feature combination of a cluster is taken as an independent draw (Eq. 5). A descriptor carries frequencies
/// instead of the counts n_k; with the uniform prior the most likely class is the same for any number of draws, but a
/// probability needs one: `draws`, found in training, since neighbouring points are anything but independent.
#[derive(Clone, Debug, PartialEq)]
pub struct NaiveBayes {
    log_phi: Vec<[f64; 4]>,
    log_prior: [f64; 4],
    draws: f64,
}

/// Why a table is no Naive Bayes model.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NaiveBayesError {
    /// Another number of rows than bins.
    #[error("the model has {0} bins, must have {BINS}")]
    Bins(usize),
    /// Not the logarithm of a probability.
    #[error("the model has a log probability of {0}, must be finite and at most 0")]
    LogProbability(f64),
    /// No usable number of draws.
    #[error("draws is {0}, must be positive and finite")]
    Draws(f64),
}

impl NaiveBayes {
    /// A model of the logarithms of φ_{k|q} (one row for each bin) and φ_q, and the independent draws that a cluster's
    /// descriptor is worth.
    ///
    /// # Errors
    /// A number that is no log probability, another number of bins than 1728, or no positive number of draws.
    pub fn new(log_phi: Vec<[f64; 4]>, log_prior: [f64; 4], draws: f64) -> Result<Self, NaiveBayesError> {
        if log_phi.len() != BINS {
            return Err(NaiveBayesError::Bins(log_phi.len()));
        }
        for &value in log_phi.iter().flatten().chain(&log_prior) {
            if !value.is_finite() || value > 0.0 {
                return Err(NaiveBayesError::LogProbability(value));
            }
        }
        if !draws.is_finite() || draws <= 0.0 {
            return Err(NaiveBayesError::Draws(draws));
        }
        Ok(Self { log_phi, log_prior, draws })
    }

    /// Probability of each class given a cluster's bins (indices under 1728); sums to 1.
    pub fn posterior(&self, bins: &[Bin]) -> [f64; 4] {
        let mut log_likelihood = self.log_prior;
        for bin in bins {
            let draws = self.draws * f64::from(bin.weight);
            for (sum, log_phi) in log_likelihood.iter_mut().zip(self.log_phi[bin.index as usize]) {
                *sum += draws * log_phi; // Eq. (6)
            }
        }
        let most = log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let relative = log_likelihood.map(|value| (value - most).exp());
        let sum: f64 = relative.iter().sum();
        relative.map(|value| value / sum)
    }

    /// Logarithms of φ_{k|q}, a row for each bin.
    pub fn log_phi(&self) -> &[[f64; 4]] {
        &self.log_phi
    }

    /// Logarithms of φ_q.
    pub fn log_prior(&self) -> [f64; 4] {
        self.log_prior
    }

    /// Independent draws that a descriptor is worth.
    pub fn draws(&self) -> f64 {
        self.draws
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(usize, [f64; 4])]) -> Vec<[f64; 4]> {
        let mut log_phi = vec![[0.001_f64.ln(); 4]; BINS];
        for &(bin, phi) in rows {
            log_phi[bin] = phi.map(f64::ln);
        }
        log_phi
    }

    #[test]
    fn posteriors_are_those_of_a_calculation_by_hand() {
        let sut = NaiveBayes::new(
            table(&[(3, [0.5, 0.25, 0.125, 0.0625]), (1_727, [0.1, 0.2, 0.4, 0.4])]),
            [0.25_f64.ln(); 4],
            2.0,
        )
        .unwrap();
        // Two draws, half of the weight each: φ₃^1 φ₁₇₂₇^1 = 0.05, 0.05, 0.05, 0.025.
        let posterior = sut.posterior(&[Bin { index: 3, weight: 0.5 }, Bin { index: 1_727, weight: 0.5 }]);
        for (found, expected) in posterior.iter().zip([2.0, 2.0, 2.0, 1.0]) {
            assert!((found - expected / 7.0).abs() < 1e-12, "{posterior:?}");
        }
        // φ₃² = 1/4, 1/16, 1/64, 1/256.
        let posterior = sut.posterior(&[Bin { index: 3, weight: 1.0 }]);
        for (found, expected) in posterior.iter().zip([64.0, 16.0, 4.0, 1.0]) {
            assert!((found - expected / 85.0).abs() < 1e-12, "{posterior:?}");
        }
    }

    #[test]
    fn the_prior_decides_where_nothing_else_does() {
        let prior = [0.1_f64, 0.2, 0.3, 0.4];
        let sut = NaiveBayes::new(table(&[]), prior.map(f64::ln), 5.0).unwrap();
        for (found, expected) in sut.posterior(&[Bin { index: 9, weight: 1.0 }]).iter().zip(prior) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_table_that_is_no_model_is_refused() {
        let prior = [0.25_f64.ln(); 4];
        let refused = |table, prior, draws| NaiveBayes::new(table, prior, draws).unwrap_err();
        assert_eq!(refused(vec![[-1.0; 4]; 1_727], prior, 1.0), NaiveBayesError::Bins(1_727));
        assert_eq!(refused(vec![[0.5; 4]; BINS], prior, 1.0), NaiveBayesError::LogProbability(0.5));
        assert_eq!(
            refused(table(&[]), [f64::NEG_INFINITY; 4], 1.0),
            NaiveBayesError::LogProbability(f64::NEG_INFINITY)
        );
        assert_eq!(refused(table(&[]), prior, 0.0), NaiveBayesError::Draws(0.0));
    }
}
