//! libsvm's text format of a model, as far as the paper needs it: `c_svc` with an `rbf` kernel.

use messages::Bin;

use crate::BINS;
use crate::svm::{MAX_CLASSES, PAIRS};

/// A model file as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct SvmFile {
    /// γ of the kernel exp(−γ‖x − s‖²).
    pub gamma: f64,
    /// The classes' labels, in the file's order.
    pub labels: Vec<i32>,
    /// ρ of each pair of classes, (0, 1), (0, 2), … in the file's order.
    pub rho: Vec<f64>,
    /// Slope and offset of each pair's sigmoid; both empty where the model was trained without probabilities.
    pub sigmoids: Vec<[f64; 2]>,
    /// Support vectors of each class; they stand class after class.
    pub vectors_of_class: Vec<usize>,
    /// Of each support vector: its coefficients against each other class (libsvm's `sv_coef`, row after row).
    pub coefficients: Vec<Vec<f64>>,
    /// The support vectors: bins in order of index, 0 to 1727 (libsvm counts features from 1).
    pub vectors: Vec<Vec<Bin>>,
}

/// Why a file is no SVM model of ours.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SvmFileError {
    /// A header line says something else than it must.
    #[error("line {line}: {key} is {found:?}, must be {expected}")]
    Header {
        /// From 1.
        line: usize,
        /// The line's key.
        key: String,
        /// What follows it.
        found: String,
        /// What should.
        expected: &'static str,
    },
    /// A header line is missing.
    #[error("the header has no {0}")]
    Missing(&'static str),
    /// A list of the header has not one entry for each class, or for each pair of them.
    #[error("{key} has {found} entries, must have {expected} for {classes} classes")]
    Length {
        /// The list.
        key: &'static str,
        /// Its length.
        found: usize,
        /// What it must be.
        expected: usize,
        /// `nr_class`.
        classes: usize,
    },
    /// A support vector cannot be read.
    #[error("line {line}: {found:?} is no {expected}")]
    Vector {
        /// From 1.
        line: usize,
        /// The word.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// More or fewer support vectors than the header says.
    #[error("the file has {found} support vectors, must have {expected} as total_sv and nr_sv say")]
    Vectors {
        /// In the file.
        found: usize,
        /// In the header.
        expected: usize,
    },
}

#[derive(Default)]
struct Header {
    gamma: Option<f64>,
    classes: Option<usize>,
    total: Option<usize>,
    rho: Vec<f64>,
    labels: Vec<i32>,
    prob_a: Vec<f64>,
    prob_b: Vec<f64>,
    vectors_of_class: Vec<usize>,
    c_svc: bool,
    rbf: bool,
}

impl SvmFile {
    /// Reads a model file.
    ///
    /// # Errors
    /// The first thing that does not hold; nothing of an inconsistent file is used.
    pub fn parse(text: &str) -> Result<Self, SvmFileError> {
        let mut lines = text.lines().zip(1..);
        let header = Header::parse(&mut lines)?;
        let classes = header.checked()?;
        let mut coefficients = Vec::new();
        let mut vectors = Vec::new();
        for (line, number) in lines.filter(|(line, _)| !line.trim().is_empty()) {
            let (row, bins) = parse_vector(line, number, classes - 1)?;
            coefficients.push(row);
            vectors.push(bins);
        }
        let expected = header.vectors_of_class.iter().sum();
        if vectors.len() != expected || header.total != Some(expected) {
            return Err(SvmFileError::Vectors { found: vectors.len(), expected: header.total.unwrap_or(expected) });
        }
        Ok(Self {
            gamma: header.gamma.ok_or(SvmFileError::Missing("gamma"))?,
            labels: header.labels,
            rho: header.rho,
            sigmoids: header.prob_a.iter().zip(header.prob_b).map(|(&a, b)| [a, b]).collect(),
            vectors_of_class: header.vectors_of_class,
            coefficients,
            vectors,
        })
    }
}

impl Header {
    fn parse<'a>(lines: &mut impl Iterator<Item = (&'a str, usize)>) -> Result<Self, SvmFileError> {
        let mut header = Self::default();
        for (text, line) in lines {
            let (key, rest) = text.trim().split_once(' ').unwrap_or((text.trim(), ""));
            let refused = |expected| SvmFileError::Header {
                line,
                key: key.to_owned(),
                found: rest.chars().take(60).collect(),
                expected,
            };
            let numbers = || -> Result<Vec<f64>, SvmFileError> {
                let read = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
                rest.split_whitespace().map(|word| read(word).ok_or(refused("finite numbers"))).collect()
            };
            let count = || rest.trim().parse().map_err(|_| refused("a number of things"));
            match key {
                "SV" => return Ok(header),
                "svm_type" if rest == "c_svc" => header.c_svc = true,
                "svm_type" => return Err(refused("c_svc")),
                "kernel_type" if rest == "rbf" => header.rbf = true,
                "kernel_type" => return Err(refused("rbf")),
                "gamma" => match rest.parse() {
                    Ok(gamma) if gamma > 0.0 && gamma < f64::INFINITY => header.gamma = Some(gamma),
                    _ => return Err(refused("positive and finite")),
                },
                "nr_class" => header.classes = Some(count()?),
                "total_sv" => header.total = Some(count()?),
                "rho" => header.rho = numbers()?,
                "probA" => header.prob_a = numbers()?,
                "probB" => header.prob_b = numbers()?,
                "label" => {
                    let labels: Result<_, _> = rest.split_whitespace().map(str::parse).collect();
                    header.labels = labels.map_err(|_| refused("whole numbers"))?;
                }
                "nr_sv" => {
                    let counts: Result<_, _> = rest.split_whitespace().map(str::parse).collect();
                    header.vectors_of_class = counts.map_err(|_| refused("whole numbers"))?;
                }
                _ => return Err(refused("a line of a c_svc model")),
            }
        }
        Err(SvmFileError::Missing("SV"))
    }

    /// The number of classes, when the header is whole.
    fn checked(&self) -> Result<usize, SvmFileError> {
        if !self.c_svc {
            return Err(SvmFileError::Missing("svm_type"));
        }
        if !self.rbf {
            return Err(SvmFileError::Missing("kernel_type"));
        }
        let classes = self.classes.ok_or(SvmFileError::Missing("nr_class"))?;
        if !(2..=MAX_CLASSES).contains(&classes) {
            let (key, found) = ("nr_class".to_owned(), classes.to_string());
            return Err(SvmFileError::Header { line: 0, key, found, expected: "2 to 4" });
        }
        let pairs = classes * (classes - 1) / 2;
        debug_assert!(pairs <= PAIRS);
        let of_pairs = |found: usize| if found == 0 { 0 } else { pairs };
        for (key, found, expected) in [
            ("label", self.labels.len(), classes),
            ("nr_sv", self.vectors_of_class.len(), classes),
            ("rho", self.rho.len(), pairs),
            ("probA", self.prob_a.len(), of_pairs(self.prob_a.len())),
            ("probB", self.prob_b.len(), of_pairs(self.prob_a.len())),
        ] {
            if found != expected {
                return Err(SvmFileError::Length { key, found, expected, classes });
            }
        }
        Ok(classes)
    }
}

