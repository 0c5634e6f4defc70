use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::KillsFile;
use crate::Injection;

/// Before the first kill [s].
const WARM_UP_S: f64 = 2.0;

/// Each of `stages` killed `times` times: round by round, the stages of a round in any order, at any phase of a sweep; some once
/// more while the successor starts. The same file and seed give the same list.
pub(crate) fn kills(file: &KillsFile, stages: &[String], seed: u64, period_s: f64) -> Vec<Injection> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut list = Vec::new();
    for round in 0..file.times {
        let mut order: Vec<&String> = stages.iter().collect();
        order.shuffle(&mut rng);
        for stage in order {
            // Both are always drawn, so that the share changes no phase.
            let [phase, again, delay] = [(); 3].map(|()| rng.random::<f64>());
            let at_s = WARM_UP_S + list.len() as f64 * file.spacing_s + phase * period_s;
            list.push(Injection {
                at_s: (at_s * 1e6).round() / 1e6,
                fault: "kill".to_owned(),
                stage: Some(stage.clone()),
                words: vec!["kill".to_owned(), stage.clone()],
                lasts_s: 0.0,
                // Of few kills, too, some come at start-up.
                again_ms: (again < file.again_share || (file.again_share > 0.0 && round == 1))
                    .then(|| (delay * file.again_within_ms * 1e3).round() / 1e3),
            });
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_kills_at_the_same_moments_and_each_stage_as_often() {
        let file = KillsFile { times: 40, spacing_s: 3.0, again_share: 0.25, again_within_ms: 150.0, stages: None };
        let stages: Vec<String> = ["source", "clusterer", "recorder"].map(str::to_owned).to_vec();
        let list = kills(&file, &stages, 7, 0.1);
        assert_eq!(list, kills(&file, &stages, 7, 0.1));
        assert_ne!(list, kills(&file, &stages, 8, 0.1));
        for stage in &stages {
            assert_eq!(list.iter().filter(|kill| kill.stage.as_ref() == Some(stage)).count(), 40);
        }
        assert!(list.windows(2).all(|pair| pair[1].at_s - pair[0].at_s > 2.8));
        let again = list.iter().filter(|kill| kill.again_ms.is_some()).count();
        assert!((20..50).contains(&again), "{again}");
    }
}
