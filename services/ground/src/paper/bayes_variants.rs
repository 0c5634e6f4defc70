//! Naive Bayes as the paper's Eq. 7 can also be read, on counts n_k instead of frequencies.

use classifier::BINS;
use lidar::ObstacleClass;

use crate::Example;

/// Pairs of neighbours that a return makes: k of Eq. 3, the return itself not counted.
const PAIRS_OF_A_RETURN: f64 = 4.0;

/// What becomes of Eq. 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reading {
    /// Counts over the number of examples m, as printed; a class that never had a combination is ruled out by it.
    Literal,
    /// The same, a combination never seen counting as seen once in all examples.
    LiteralFloor,
    /// A probability: counts over all counts of the class, one more for each combination (Laplace).
    Pooled,
}

/// ln φ_{k|q}, a row for each combination.
pub(crate) struct Table(Vec<[f64; 4]>);

impl Table {
    pub(crate) fn fit(examples: &[Example], reading: Reading) -> Self {
        let mut counts = vec![[0.0_f64; 4]; BINS];
        let mut seen = [0.0_f64; 4];
        for example in examples {
            let Some(class) = example.class.solid_index() else { continue };
            seen[class] += 1.0;
            for (bin, count) in counted(example) {
                counts[bin][class] += count;
            }
        }
        let sums: [f64; 4] = std::array::from_fn(|class| counts.iter().map(|row| row[class] + 1.0).sum());
        let phi = |count: f64, class: usize| match reading {
            Reading::Literal => count / seen[class], // Eq. (7)
            Reading::LiteralFloor => {
                if count > 0.0 {
                    count / seen[class]
                } else {
                    1.0 / seen[class]
                }
            }
            Reading::Pooled => (count + 1.0) / sums[class],
        };
        Self(counts.iter().map(|row| std::array::from_fn(|class| phi(row[class], class).ln())).collect())
    }

    /// The class of the greatest log-likelihood; the first where several are equal.
    pub(crate) fn verdict(&self, example: &Example) -> ObstacleClass {
        let mut sums = [0.0_f64; 4];
        for (bin, count) in counted(example) {
            for (sum, log_phi) in sums.iter_mut().zip(self.0[bin]) {
                *sum += count * log_phi; // Eq. (6)
            }
        }
        ObstacleClass::SOLIDS[(1..4).fold(0, |most, q| if sums[q] > sums[most] { q } else { most })]
    }
}

/// n_k of Eq. 5: a cluster's bins as counts, which sum to its pairs of neighbours.
fn counted(example: &Example) -> impl Iterator<Item = (usize, f64)> + '_ {
    let pairs = PAIRS_OF_A_RETURN * f64::from(example.points);
    example.bins.iter().map(move |bin| (bin.index as usize, f64::from(bin.weight) * pairs))
}

#[cfg(test)]
mod tests {
    use messages::Bin;

    use super::*;

    fn example(class: usize, points: u32, bins: &[u32]) -> Example {
        let weight = 1.0 / bins.len() as f32;
        let bins = bins.iter().map(|&index| Bin { index, weight }).collect();
        Example { class: ObstacleClass::SOLIDS[class], points, range_m: 5.0, bins }
    }

    #[test]
    fn readings_of_eq_7_are_those_of_a_calculation_by_hand() {
        let examples = [example(0, 5, &[7]), example(0, 10, &[7, 8]), example(1, 5, &[8]), example(1, 5, &[8])];
        let phi = |reading, bin: usize, class: usize| Table::fit(&examples, reading).0[bin][class].exp();
        // Class 0: combination 7 has 20 + 20 counts in two examples, 8 has 20.
        assert!((phi(Reading::Literal, 7, 0) - 20.0).abs() < 1e-9);
        assert_eq!(phi(Reading::Literal, 7, 1), 0.0);
        assert!((phi(Reading::LiteralFloor, 7, 1) - 0.5).abs() < 1e-12);
        assert!((phi(Reading::Pooled, 7, 0) - 41.0 / 1_788.0).abs() < 1e-12);
        assert!((phi(Reading::Pooled, 9, 1) - 1.0 / 1_768.0).abs() < 1e-12);
    }

    #[test]
    fn a_combination_never_seen_rules_a_class_out_only_where_eq_7_is_literal() {
        let mut examples = vec![example(0, 5, &[1, 2]); 3];
        examples.extend(vec![example(1, 5, &[1]); 3]);
        examples.extend([example(2, 5, &[9]), example(3, 5, &[9])]);
        let mostly_of_the_second =
            Example { bins: vec![Bin { index: 1, weight: 0.9 }, Bin { index: 2, weight: 0.1 }], ..example(1, 5, &[1]) };
        assert_eq!(Table::fit(&examples, Reading::Literal).verdict(&mostly_of_the_second), ObstacleClass::Rectangular);
        assert_eq!(
            Table::fit(&examples, Reading::LiteralFloor).verdict(&mostly_of_the_second),
            ObstacleClass::Ellipsoidal
        );
    }
}