fn parse_vector(text: &str, line: usize, others: usize) -> Result<(Vec<f64>, Vec<Bin>), SvmFileError> {
    let refused = |found: &str, expected| SvmFileError::Vector { line, found: found.to_owned(), expected };
    let mut words = text.split_whitespace();
    let mut row = Vec::with_capacity(others);
    for _ in 0..others {
        let word = words.next().unwrap_or("");
        let number: Option<f64> = word.parse().ok();
        row.push(number.filter(|n| n.is_finite()).ok_or_else(|| refused(word, "finite coefficient"))?);
    }
    let mut bins: Vec<Bin> = Vec::new();
    for word in words {
        let parts = word.split_once(':').ok_or_else(|| refused(word, "index:value"))?;
        let index: usize = parts.0.parse().map_err(|_| refused(word, "index:value"))?;
        let weight: f32 = parts.1.parse().map_err(|_| refused(word, "index:value"))?;
        if !(1..=BINS).contains(&index) || !weight.is_finite() {
            return Err(refused(word, "index from 1 to 1728 with a finite value"));
        }
        let index = index as u32 - 1;
        if bins.last().is_some_and(|last| last.index >= index) {
            return Err(refused(word, "index greater than the one before it"));
        }
        bins.push(Bin { index, weight });
    }
    Ok((row, bins))
}
