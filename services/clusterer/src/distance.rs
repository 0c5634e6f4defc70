/// Squared distance of two points [m²], single precision.
///
/// The one distance of this crate: every method and the oracle call it, so they agree to the bit. Symmetric: a
/// difference changes its sign with the order of the points and nothing else, and the squares forget it.
#[inline(always)]
pub fn squared_m2(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (dx, dy, dz) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    dx * dx + dy * dy + dz * dz
}

/// How much farther than d two points can truly be that [`squared_m2`] calls within d, as a factor: a few roundings
/// of 6e-8 each, and a margin of ten.
pub(crate) const ROUNDING: f32 = 1.0 + 4e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_is_symmetric_to_the_bit() {
        let points = [[0.1, 0.2, 0.3], [-7.7, 3.3e-5, 1e6], [1.1, 1e-30, -0.0], [5.5, 4.4, 3.3]];
        for a in points {
            for b in points {
                assert_eq!(squared_m2(a, b).to_bits(), squared_m2(b, a).to_bits());
            }
        }
    }
}
