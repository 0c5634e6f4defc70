use messages::Sweep;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::by_level;
use super::echoes::Echoes;

/// Largest error of a range [m], by level.
const RANGE_M: [f32; 3] = [0.02, 0.06, 0.15];
/// Largest error of an azimuth in columns, by level.
const COLUMNS: [f32; 3] = [0.5, 1.5, 3.0];
/// The same where there are no columns [rad]: as for columns of 0.17°.
const UNORGANISED_STEP_RAD: f32 = 0.003;

/// Ranges and azimuths are smeared: the sensor shakes faster than it turns. Errors are uniform; a return keeps its column.
pub(super) fn smear(echoes: &mut Echoes, level: u32, sweep: &Sweep, rng: &mut ChaCha8Rng) {
    let step_rad = sweep.header.column_step_rad;
    let step_rad = if step_rad > 0.0 { step_rad } else { UNORGANISED_STEP_RAD };
    let (most_m, most_rad) = (by_level(RANGE_M, level), by_level(COLUMNS, level) * step_rad);
    let mut error = |most: f32| (2.0 * rng.random::<f32>() - 1.0) * most;
    for echo in &mut echoes.list {
        let range_m = echo.r.range_m();
        // Never through the sensor to its other side.
        echo.set_range_m((range_m + error(most_m)).max(0.1 * range_m));
        let (sin, cos) = error(most_rad).sin_cos();
        (echo.r.x, echo.r.y) = (echo.r.x * cos - echo.r.y * sin, echo.r.x * sin + echo.r.y * cos);
    }
}
