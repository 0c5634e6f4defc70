use super::normal::{REACH, share, six};

/// Probability of an ellipse, axes along the coordinates, under two independent normal distributions.
///
/// Foster and Estes (1992) integrate over circles, Alfano (2005) over strips; these are strips, at nodes of Gauss and
/// Legendre that crowd at the ends, where the ellipse's edge is steep.
pub(super) fn ellipse(centre: [f64; 2], half: [f64; 2], mean: [f64; 2], sigma: [f64; 2]) -> f64 {
    // Strips across the axis along which the distribution is narrower: their probability changes slowly from one to the next.
    if sigma[0] * half[1] > sigma[1] * half[0] {
        let swap = |[one, other]: [f64; 2]| [other, one];
        return strips(swap(centre), swap(half), swap(mean), swap(sigma));
    }
    strips(centre, half, mean, sigma)
}

/// The same, of strips across the first axis.
fn strips(centre: [f64; 2], half: [f64; 2], mean: [f64; 2], sigma: [f64; 2]) -> f64 {
    let low = ((centre[0] - half[0] - mean[0]) / sigma[0]).max(-REACH);
    let high = ((centre[0] + half[0] - mean[0]) / sigma[0]).min(REACH);
    let beside = ((mean[1] - centre[1]).abs() - half[1]) / sigma[1];
    if low >= high || beside > REACH {
        return 0.0;
    }
    let nearest = 0.0_f64.clamp(low, high);
    let (middle, width) = (0.5 * (low + high), 0.5 * (high - low));
    let crowd = if low > -REACH { 0.25 } else { 0.0 } + if high < REACH { 0.25 } else { 0.0 };
    let (mut sum, mut weights) = (0.0, 0.0);
    for (node, weight) in six(-1.0, 1.0) {
        let z = middle + width * node * (1.0 + crowd * (1.0 - node * node));
        let weight = weight * (1.0 + crowd * (1.0 - 3.0 * node * node)) * (0.5 * (nearest * nearest - z * z)).exp();
        let place = (mean[0] + z * sigma[0] - centre[0]) / half[0];
        let edge = half[1] * (1.0 - place * place).max(0.0).sqrt();
        weights += weight;
        sum += weight * share((centre[1] - edge - mean[1]) / sigma[1], (centre[1] + edge - mean[1]) / sigma[1]);
    }
    if weights > 0.0 { sum / weights * share(low, high) } else { 0.0 }
}
