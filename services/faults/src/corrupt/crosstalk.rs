use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::by_level;
use super::echoes::Echoes;

/// Share of the returns that are another laser's, by level.
const MIXED: [f64; 3] = [0.01, 0.04, 0.10];

/// Returns at random are given another one's range and intensity: a laser's receiver saw another laser's echo.
pub(super) fn mix(echoes: &mut Echoes, level: u32, rng: &mut ChaCha8Rng) {
    let share = by_level(MIXED, level);
    let returns = echoes.list.len();
    for place in 0..returns {
        if rng.random::<f64>() < share {
            let other = echoes.list[rng.random_range(0..returns)].r;
            let echo = &mut echoes.list[place];
            echo.set_range_m(other.range_m());
            echo.r.intensity = other.intensity;
            echo.owner = messages::NO_OBJECT;
        }
    }
}
