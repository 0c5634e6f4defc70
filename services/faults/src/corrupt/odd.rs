//! Sweeps that no surroundings look like.

use lidar::MAX_RETURNS;
use messages::Sweep;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::echoes::{Echo, Echoes, at, firings};

/// Radius of the shell round the sensor [m]: neighbouring rings are 0.1 m apart there.
const SHELL_M: f32 = 5.0;
/// Where the returns of an overfull sweep lie [m].
const OVERFULL_M: [f32; 2] = [2.0, 60.0];

/// One return, whichever.
pub(super) fn keep_one(echoes: &mut Echoes, rng: &mut ChaCha8Rng) {
    if !echoes.list.is_empty() {
        let place = rng.random_range(0..echoes.list.len());
        echoes.list.swap(0, place);
        echoes.list.truncate(1);
    }
}

/// No coordinate is a number.
pub(super) fn forget_numbers(echoes: &mut Echoes) {
    for echo in &mut echoes.list {
        (echo.r.x, echo.r.y, echo.r.z) = (f32::NAN, f32::NAN, f32::NAN);
    }
}

/// Each return twice, one behind the other.
pub(super) fn double(echoes: &mut Echoes) {
    let before = echoes.list.len();
    echoes.list.extend_from_within(..);
    for place in (0..before).rev() {
        let echo = echoes.list[place];
        echoes.list[2 * place] = echo;
        echoes.list[2 * place + 1] = echo;
    }
}

/// Every firing meets the same shell; in an unorganised sweep every return lies on it.
pub(super) fn surround(echoes: &mut Echoes, sweep: &Sweep) {
    if sweep.rings.is_empty() {
        echoes.list.iter_mut().for_each(|echo| {
            echo.set_range_m(SHELL_M);
            *echo = Echo::of_nothing(echo.r);
        });
        return;
    }
    echoes.list.clear();
    echoes.list.extend(firings(sweep).map(|firing| Echo::of_nothing(at(firing, SHELL_M, 100))));
    echoes.sort(sweep);
}

/// As many returns as the message holds, and one more, at ranges by chance: each firing gives several.
///
/// An unorganised sweep, and one without a column, repeats its returns; an empty one of those stays empty.
pub(super) fn overfill(echoes: &mut Echoes, sweep: &Sweep, rng: &mut ChaCha8Rng) {
    let range_m = |rng: &mut ChaCha8Rng| OVERFULL_M[0] + (OVERFULL_M[1] - OVERFULL_M[0]) * rng.random::<f32>();
    let wanted = MAX_RETURNS + 1;
    let rays = firings(sweep).count();
    if let Some(each) = wanted.checked_div(rays) {
        echoes.list.clear();
        // The first firings give one return more than the others where it does not come out even.
        for (place, firing) in firings(sweep).enumerate() {
            let returns = each + usize::from(place < wanted - each * rays);
            let one = |_| Echo::of_nothing(at(firing, range_m(rng), 100));
            echoes.list.extend((0..returns).map(one));
        }
        echoes.sort(sweep);
        return;
    }
    let before = echoes.list.len();
    for place in before..if before > 0 { wanted } else { 0 } {
        let mut echo = Echo::of_nothing(echoes.list[place % before].r);
        echo.set_range_m(range_m(rng));
        echoes.list.push(echo);
    }
}
