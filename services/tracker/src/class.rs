use lidar::ObstacleClass;

use crate::params::ClassParams;

/// What all sweeps say together of an obstacle's class: the mean of their log-posteriors, counted as often as they are
/// independent of each other.
///
/// Sweeps a tenth of a second apart see nearly the same side of a body and are wrong together. The first counts once, so
/// that one sweep is believed as its classifier gave it; every further one adds `fresh_share` to that count. For errors of
/// which a share lasts, the sum of likelihoods grows so. What was said before is kept by `kept` a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Belief {
    /// Sum of ln of the posteriors but for a constant: the largest is 0.
    log: [f64; 4],
    /// Sweeps in that sum, forgotten as they are; 0 where none said anything.
    sweeps: f64,
    /// What each of them counts.
    weight: f64,
}

impl Belief {
    /// Adds a sweep's posterior; all 0 says nothing.
    pub(crate) fn add(&mut self, posterior: &[f32; 4], params: &ClassParams) {
        let sum: f64 = posterior.iter().map(|&one| f64::from(one)).sum();
        if sum <= 0.0 {
            return;
        }
        for (log, &one) in self.log.iter_mut().zip(posterior) {
            // A sweep is never surer than its classifier was ever seen to be: mixed with "any".
            let believed = f64::from(one) / sum * (1.0 - 4.0 * params.floor) + params.floor;
            *log = *log * params.kept + believed.ln();
        }
        let largest = self.log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for log in &mut self.log {
            *log -= largest;
        }
        self.sweeps = self.sweeps * params.kept + 1.0;
        self.weight = (1.0 + (self.sweeps - 1.0) * params.fresh_share) / self.sweeps;
    }

    /// Posterior over [`ObstacleClass::SOLIDS`]; all 0 where no sweep said anything.
    pub(crate) fn posterior(&self) -> [f64; 4] {
        if self.sweeps == 0.0 {
            return [0.0; 4];
        }
        let odds = self.log.map(|log| (log * self.weight).exp());
        let sum: f64 = odds.iter().sum();
        odds.map(|one| one / sum)
    }

    /// The likeliest class; of equals the first. `Unclassified` where no sweep said anything.
    pub(crate) fn class(&self) -> ObstacleClass {
        if self.sweeps == 0.0 {
            return ObstacleClass::Unclassified;
        }
        // The largest is 0 exactly.
        let place = self.log.iter().position(|&log| log == 0.0);
        place.map_or(ObstacleClass::Unclassified, |place| ObstacleClass::SOLIDS[place])
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const PARAMS: ClassParams = ClassParams { fresh_share: 0.12, kept: 0.9, floor: 0.01 };

    /// After so many sweeps that all say the same.
    fn told(posterior: &[f32; 4], sweeps: usize) -> Belief {
        let mut belief = Belief::default();
        (0..sweeps).for_each(|_| belief.add(posterior, &PARAMS));
        belief
    }

    // verifies TRA-012
    #[test]
    fn agreeing_sweeps_make_sure_and_one_that_disagrees_does_not_turn_them() {
        let mut belief = Belief::default();
        assert_eq!((belief.class(), belief.posterior()), (ObstacleClass::Unclassified, [0.0; 4]));
        let mut before = 0.0;
        for _ in 0..20 {
            belief.add(&[0.1, 0.7, 0.1, 0.1], &PARAMS);
            assert!(belief.posterior()[1] > before);
            before = belief.posterior()[1];
        }
        belief.add(&[0.97, 0.01, 0.01, 0.01], &PARAMS);
        assert_eq!(belief.class(), ObstacleClass::Ellipsoidal);
        assert!(belief.posterior()[1] < before);
        assert!((belief.posterior().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_sweep_is_believed_as_it_is() {
        let said = told(&[0.1, 0.2, 0.3, 0.4], 1).posterior();
        for (said, one) in said.iter().zip([0.1, 0.2, 0.3, 0.4]) {
            assert!((said - (one * 0.96 + 0.01)).abs() < 1e-6);
        }
    }

    #[test]
    fn evidence_is_forgotten_so_that_no_obstacle_is_ever_certain() {
        let posterior = told(&[1.0, 0.0, 0.0, 0.0], 10_000).posterior();
        // Ten sweeps are remembered, the first of which counts once and each other 0.12.
        let ratio = posterior[0] / posterior[1];
        assert!((ratio.ln() - (1.0 + 9.0 * 0.12) * 97.0_f64.ln()).abs() < 1e-6);
    }

    #[test]
    fn a_belief_turns_when_what_is_forgotten_is_more_than_what_is_remembered() {
        let mut belief = told(&[0.9, 0.1, 0.0, 0.0], 100);
        // 0.9⁶ > ½ > 0.9⁷.
        (0..6).for_each(|_| belief.add(&[0.1, 0.9, 0.0, 0.0], &PARAMS));
        assert_eq!(belief.class(), ObstacleClass::Rectangular);
        belief.add(&[0.1, 0.9, 0.0, 0.0], &PARAMS);
        assert_eq!(belief.class(), ObstacleClass::Ellipsoidal);
    }

    #[test]
    fn a_sweep_without_a_verdict_says_nothing() {
        let mut belief = told(&[0.0, 0.0, 0.2, 0.8], 1);
        let before = belief;
        belief.add(&[0.0; 4], &PARAMS);
        assert_eq!(belief, before);
    }

    /// Mean posterior of the claimed class less the share that is right, after ten sweeps whose log-odds, of one class
    /// against another, are each calibrated and have errors of which 0.4 lasts.
    fn overconfidence(params: &ClassParams) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let normal = |random: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(random) };
        let obstacles = 4_000;
        let mut sum = 0.0;
        for obstacle in 0..obstacles {
            let second = obstacle % 2 == 1;
            let lasting = normal(&mut random);
            let mut belief = Belief::default();
            for _ in 0..10 {
                // Log-odds of normal measurements: the variance is twice the mean.
                let error = 0.4_f64.sqrt() * lasting + 0.6_f64.sqrt() * normal(&mut random);
                let odds = if second { 1.0 } else { -1.0 } + 2.0_f64.sqrt() * error;
                let posterior = (1.0 / (1.0 + (-odds).exp())) as f32;
                belief.add(&[1.0 - posterior, posterior, 0.0, 0.0], params);
            }
            let claimed = belief.posterior()[0].max(belief.posterior()[1]);
            let right = (belief.class() == ObstacleClass::Ellipsoidal) == second;
            sum += claimed - f64::from(u8::from(right));
        }
        sum / f64::from(obstacles)
    }

    #[test]
    fn a_posterior_is_as_sure_as_it_is_right_where_errors_last() {
        let exact = ClassParams { fresh_share: 0.12, kept: 1.0, floor: 1e-6 };
        assert!(overconfidence(&exact).abs() < 0.01);
        assert!(overconfidence(&ClassParams { fresh_share: 1.0, ..exact }) > 0.1, "as if they were independent");
        assert!(overconfidence(&ClassParams { fresh_share: 0.0, ..exact }) < -0.1, "as if they were one");
    }
}
