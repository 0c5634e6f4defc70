//! The text format of boosted trees: seven header lines, then a line for each tree, a round's four in the order of
//! classes. A tree is its nodes in preorder: a split is `feature:threshold` and stands before its left child, which
//! stands before its right one; a leaf is what it adds.
//!
//! ```text
//! encke boosted-trees 1
//! classes rectangular ellipsoidal cylindrical conical
//! features 2
//! names range_m points
//! temperature 1.25
//! base -1.4 -1.3 -1.4 -1.5
//! rounds 300
//! 0:12.5 1:7 -0.02 0.013 0.041
//! …
//! ```

use std::fmt::Write;

use lidar::ObstacleClass;

use crate::boosted_trees::{MAX_FEATURES, MAX_ROUNDS};
use crate::{BoostedTrees, BoostedTreesError, FORMAT, TreeNode};

/// Why a file holds no boosted trees.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoostedTreesFileError {
    /// A line is not what stands there in the format.
    #[error("line {line} is {found:?}, must be {expected}")]
    Line {
        /// From 1.
        line: usize,
        /// What is there, or the first word of it that cannot stand there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
    /// A line reads well and makes no part of a model.
    #[error("line {line}: {error}")]
    Numbers {
        /// From 1.
        line: usize,
        /// What is wrong with it.
        error: BoostedTreesError,
    },
}

/// Lines before the first tree.
const HEADER: usize = 7;

impl BoostedTrees {
    /// Reads a model file.
    ///
    /// # Errors
    /// The first line that cannot be read; then the first that makes no part of a model.
    pub fn parse(text: &str) -> Result<Self, BoostedTreesFileError> {
        let mut lines = Lines { lines: text.lines(), line: 0 };
        let classes = ObstacleClass::SOLIDS.map(ObstacleClass::name);
        lines.literal(&format!("encke boosted-trees {FORMAT}"), "\"encke boosted-trees 1\"")?;
        lines.literal(&format!("classes {}", classes.join(" ")), "the four solids in the paper's order")?;
        let features = lines.count("features", 1, MAX_FEATURES, "\"features\" and a number from 1 to 255")?;
        let names = lines.names(features)?;
        let [temperature] = lines.numbers("temperature", "\"temperature\" and a number")?;
        let base = lines.numbers("base", "\"base\" and four numbers")?;
        let rounds = lines.count("rounds", 0, MAX_ROUNDS, "\"rounds\" and a number from 0 to 10000")?;
        let mut trees = Vec::new();
        for _ in 0..4 * rounds {
            trees.push(lines.tree()?);
        }
        lines.end()?;
        Self::new(names, base, temperature, &trees).map_err(|error| {
            let line = match error {
                BoostedTreesError::Features(_) => 3,
                BoostedTreesError::Name(_) => 4,
                BoostedTreesError::Temperature(_) => 5,
                BoostedTreesError::Base(_) => 6,
                BoostedTreesError::Trees(_) => HEADER,
                BoostedTreesError::Tree { tree, .. } => HEADER + tree,
            };
            BoostedTreesFileError::Numbers { line, error }
        })
    }

    /// The model as a file, each number as short as reads back the same.
    pub fn to_text(&self) -> String {
        let classes = ObstacleClass::SOLIDS.map(ObstacleClass::name).join(" ");
        let names = self.feature_names();
        let base = self.base().map(|value| format!("{value:?}")).join(" ");
        let mut text = format!(
            "encke boosted-trees {FORMAT}\nclasses {classes}\nfeatures {}\nnames {}\ntemperature {:?}\nbase {base}\nrounds {}\n",
            names.len(),
            names.join(" "),
            self.temperature(),
            self.rounds(),
        );
        for tree in self.trees() {
            for (place, node) in tree.iter().enumerate() {
                let gap = if place == 0 { "" } else { " " };
                // Writing to a string cannot fail.
                let _ = match node {
                    TreeNode::Split { feature, threshold } => write!(text, "{gap}{feature}:{threshold:?}"),
                    TreeNode::Leaf(value) => write!(text, "{gap}{value:?}"),
                };
                if text.ends_with(".0") {
                    text.truncate(text.len() - 2);
                }
            }
            text.push('\n');
        }
        text
    }
}

struct Lines<'a> {
    lines: std::str::Lines<'a>,
    line: usize,
}

impl<'a> Lines<'a> {
    fn literal(&mut self, wanted: &str, expected: &'static str) -> Result<(), BoostedTreesFileError> {
        let found = self.next();
        if found == wanted { Ok(()) } else { Err(self.refused(found, expected)) }
    }

    fn count(
        &mut self,
        key: &str,
        least: usize,
        most: usize,
        expected: &'static str,
    ) -> Result<usize, BoostedTreesFileError> {
        let found = self.next();
        let count = found.strip_prefix(key).and_then(|rest| rest.strip_prefix(' ')).and_then(|word| word.parse().ok());
        count.filter(|count| (least..=most).contains(count)).ok_or_else(|| self.refused(found, expected))
    }

    fn names(&mut self, features: usize) -> Result<Vec<String>, BoostedTreesFileError> {
        let found = self.next();
        let words = found.strip_prefix("names ").unwrap_or("").split_whitespace();
        if words.clone().count() == features {
            Ok(words.map(str::to_owned).collect())
        } else {
            Err(self.refused(found, "\"names\" and a name for each feature"))
        }
    }

    fn numbers<const N: usize>(
        &mut self,
        key: &str,
        expected: &'static str,
    ) -> Result<[f64; N], BoostedTreesFileError> {
        let found = self.next();
        let mut numbers = [0.0; N];
        let mut words = found.strip_prefix(key).unwrap_or("").split_whitespace();
        for number in &mut numbers {
            *number = words.next().and_then(|word| word.parse().ok()).ok_or_else(|| self.refused(found, expected))?;
        }
        if words.next().is_some() { Err(self.refused(found, expected)) } else { Ok(numbers) }
    }

    fn tree(&mut self) -> Result<Vec<TreeNode>, BoostedTreesFileError> {
        const NODE: &str = "a tree of splits feature:threshold and leaves";
        let found = self.next();
        let node = |word: &str| match word.split_once(':') {
            Some((feature, threshold)) => {
                Some(TreeNode::Split { feature: feature.parse().ok()?, threshold: threshold.parse().ok()? })
            }
            None => Some(TreeNode::Leaf(word.parse().ok()?)),
        };
        let mut tree = Vec::new();
        for word in found.split_whitespace() {
            tree.push(node(word).ok_or_else(|| self.refused(word, NODE))?);
        }
        if tree.is_empty() { Err(self.refused(found, NODE)) } else { Ok(tree) }
    }

    fn end(&mut self) -> Result<(), BoostedTreesFileError> {
        match self.lines.next() {
            None => Ok(()),
            Some(more) => {
                self.line += 1;
                Err(self.refused(more, "the end of the file"))
            }
        }
    }

    fn next(&mut self) -> &'a str {
        self.line += 1;
        self.lines.next().unwrap_or("")
    }

    fn refused(&self, found: &str, expected: &'static str) -> BoostedTreesFileError {
        let found = found.chars().take(60).collect();
        BoostedTreesFileError::Line { line: self.line, found, expected }
    }
}
