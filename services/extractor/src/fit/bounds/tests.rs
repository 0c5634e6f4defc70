//! Bounds against what is left of a normal distribution when it is sampled.

use rand::RngExt;

use super::*;
use crate::fit::tests::random;

/// Bounds on the first parameters, in the order that they come: derivatives and slack.
fn bounds(of: &[([f64; 3], f64)]) -> Bounds {
    let mut bounds = Bounds::new(of.len());
    for (row, slack_m) in of {
        let mut block = Block::NONE;
        block.rows = std::array::from_fn(|axis| [row.get(axis).copied().unwrap_or(0.0); MOST_LANES]);
        block.slack_m[0] = *slack_m;
        bounds.push(&block);
    }
    bounds
}

/// Standard deviations of three parameters and none of the others.
fn before(deviations: [f64; 3]) -> [[f64; MOST]; MOST] {
    let mut covariance = [[0.0; MOST]; MOST];
    for (axis, deviation) in deviations.into_iter().enumerate() {
        covariance[axis][axis] = deviation * deviation;
    }
    covariance
}

/// Means and variances of what bounds leave, by trying.
fn sampled(deviations: [f64; 3], of: &[([f64; 3], f64)]) -> Normal {
    let mut random = random(51);
    // The sum of twelve evenly distributed numbers is as good as normal.
    let mut normal = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
    let (mut count, mut sum, mut squares) = (0.0, [0.0; MOST], [[0.0; MOST]; MOST]);
    while count < 20_000.0 {
        let place: [f64; 3] = deviations.map(|deviation| deviation * normal());
        if of.iter().all(|(row, slack_m)| row.iter().zip(place).map(|(r, p)| r * p).sum::<f64>() <= *slack_m) {
            count += 1.0;
            for axis in 0..3 {
                sum[axis] += place[axis];
                squares[axis][axis] += place[axis] * place[axis];
            }
        }
    }
    let mean = sum.map(|sum| sum / count);
    let mut covariance = squares;
    for axis in 0..3 {
        covariance[axis][axis] = squares[axis][axis] / count - mean[axis] * mean[axis];
    }
    Normal { mean, covariance }
}

#[test]
fn what_bounds_leave_is_what_sampling_finds() {
    let cases: [&[([f64; 3], f64)]; 5] = [
        &[([1.0, 0.0, 0.0], 0.3)],
        &[([1.0, 0.0, 0.0], 0.3), ([-1.0, 0.0, 0.0], 0.2)],
        &[([1.0, 0.5, 0.0], 0.3), ([-1.0, 0.5, 0.0], 0.2), ([0.0, -1.0, 0.3], 0.4)],
        &[([1.0, 1.0, 0.0], 0.1), ([-1.0, 1.0, 0.0], 0.1), ([1.0, -1.0, 0.0], 0.3), ([-1.0, -1.0, 0.0], 0.0)],
        &[([1.0, 0.0, 0.0], 0.05), ([0.8, 0.3, 0.2], 0.1), ([-0.9, 0.1, -0.3], 0.3), ([0.0, 0.0, 1.0], 9.0)],
    ];
    let deviations = [1.0, 0.5, 0.3];
    for (number, case) in cases.into_iter().enumerate() {
        let sut = bounds(case).narrow(&before(deviations), MOST, 1e-3);
        let expected = sampled(deviations, case);
        for axis in 0..3 {
            let [own, other] = [&sut, &expected].map(|normal| normal.covariance[axis][axis].sqrt());
            // Never too narrow; between two bounds a fifth too wide.
            assert!((0.9..1.25).contains(&(own / other)), "case {number}, axis {axis}: {own} for {other}");
            let off = (sut.mean[axis] - expected.mean[axis]).abs();
            assert!(off < 0.2 * other, "case {number}, axis {axis}: {} for {}", sut.mean[axis], expected.mean[axis]);
        }
    }
}

#[test]
fn an_interval_leaves_a_twelfth_of_its_square_or_a_little_more() {
    let sut = bounds(&[([1.0, 0.0, 0.0], 0.06), ([-1.0, 0.0, 0.0], 0.14)]).narrow(&before([5.0, 1.0, 1.0]), MOST, 1e-4);
    let share = sut.covariance[0][0] / (0.04 / 12.0);
    assert!((1.0..1.5).contains(&share), "{share}");
    assert!((sut.mean[0] + 0.04).abs() < 0.02, "{}", sut.mean[0]);
    assert!((sut.covariance[1][1] - 1.0).abs() < 1e-9);
}

#[test]
fn many_rays_beside_one_edge_count_no_more_than_one() {
    let pair = [([1.0, 0.0, 0.0], 0.1), ([-1.0, 0.0, 0.0], 0.1)];
    let one = bounds(&pair).narrow(&before([2.0, 1.0, 1.0]), MOST, 1e-3);
    let many = bounds(&pair.repeat(40)).narrow(&before([2.0, 1.0, 1.0]), MOST, 1e-3);
    let share = (many.covariance[0][0] / one.covariance[0][0]).sqrt();
    assert!((0.7..=1.01).contains(&share), "{share}");
}

#[test]
fn bounds_that_are_far_off_change_nothing() {
    let sut = bounds(&[([1.0, 0.0, 0.0], 2.5), ([0.0, 1.0, 0.0], 3.0)]).narrow(&before([1.0, 1.0, 1.0]), MOST, 1e-3);
    assert_eq!(sut.covariance, before([1.0, 1.0, 1.0]));
    assert_eq!(bounds(&[]).narrow(&before([1.0, 1.0, 1.0]), MOST, 1e-3).covariance, before([1.0, 1.0, 1.0]));
}

#[test]
fn bounds_that_contradict_each_other_leave_numbers() {
    for gap_m in [1e-6, 0.1, 10.0, 1e3] {
        let pair = [([1.0, 0.2, 0.0], -gap_m), ([-1.0, 0.1, 0.0], -gap_m)];
        let sut = bounds(&pair).narrow(&before([1.0, 1e-3, 30.0]), MOST, 1e-3);
        assert!(sut.covariance.iter().flatten().chain(&sut.mean).all(|number| number.is_finite()), "{gap_m}");
        assert!((0..3).all(|axis| sut.covariance[axis][axis] > 0.0), "{gap_m}");
    }
}

#[test]
fn the_hazard_is_that_of_the_normal_distribution() {
    // By summing the density from far below.
    let density = |x: f64| (-0.5 * x * x).exp();
    for step in -80..60 {
        let x = f64::from(step) * 0.1;
        let below = (0..200_000).map(|i| density(x - (f64::from(i) + 0.5) * 1e-4)).sum::<f64>() * 1e-4;
        let (sut, expected) = (hazard(x), density(x) / below);
        assert!((sut / expected - 1.0).abs() < 2e-4, "{x}: {sut} for {expected}");
    }
    assert!((hazard(-1e4) / 1e4 - 1.0).abs() < 1e-6);
    assert_eq!(hazard(60.0), 0.0);
}
