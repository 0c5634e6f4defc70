//! From decision values to probabilities, as libsvm does it: a sigmoid for each pair of classes, then pairwise coupling
//! (Wu, Lin and Weng, "Probability estimates for multi-class classification by pairwise coupling", JMLR 5, 2004,
//! second method, Eq. 2.13 and Algorithm 2).

/// Probability of the first class of a pair given its decision value: 1 / (1 + exp(a·value + b)), kept 1e-7 away from
/// 0 and 1.
pub fn pairwise_probability(value: f64, a: f64, b: f64) -> f64 {
    let x = value * a + b;
    // Either form alone overflows on one side.
    let probability = if x >= 0.0 { (-x).exp() / (1.0 + (-x).exp()) } else { 1.0 / (1.0 + x.exp()) };
    probability.clamp(1e-7, 1.0 - 1e-7)
}

/// Class probabilities from `pairwise[i][j]`, the probability of class i given that it is i or j (the diagonal is not
/// read; `pairwise[j][i]` = 1 − `pairwise[i][j]`, all within (0, 1)). Sums to 1.
///
/// Minimises Σᵢ Σⱼ (r_ji p_i − r_ij p_j)² under Σ p = 1 by libsvm's fixed-point iteration, with its tolerance and its
/// bound of 100 rounds.
pub fn couple<const N: usize>(pairwise: &[[f64; N]; N]) -> [f64; N] {
    const ROUNDS: usize = 100;
    let tolerance = 0.005 / N as f64;
    let mut q = [[0.0; N]; N];
    for t in 0..N {
        for j in (0..N).filter(|&j| j != t) {
            q[t][t] += pairwise[j][t] * pairwise[j][t];
            q[t][j] = -pairwise[j][t] * pairwise[t][j];
        }
    }
    let mut p = [1.0 / N as f64; N];
    for _ in 0..ROUNDS {
        let mut qp: [f64; N] = std::array::from_fn(|t| (0..N).map(|j| q[t][j] * p[j]).sum());
        let mut pqp: f64 = (0..N).map(|t| p[t] * qp[t]).sum();
        let error = qp.iter().map(|value| (value - pqp).abs()).fold(0.0, f64::max);
        if error < tolerance {
            break;
        }
        for t in 0..N {
            let step = (pqp - qp[t]) / q[t][t];
            p[t] += step;
            pqp = (pqp + step * (step * q[t][t] + 2.0 * qp[t])) / (1.0 + step) / (1.0 + step);
            for j in 0..N {
                qp[j] = (qp[j] + step * q[t][j]) / (1.0 + step);
                p[j] /= 1.0 + step;
            }
        }
    }
    let sum: f64 = p.iter().sum();
    p.map(|value| value / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consistent_pairs_give_back_their_probabilities() {
        let truth = [0.5, 0.3, 0.15, 0.05];
        let pairwise: [[f64; 4]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| truth[i] / (truth[i] + truth[j])));
        for (found, expected) in couple(&pairwise).iter().zip(truth) {
            assert!((found - expected).abs() < 0.01, "{:?}", couple(&pairwise));
        }
    }

    #[test]
    fn probabilities_agree_with_libsvm_rs() {
        for seed in 0..200_u32 {
            let value = |i: usize, j: usize| f64::from((seed * 7 + (i * 31 + j * 17) as u32 * 13) % 101) / 101.0;
            let mut pairwise = [[0.0; 4]; 4];
            for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                pairwise[i][j] = value(i, j).clamp(1e-7, 1.0 - 1e-7);
                pairwise[j][i] = 1.0 - pairwise[i][j];
            }
            let mut expected = [0.0; 4];
            let rows: Vec<Vec<f64>> = pairwise.iter().map(|row| row.to_vec()).collect();
            libsvm_rs::probability::multiclass_probability(4, &rows, &mut expected);
            let found = couple(&pairwise);
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() < 1e-9, "{found:?} {expected:?}");
            }
            assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_sigmoid_is_stable_at_both_ends() {
        assert_eq!(pairwise_probability(0.0, -2.0, 0.0), 0.5);
        assert_eq!(pairwise_probability(1e6, -2.0, 0.0), 1.0 - 1e-7);
        assert_eq!(pairwise_probability(-1e6, -2.0, 0.0), 1e-7);
    }
}
