use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::by_level;
use super::echoes::Echoes;

/// Share of the darker returns that give no echo, by level.
const LOST: [f64; 3] = [0.1, 0.3, 0.6];

/// Dark surfaces answer too faintly: of the returns at most as bright as the median some are lost.
pub(super) fn weaken(echoes: &mut Echoes, level: u32, rng: &mut ChaCha8Rng) {
    let share = by_level(LOST, level);
    let mut bright = [0_usize; 256];
    echoes.list.iter().for_each(|echo| bright[usize::from(echo.r.intensity)] += 1);
    let mut darker = 0;
    let median = bright.iter().position(|count| {
        darker += count;
        2 * darker >= echoes.list.len()
    });
    let median = median.unwrap_or(0) as u8;
    echoes.list.retain(|echo| echo.r.intensity > median || rng.random::<f64>() >= share);
}
