/// e^x for x ≤ 0 to within 3e-7 of itself; 0 below −87. Branch-free arithmetic that the compiler turns into vectors,
/// which `f32::exp`, a call for each number, prevents.
///
/// x = n ln 2 + r with |r| ≤ ln 2 / 2; e^r by its series to the sixth power (remainder 1.2e-7), 2^n by its bits.
#[inline(always)]
pub(crate) fn exp_of_negative(x: f32) -> f32 {
    /// ln 2 in two parts: the first has few digits, so that n times it is exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    /// Added and taken away again, it leaves the nearest whole number: 1.5 · 2^23.
    const WHOLE: f32 = 12_582_912.0;
    let bounded = x.clamp(-87.0, 0.0);
    let shifted = bounded * std::f32::consts::LOG2_E + WHOLE;
    let n = shifted - WHOLE;
    let r = (bounded - n * LN_2_HIGH) - n * LN_2_LOW;
    let series =
        1.0 + r * (1.0 + r * (1.0 / 2.0 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    // The last bits of `shifted` are those of n; the others are shifted out.
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23));
    if x < -87.0 { 0.0 } else { series * power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential_to_seven_digits() {
        let mut worst = 0.0_f64;
        for step in 0..870_000 {
            let x = -(step as f32) * 1e-4;
            let exact = f64::from(x).exp();
            worst = worst.max((f64::from(exp_of_negative(x)) - exact).abs() / exact);
        }
        assert!(worst < 3e-7, "{worst}");
        assert_eq!(exp_of_negative(0.0), 1.0);
        assert_eq!(exp_of_negative(-0.0), 1.0);
    }

    #[test]
    fn far_below_zero_it_is_nothing() {
        assert_eq!(exp_of_negative(-88.0), 0.0);
        assert_eq!(exp_of_negative(f32::NEG_INFINITY), 0.0);
    }
}
