//! The results for a terminal.

use std::fmt;

use lidar::ObstacleClass;

use super::{Reproduction, published};

impl fmt::Display for Reproduction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, ours, paper) in [
            ("Table I: Naive Bayes", &self.naive_bayes, &published::NAIVE_BAYES),
            ("Table II: support vector machine", &self.svm, &published::SVM),
        ] {
            writeln!(
                f,
                "{name}, cluttered scenes [%], the paper's in brackets\n{:>12}       Rec       Ell       Cyl       Con",
                "actual"
            )?;
            let shares = ours.cluttered.per_cent();
            for (row, class) in ObstacleClass::SOLIDS.into_iter().enumerate() {
                write!(f, "{:>12}", class.name())?;
                for column in 0..4 {
                    write!(f, "{:>5.0} ({:>2.0})", shares[row][column], paper[row][column])?;
                }
                writeln!(f)?;
            }
            writeln!(f, "{:>12} {:.1} ({:.1})\n", "mean", ours.cluttered.mean_per_cent(), published::mean(paper))?;
        }
        write!(f, "Table III: two classes at a time [%]")?;
        for (pair, (_, _, paper)) in self.two_class.iter().zip(published::TWO_CLASS) {
            let [one, other] = pair.classes.map(|class| ObstacleClass::SOLIDS[class].name());
            write!(f, "\n{one:>12}, {other:<12}{:>6.1} ({paper})", pair.mean_per_cent())?;
        }
        Ok(())
    }
}
