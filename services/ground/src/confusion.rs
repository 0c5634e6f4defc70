use std::fmt;

use lidar::ObstacleClass;

/// How often each true class (row) was taken for each class (column), in the paper's order; unclassified apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Confusion {
    counts: [[u32; 4]; 4],
    unclassified: [u32; 4],
}

impl Confusion {
    /// Counts one verdict on an obstacle of class `actual`; nothing for an actual class that is no solid.
    pub fn count(&mut self, actual: ObstacleClass, verdict: ObstacleClass) {
        let Some(row) = actual.solid_index() else { return };
        match verdict.solid_index() {
            Some(column) => self.counts[row][column] += 1,
            None => self.unclassified[row] += 1,
        }
    }

    /// Verdicts by actual (row) and predicted class.
    pub fn counts(&self) -> [[u32; 4]; 4] {
        self.counts
    }

    /// Clusters of each actual class that had too few points.
    pub fn unclassified(&self) -> [u32; 4] {
        self.unclassified
    }

    /// The rows in per cent of the classified; 0 for an empty row.
    pub fn per_cent(&self) -> [[f64; 4]; 4] {
        self.counts.map(|row| {
            let sum: u32 = row.iter().sum();
            row.map(|count| 100.0 * f64::from(count) / f64::from(sum.max(1)))
        })
    }

    /// Mean of the diagonal [%]: every class counts the same.
    pub fn mean_per_cent(&self) -> f64 {
        let rows = self.per_cent();
        (0..4).map(|class| rows[class][class]).sum::<f64>() / 4.0
    }

    /// Clusters that were given one of the four classes.
    pub fn classified(&self) -> u32 {
        self.counts.iter().flatten().sum()
    }

    /// Standard error of the mean of the diagonal [%], each row's share taken as binomial.
    pub fn standard_error_per_cent(&self) -> f64 {
        let variance = |row: usize| {
            let sum = f64::from(self.counts[row].iter().sum::<u32>().max(1));
            let right = f64::from(self.counts[row][row]) / sum;
            right * (1.0 - right) / sum
        };
        100.0 * (0..4).map(variance).sum::<f64>().sqrt() / 4.0
    }
}

impl fmt::Display for Confusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:>12}  Rec  Ell  Cyl  Con   classified  too few points", "actual")?;
        for (class, row) in self.per_cent().iter().enumerate() {
            write!(f, "{:>12} ", ObstacleClass::SOLIDS[class].name())?;
            for share in row {
                write!(f, "{share:>5.0}")?;
            }
            let classified: u32 = self.counts[class].iter().sum();
            writeln!(f, "{classified:>13}{:>16}", self.unclassified[class])?;
        }
        write!(f, "{:>12}  {:.1} %", "mean", self.mean_per_cent())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_weighs_classes_not_clusters() {
        use ObstacleClass::{Conical, Cylindrical, Ellipsoidal, Rectangular, Unclassified};
        let mut sut = Confusion::default();
        for _ in 0..9 {
            sut.count(Rectangular, Rectangular);
        }
        for (actual, verdict) in [(Ellipsoidal, Rectangular), (Cylindrical, Conical), (Conical, Conical)] {
            sut.count(actual, verdict);
        }
        sut.count(Conical, Unclassified);
        sut.count(Unclassified, Conical);
        assert_eq!(sut.mean_per_cent(), 50.0);
        assert_eq!(sut.classified(), 12);
        // Rows of 9 of 9, 0 of 1, 0 of 1 and 1 of 1: nothing varies.
        assert_eq!(sut.standard_error_per_cent(), 0.0);
        sut.count(Conical, Cylindrical);
        // One row of 1 of 2: its error is sqrt(0.25 / 2), a quarter of that the mean's.
        assert!((sut.standard_error_per_cent() - 100.0 * 0.125_f64.sqrt() / 4.0).abs() < 1e-9);
        assert_eq!(sut.unclassified(), [0, 0, 0, 1]);
        assert_eq!(sut.counts()[2], [0, 0, 0, 1]);
        assert!(sut.to_string().contains("mean  37.5 %"));
    }
}
