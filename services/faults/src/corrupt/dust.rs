use messages::Sweep;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::by_level;
use super::echoes::{Echo, Echoes, at, firings};

/// Share of the rays that meet a grain, by level.
const MET: [f64; 3] = [0.02, 0.10, 0.25];
/// Share of those that are seen where nothing stood behind: most grains are too faint.
const SEEN_ALONE: f64 = 0.1;
/// Where grains are seen [m].
const NEAR_M: [f32; 2] = [0.5, 5.0];
/// Intensity of a grain, at most.
const FAINT: u8 = 12;

/// A cloud of grains round the sensor: false returns nearby, and what is behind them is lost, or fainter.
///
/// A ray that meets a grain shows it in place of its return, or loses its return, half each. Empty firings of an organised
/// sweep show a grain now and then.
pub(super) fn raise(echoes: &mut Echoes, level: u32, sweep: &Sweep, rng: &mut ChaCha8Rng) {
    let share = by_level(MET, level);
    let grain_m = |rng: &mut ChaCha8Rng| NEAR_M[0] + (NEAR_M[1] - NEAR_M[0]) * rng.random::<f32>();
    echoes.list.retain_mut(|echo| {
        let met = rng.random::<f64>();
        if met >= share {
            echo.r.intensity = (f64::from(echo.r.intensity) * (1.0 - share)) as u8;
            return true;
        }
        let range_m = grain_m(rng);
        if met < share / 2.0 && range_m < echo.r.range_m() {
            echo.set_range_m(range_m);
            *echo = Echo::of_nothing(echo.r);
            echo.r.intensity = rng.random_range(1..=FAINT);
            return true;
        }
        false
    });
    if sweep.rings.is_empty() {
        return;
    }
    echoes.note_fired();
    for firing @ (column, ring, _) in firings(sweep) {
        let shows = rng.random::<f64>() < share * SEEN_ALONE;
        if shows && !echoes.has_fired(column, ring) {
            let grain = at(firing, grain_m(rng), rng.random_range(1..=FAINT));
            echoes.list.push(Echo::of_nothing(grain));
        }
    }
    echoes.sort(sweep);
}
