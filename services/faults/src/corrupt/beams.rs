use messages::Sweep;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::by_level;
use super::echoes::Echoes;

/// Share of the beams that is lost, by level: 2, 8, 16 of 32.
const LOST: [f64; 3] = [1.0 / 16.0, 1.0 / 4.0, 1.0 / 2.0];

/// Beams at random give no returns. An unorganised sweep has no beams: it loses as many of its returns.
pub(super) fn lose(echoes: &mut Echoes, level: u32, sweep: &Sweep, rng: &mut ChaCha8Rng) {
    let share = by_level(LOST, level);
    let rings = sweep.rings.len();
    if rings == 0 {
        echoes.list.retain(|_| rng.random::<f64>() >= share);
        return;
    }
    let mut lost = [false; lidar::MAX_RINGS];
    let mut left = ((rings as f64 * share).round() as usize).clamp(1, rings);
    while left > 0 {
        let ring = &mut lost[rng.random_range(0..rings)];
        left -= usize::from(!*ring);
        *ring = true;
    }
    echoes.list.retain(|echo| !lost.get(usize::from(echo.r.ring)).is_some_and(|lost| *lost));
}
