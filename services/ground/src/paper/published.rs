//! What Bylard and Paudel print.

/// Rows: actual; columns: predicted; rectangular, ellipsoidal, cylindrical, conical \[%\].
pub(crate) type Table = [[f64; 4]; 4];

/// Table I: Naive Bayes.
pub(crate) const NAIVE_BAYES: Table =
    [[62.0, 11.0, 12.0, 15.0], [11.0, 46.0, 32.0, 11.0], [25.0, 12.0, 47.0, 16.0], [34.0, 15.0, 36.0, 15.0]];

/// Table II: support vector machine.
pub(crate) const SVM: Table =
    [[73.0, 5.0, 18.0, 4.0], [12.0, 72.0, 7.0, 9.0], [20.0, 15.0, 51.0, 14.0], [44.0, 7.0, 27.0, 22.0]];

/// Table III: places of the two classes, and the share right \[%\].
pub(crate) const TWO_CLASS: [(usize, usize, f64); 6] =
    [(0, 1, 98.0), (0, 2, 87.0), (0, 3, 88.0), (1, 2, 86.0), (1, 3, 90.0), (2, 3, 67.0)];

/// Mean of a table's diagonal \[%\].
pub(crate) fn mean(table: &Table) -> f64 {
    (0..4).map(|class| table[class][class]).sum::<f64>() / 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_rows_add_up() {
        for row in NAIVE_BAYES.iter().chain(&SVM) {
            assert_eq!(row.iter().sum::<f64>(), 100.0);
        }
        assert_eq!((mean(&NAIVE_BAYES), mean(&SVM)), (42.5, 54.5));
    }
}
