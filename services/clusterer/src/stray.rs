//! How far returns lie from where their columns say they are.

use lidar::{Column, Return};

/// Largest angle between a return and its column that the window allows for [rad], and its sine.
pub(crate) const MOST_STRAY_RAD: f32 = 0.4995;
const MOST_STRAY_SINE: f32 = 0.479;
/// Squared range above which nothing is measured any more [m²].
const FAR_M2: f32 = 1e12;

/// Whether returns keep what their sweep promises: they come in order of their columns, a firing gives one, and each lies
/// within `stray_rad` of its column and 1,000 km of the sensor. Columns are numbered in `columns`, rings below 64.
pub(crate) fn is_kept(columns: &[Column], returns: &[Return], stray_rad: f32) -> bool {
    let most_sine = stray_rad.sin();
    let most_sine_2 = most_sine * most_sine;
    let (mut fired, mut kept, mut column) = (0_u64, true, None);
    walk(columns, returns, |r, along_m, across_m, h_m2| {
        if column != Some(r.column) {
            (column, fired) = (Some(r.column), 0);
        }
        let bit = 1 << (r.ring & 63);
        kept &= (fired & bit == 0) & (along_m > 0.0) & (across_m * across_m <= most_sine_2 * h_m2);
        fired |= bit;
    }) && kept
}

/// A bound on the angle between returns and their columns [rad], but for returns of squared horizontal range up to
/// `close_m2`; none where a return lies more than half a radian from its column or beyond 1,000 km, or where returns are not
/// in order of their columns.
pub(crate) fn measure(columns: &[Column], returns: &[Return], close_m2: f32) -> Option<f32> {
    let (mut most_sine_2, mut ahead) = (0.0_f32, true);
    let in_order = walk(columns, returns, |_, along_m, across_m, h_m2| {
        if h_m2 > close_m2 {
            ahead &= along_m > 0.0;
            most_sine_2 = most_sine_2.max(across_m * across_m / h_m2);
        }
    });
    let most_sine = most_sine_2.sqrt();
    // Rounding of the sine is a part of the windows' margin.
    (in_order && ahead && most_sine <= MOST_STRAY_SINE).then(|| most_sine.asin())
}

/// Calls `with` for each return: how far it is along its column's azimuth and across it [m], and its squared horizontal
/// range [m²]. False where returns are not in order of their columns or beyond 1,000 km; then not for all.
#[inline]
fn walk(columns: &[Column], returns: &[Return], mut with: impl FnMut(&Return, f32, f32, f32)) -> bool {
    let (mut column, mut sine, mut cosine) = (0, 0.0, 0.0);
    for (place, r) in returns.iter().enumerate() {
        if place == 0 || r.column != column {
            if r.column < column {
                return false;
            }
            column = r.column;
            (sine, cosine) = columns.get(usize::from(column)).map_or((0.0, 0.0), |here| here.azimuth_rad.sin_cos());
        }
        let h_m2 = r.x * r.x + r.y * r.y;
        if h_m2 + r.z * r.z >= FAR_M2 {
            return false;
        }
        with(r, r.x * cosine + r.y * sine, r.y * cosine - r.x * sine, h_m2);
    }
    true
}
