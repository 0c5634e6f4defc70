use lidar::ObstacleClass;

use crate::params::ClassParams;

/// What all sweeps say together of an obstacle's class: sums of log-posteriors.
///
/// Sweeps a tenth of a second apart see nearly the same side of a body and are wrong together: each counts `weight`, and
/// what was said before is kept by `kept` a sweep, so that the sum stays as sure as it is right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Belief {
    /// ln of the posterior but for a constant: the largest is 0.
    log: [f64; 4],
    /// Sweeps that said anything.
    judged: bool,
}

impl Belief {
    /// Adds a sweep's posterior, counted `trust` times as much as another; all 0 says nothing.
    pub(crate) fn add(&mut self, posterior: &[f32; 4], trust: f64, params: &ClassParams) {
        let sum: f64 = posterior.iter().map(|&one| f64::from(one)).sum();
        if sum <= 0.0 {
            return;
        }
        self.judged = true;
        for (log, &one) in self.log.iter_mut().zip(posterior) {
            // A sweep is never surer than its classifier was ever seen to be: mixed with "any".
            let believed = f64::from(one) / sum * (1.0 - 4.0 * params.floor) + params.floor;
            *log = *log * params.kept + params.weight * trust * believed.ln();
        }
        let largest = self.log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for log in &mut self.log {
            *log -= largest;
        }
    }

    /// Posterior over [`ObstacleClass::SOLIDS`]; all 0 where no sweep said anything.
    pub(crate) fn posterior(&self) -> [f64; 4] {
        if !self.judged {
            return [0.0; 4];
        }
        let odds = self.log.map(f64::exp);
        let sum: f64 = odds.iter().sum();
        odds.map(|one| one / sum)
    }

    /// The likeliest class; of equals the first. `Unclassified` where no sweep said anything.
    pub(crate) fn class(&self) -> ObstacleClass {
        if !self.judged {
            return ObstacleClass::Unclassified;
        }
        // The largest is 0 exactly.
        let place = self.log.iter().position(|&log| log == 0.0);
        place.map_or(ObstacleClass::Unclassified, |place| ObstacleClass::SOLIDS[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: ClassParams = ClassParams { weight: 0.5, kept: 0.9, floor: 0.01 };

    // verifies TRA-012
    #[test]
    fn agreeing_sweeps_make_sure_and_one_that_disagrees_does_not_turn_them() {
        let mut belief = Belief::default();
        assert_eq!((belief.class(), belief.posterior()), (ObstacleClass::Unclassified, [0.0; 4]));
        let mut before = 0.0;
        for _ in 0..20 {
            belief.add(&[0.1, 0.7, 0.1, 0.1], 1.0, &PARAMS);
            assert!(belief.posterior()[1] > before);
            before = belief.posterior()[1];
        }
        belief.add(&[0.97, 0.01, 0.01, 0.01], 1.0, &PARAMS);
        assert_eq!(belief.class(), ObstacleClass::Ellipsoidal);
        assert!(belief.posterior()[1] < before);
        assert!((belief.posterior().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn evidence_is_forgotten_so_that_no_obstacle_is_ever_certain() {
        let mut belief = Belief::default();
        for _ in 0..10_000 {
            belief.add(&[1.0, 0.0, 0.0, 0.0], 1.0, &PARAMS);
        }
        // Σ 0.5·ln(0.97/0.01)·0.9ⁿ = 22.9: one in ten thousand millions.
        let ratio = belief.posterior()[0] / belief.posterior()[1];
        assert!((ratio.ln() - 0.5 * (97.0_f64).ln() / 0.1).abs() < 1e-6);
    }

    #[test]
    fn a_sweep_without_a_verdict_says_nothing() {
        let mut belief = Belief::default();
        belief.add(&[0.0, 0.0, 0.2, 0.8], 1.0, &PARAMS);
        let before = belief;
        belief.add(&[0.0; 4], 1.0, &PARAMS);
        assert_eq!(belief, before);
    }
}
