//! The standard normal distribution, and nodes to integrate over it.

use std::f64::consts::FRAC_1_SQRT_2;

/// Standard deviations beyond which nothing is looked for: 1e-4 of a normal distribution lies outside.
pub(super) const REACH: f64 = 3.9;
/// Probability within [`REACH`] on both sides: Φ(3.9) − Φ(−3.9).
const WITHIN: f64 = 0.999_903_8;

/// Q in erfc(x) = exp(−x²)·t·Q(t), t = 1/(1 + x/2): a least-squares fit over all x ≥ 0, relative error 1.6e-7.
const Q: [f64; 10] = [
    0.2820947427,
    0.2821044734,
    0.2465079596,
    0.1804463166,
    0.05813949734,
    0.07973665174,
    -0.1988829647,
    0.03097885722,
    0.06439277719,
    -0.02551848175,
];

/// Φ(z), with a relative error of 1.6e-7 in both tails; about 0 and 1 at the infinities.
pub(super) fn cumulative(z: f64) -> f64 {
    let x = (z.abs() * FRAC_1_SQRT_2).min(26.0);
    let t = 1.0 / (1.0 + 0.5 * x);
    let q = Q.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient);
    let tail = 0.5 * t * q * (-x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// P(low < z < high) for a standard normal z; 0 for an empty interval.
pub(super) fn between(low: f64, high: f64) -> f64 {
    if low >= high {
        return 0.0;
    }
    // The difference of the smaller tails keeps its digits.
    if low > 0.0 { cumulative(-low) - cumulative(-high) } else { cumulative(high) - cumulative(low) }
}

/// As [`between`], of what lies within [`REACH`]: 1 for all of it.
pub(super) fn share(low: f64, high: f64) -> f64 {
    (between(low.max(-REACH), high.min(REACH)) / WITHIN).min(1.0)
}

/// Nodes and weights of Gauss and Legendre on [−1, 1], the positive half of ten.
const TEN: [(f64, f64); 5] = [
    (0.148_874_338_981_631_2, 0.295_524_224_714_752_9),
    (0.433_395_394_129_247_2, 0.269_266_719_309_996_4),
    (0.679_409_568_299_024_4, 0.219_086_362_515_982),
    (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
    (0.973_906_528_517_171_7, 0.066_671_344_308_688_1),
];
/// The same of six.
const SIX: [(f64, f64); 3] = [
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_3),
];

/// Both halves of a rule, mapped to [low, high]; weights as on [−1, 1].
fn mapped<const HALF: usize, const ALL: usize>(rule: &[(f64, f64); HALF], low: f64, high: f64) -> [(f64, f64); ALL] {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    std::array::from_fn(|place| {
        let (node, weight) = rule[place / 2];
        (if place % 2 == 0 { middle - half * node } else { middle + half * node }, weight)
    })
}

/// Ten nodes in [low, high].
fn ten(low: f64, high: f64) -> [(f64, f64); 10] {
    mapped(&TEN, low, high)
}

/// Ten nodes between `low` and `high`, both within [`REACH`], with the weights of a standard normal distribution: they sum
/// to the share between the two.
pub(super) fn nodes(low: f64, high: f64) -> [(f64, f64); 10] {
    let nearest = 0.0_f64.clamp(low, high);
    let nodes = ten(low, high).map(|(z, weight)| (z, weight * (0.5 * (nearest * nearest - z * z)).exp()));
    let scale = share(low, high) / nodes.iter().map(|&(_, weight)| weight).sum::<f64>();
    nodes.map(|(z, weight)| (z, weight * scale))
}

/// Six nodes in [low, high].
pub(super) fn six(low: f64, high: f64) -> [(f64, f64); 6] {
    mapped(&SIX, low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_function_is_that_of_the_tables() {
        // Abramowitz and Stegun, tables 26.1 and 26.2.
        for (z, expected) in [
            (0.0, 0.5),
            (1.0, 0.841_344_746_068_543),
            (2.0, 0.977_249_868_051_821),
            (-1.0, 0.158_655_253_931_457),
            (-3.0, 1.349_898_031_630_1e-3),
            (-5.0, 2.866_515_718_791_9e-7),
        ] {
            assert!((cumulative(z) / expected - 1.0).abs() < 2e-7, "{z}");
        }
        assert!(cumulative(f64::NEG_INFINITY) < 1e-290);
        assert_eq!(cumulative(f64::INFINITY), 1.0);
        assert!((between(-REACH, REACH) - WITHIN).abs() < 1e-7);
        assert_eq!(share(-10.0, 10.0), 1.0);
    }

    #[test]
    fn weighted_nodes_have_the_moments_of_what_they_stand_for() {
        let moment =
            |low: f64, high: f64, power: i32| nodes(low, high).iter().map(|&(z, w)| w * z.powi(power)).sum::<f64>();
        assert!((moment(-REACH, REACH, 0) - 1.0).abs() < 1e-12);
        assert!((moment(-REACH, REACH, 2) - 1.0).abs() < 0.02);
        // Beyond 2: Φ(−2), and the density at 2 for the mean.
        assert!((moment(2.0, REACH, 0) - 0.022_704).abs() < 1e-5);
        assert!((moment(2.0, REACH, 1) - 0.053_797).abs() < 1e-4);
    }

    #[test]
    fn rules_integrate_the_polynomials_they_are_made_for() {
        let sum = |nodes: &[(f64, f64)], power: i32| nodes.iter().map(|&(x, w)| w * x.powi(power)).sum::<f64>();
        for power in [0, 2, 10] {
            let exact = 2.0 / f64::from(power + 1);
            assert!((sum(&ten(-1.0, 1.0), power) - exact).abs() < 1e-14);
            assert!((sum(&six(-1.0, 1.0), power) - exact).abs() < 1e-14);
        }
        assert!(sum(&ten(-1.0, 1.0), 5).abs() < 1e-15);
        assert!((sum(&ten(-1.0, 1.0), 18) - 2.0 / 19.0).abs() < 1e-14);
    }
}
