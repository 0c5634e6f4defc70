//! What the sensor makes of a surface: whether it answers, how far, how bright.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use crate::cast::Hit;

/// Most counts of a packet's distance field.
pub(crate) const MOST_COUNTS: f64 = 65_535.0;

/// A checked description of range noise, dropouts and limits.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Receiver {
    /// Standard deviation of a range [m].
    pub(crate) range_sigma_m: f64,
    /// Share of echoes that are lost.
    pub(crate) dropout: f64,
    /// Nearest and farthest surface that answers [m].
    pub(crate) reach_m: [f64; 2],
    /// One count of a range [m]; none where ranges are left as they are.
    pub(crate) quantum_m: Option<f64>,
}

/// What the sensor reports of one firing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Echo {
    pub(crate) range_m: f64,
    pub(crate) intensity: u8,
}

impl Receiver {
    /// The echo of a firing, or none for a miss, a dropout, or a surface out of reach (one nearer than the reach still
    /// hides what is behind it). Draws the same random numbers for every surface met, whatever becomes of it.
    pub(crate) fn echo(&self, hit: &Hit, albedo: f64, rng: &mut impl Rng) -> Option<Echo> {
        let luck: f64 = rng.random();
        let noise: f64 = rng.sample(StandardNormal);
        let [near, far] = self.reach_m;
        if luck < self.dropout || hit.range_m < near || hit.range_m > far {
            return None;
        }
        let measured = hit.range_m + self.range_sigma_m * noise;
        let range_m = match self.quantum_m {
            Some(quantum_m) => (measured / quantum_m).round().min(MOST_COUNTS) * quantum_m,
            None => measured,
        };
        (range_m > 0.0).then(|| Echo { range_m, intensity: intensity(hit, albedo, far) })
    }
}

/// A matt surface (Lambert's cosine) before a receiver that makes up for distance but for a half at its reach.
/// A model of our own: no stage uses intensities.
fn intensity(hit: &Hit, albedo: f64, far_m: f64) -> u8 {
    let fade = 1.0 - 0.5 * (hit.range_m / far_m).powi(2);
    (255.0 * albedo * f64::from(hit.cosine) * fade).round().clamp(1.0, 255.0) as u8
}
