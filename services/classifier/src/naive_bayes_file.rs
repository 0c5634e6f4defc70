//! The text format of a Naive Bayes model: six header lines, then a line for each bin with ln φ_{k|q} of the classes.
//!
//! ```text
//! encke naive-bayes 1
//! classes rectangular ellipsoidal cylindrical conical
//! bins 1728
//! draws 14.5
//! log_prior -1.386294 -1.386294 -1.386294 -1.386294
//! log_phi
//! -9.21034 -9.30011 -9.10233 -9.45678
//! …
//! ```

use std::fmt::Write;

use lidar::ObstacleClass;

use crate::{BINS, FORMAT, NaiveBayes, NaiveBayesError};

/// Why a file is no Naive Bayes model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NaiveBayesFileError {
    /// A line is not what stands there in the format.
    #[error("line {line} is {found:?}, must be {expected}")]
    Line {
        /// From 1.
        line: usize,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// The numbers make no model.
    #[error(transparent)]
    Numbers(#[from] NaiveBayesError),
}

impl NaiveBayes {
    /// Reads a model file.
    ///
    /// # Errors
    /// The first line that does not hold, or numbers that are no model.
    pub fn parse(text: &str) -> Result<Self, NaiveBayesFileError> {
        let mut lines = Lines { lines: text.lines(), line: 0 };
        let classes = ObstacleClass::SOLIDS.map(ObstacleClass::name);
        lines.literal(&format!("encke naive-bayes {FORMAT}"), "\"encke naive-bayes 1\"")?;
        lines.literal(&format!("classes {}", classes.join(" ")), "the four solids in the paper's order")?;
        lines.literal(&format!("bins {BINS}"), "\"bins 1728\"")?;
        let [draws] = lines.numbers("draws", "\"draws\" and a number")?;
        let log_prior = lines.numbers("log_prior", "\"log_prior\" and four numbers")?;
        lines.literal("log_phi", "\"log_phi\"")?;
        let mut log_phi = Vec::with_capacity(BINS);
        for _ in 0..BINS {
            log_phi.push(lines.numbers("", "four numbers")?);
        }
        lines.end()?;
        Ok(Self::new(log_phi, log_prior, draws)?)
    }

    /// The model as a file, numbers to six decimals.
    pub fn to_text(&self) -> String {
        let classes = ObstacleClass::SOLIDS.map(ObstacleClass::name);
        let row = |values: [f64; 4]| values.map(|value| format!("{value:.6}")).join(" ");
        let mut text = format!("encke naive-bayes {FORMAT}\nclasses {}\nbins {BINS}\n", classes.join(" "));
        // Writing to a string cannot fail.
        let _ = write!(text, "draws {:.6}\nlog_prior {}\nlog_phi\n", self.draws(), row(self.log_prior()));
        for &values in self.log_phi() {
            text.push_str(&row(values));
            text.push('\n');
        }
        text
    }
}

struct Lines<'a> {
    lines: std::str::Lines<'a>,
    line: usize,
}

impl Lines<'_> {
    fn literal(&mut self, wanted: &str, expected: &'static str) -> Result<(), NaiveBayesFileError> {
        let found = self.next();
        if found == wanted { Ok(()) } else { Err(self.refused(found, expected)) }
    }

    fn numbers<const N: usize>(&mut self, key: &str, expected: &'static str) -> Result<[f64; N], NaiveBayesFileError> {
        let found = self.next();
        let mut numbers = [0.0; N];
        let mut words = found.strip_prefix(key).unwrap_or("").split_whitespace();
        for number in &mut numbers {
            match words.next().and_then(|word| word.parse().ok()) {
                Some(value) => *number = value,
                None => return Err(self.refused(found, expected)),
            }
        }
        if words.next().is_some() { Err(self.refused(found, expected)) } else { Ok(numbers) }
    }

    fn end(&mut self) -> Result<(), NaiveBayesFileError> {
        match self.lines.next() {
            None => Ok(()),
            Some(more) => {
                self.line += 1;
                Err(self.refused(more, "the end of the file"))
            }
        }
    }

    fn refused(&self, found: &str, expected: &'static str) -> NaiveBayesFileError {
        let found = found.chars().take(60).collect();
        NaiveBayesFileError::Line { line: self.line, found, expected }
    }
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> &'a str {
        self.line += 1;
        self.lines.next().unwrap_or("")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text() -> String {
        let log_phi = (0..BINS).map(|bin| [-(bin as f64) / 7.0, -1.0, -2.0, -3.0]).collect();
        NaiveBayes::new(log_phi, [-1.386_294; 4], 14.5).unwrap().to_text()
    }

    #[test]
    fn a_model_written_and_read_writes_the_same_file() {
        let read = NaiveBayes::parse(&text()).unwrap();
        assert_eq!(read.to_text(), text());
        assert_eq!(read.draws(), 14.5);
        assert_eq!(read.log_phi()[7][0], -1.0);
    }

    #[test]
    fn each_broken_line_is_refused_by_number() {
        let refused = |from: &str, to: &str| NaiveBayes::parse(&text().replacen(from, to, 1)).unwrap_err().to_string();
        assert!(refused("naive-bayes 1", "naive-bayes 2").starts_with("line 1 is \"encke naive-bayes 2\", must be"));
        assert!(refused("rectangular ell", "ell").starts_with("line 2"));
        assert!(refused("bins 1728", "bins 1727").starts_with("line 3 is \"bins 1727\""));
        assert!(refused("draws 14.5", "draws many").starts_with("line 4"));
        assert!(refused("draws 14.5", "draws -1").contains("must be positive"));
        assert!(refused("log_prior -1.386294", "log_prior").starts_with("line 5"));
        assert!(refused("log_phi", "phi").starts_with("line 6"));
        assert!(refused("-0.142857", "x").starts_with("line 8"));
        assert!(refused("-0.142857", "-0.1 -0.2").starts_with("line 8"));
        let cut: String = text().lines().take(1_000).map(|line| format!("{line}\n")).collect();
        assert!(
            NaiveBayes::parse(&cut).unwrap_err().to_string().starts_with("line 1001 is \"\", must be four numbers")
        );
        assert!(NaiveBayes::parse(&(text() + "1 2 3 4\n")).unwrap_err().to_string().contains("the end of the file"));
        assert!(NaiveBayes::parse("").is_err());
    }
}
