use std::ops::Range;

use messages::Bin;

use crate::BINS;
use crate::coupling::{couple, pairwise_probability};
use crate::exponential::exp_of_negative;
use crate::svm_file::SvmFile;

/// Most classes of a model.
pub const MAX_CLASSES: usize = 4;

/// Pairs of [`MAX_CLASSES`].
pub const PAIRS: usize = MAX_CLASSES * (MAX_CLASSES - 1) / 2;

/// Support vectors that are worked on at a time. Features are kept tile after tile, so that one tile's stay in the
/// second-level cache while all descriptors pass by; with all at once, each would fetch most of the model from memory.
const TILE: usize = 512;

/// Numbers that are added side by side.
const LANES: usize = 8;

/// A bin that no support vector has.
const UNUSED: u32 = u32::MAX;

/// A support vector machine with the kernel exp(−γ‖x − s‖²) (paper, Sec. V-2), voting one against one as libsvm does.
///
/// ‖x − s‖² = ‖x‖² + ‖s‖² − 2 x·s, and x is sparse: support vectors are kept feature after feature, and each bin of x
/// adds one row times its weight. Kernel values are `f32`, their sums `f64`. All memory is taken when it is built.
#[derive(Clone, Debug)]
pub struct Svm {
    gamma: f32,
    labels: Vec<i32>,
    rho: Vec<f64>,
    sigmoids: Vec<[f64; 2]>,
    support_vectors: usize,
    /// Each holds support vectors of one class only.
    tiles: Vec<Tile>,
    /// Row of each bin in a tile, or [`UNUSED`].
    row_of_bin: Vec<u32>,
    /// Tile after tile, and in each a row of `TILE` values for each bin in use.
    features: Vec<f32>,
    /// Length of a tile in `features`.
    tile_len: usize,
}

/// Up to `TILE` support vectors of one class; the rest is zero, with coefficient 0.
#[derive(Clone, Debug)]
struct Tile {
    class: usize,
    norm2: [f32; TILE],
    /// Against each other class: libsvm's `sv_coef`.
    coefficients: [[f32; TILE]; MAX_CLASSES - 1],
}

/// Sums of a descriptor's kernel over each class's support vectors, weighted against each other class.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums([[f64; MAX_CLASSES - 1]; MAX_CLASSES]);

/// What the pairs of classes say of one descriptor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Place among the model's labels of the class with the most votes; the first of them where votes are equal.
    pub winner: usize,
    /// Decision value of each pair of classes, (0, 1), (0, 2), …; positive speaks for the first. Unused ones are 0.
    pub values: [f64; PAIRS],
}

impl Svm {
    /// Lays the model of a file out for evaluation.
    pub fn new(file: &SvmFile) -> Self {
        let mut row_of_bin = vec![UNUSED; BINS];
        for bin in file.vectors.iter().flatten() {
            row_of_bin[bin.index as usize] = 0;
        }
        let rows = row_of_bin.iter_mut().filter(|row| **row != UNUSED).zip(0..).map(|(row, rank)| *row = rank).count();
        let mut svm = Self {
            gamma: file.gamma as f32,
            labels: file.labels.clone(),
            rho: file.rho.clone(),
            sigmoids: file.sigmoids.clone(),
            support_vectors: file.vectors.len(),
            tiles: Vec::new(),
            row_of_bin,
            features: Vec::new(),
            tile_len: rows * TILE,
        };
        let mut first = 0;
        for (class, &count) in file.vectors_of_class.iter().enumerate() {
            for from in (first..first + count).step_by(TILE) {
                svm.add_tile(file, class, from..(from + TILE).min(first + count));
            }
            first += count;
        }
        svm
    }

    fn add_tile(&mut self, file: &SvmFile, class: usize, places: Range<usize>) {
        let start = self.features.len();
        self.features.resize(start + self.tile_len, 0.0);
        let mut tile = Tile { class, norm2: [0.0; TILE], coefficients: [[0.0; TILE]; MAX_CLASSES - 1] };
        let vectors = file.vectors[places.clone()].iter().zip(&file.coefficients[places]);
        for (place, (vector, coefficients)) in vectors.enumerate() {
            for bin in vector {
                let row = self.row_of_bin[bin.index as usize] as usize;
                self.features[start + row * TILE + place] = bin.weight;
            }
            tile.norm2[place] = squared_norm(vector);
            for (of_other, &coefficient) in tile.coefficients.iter_mut().zip(coefficients) {
                of_other[place] = coefficient as f32;
            }
        }
        self.tiles.push(tile);
    }

    /// The classes' labels, in the order of votes and probabilities.
    pub fn labels(&self) -> &[i32] {
        &self.labels
    }

    /// Number of support vectors.
    pub fn support_vectors(&self) -> usize {
        self.support_vectors
    }

    /// Whether the model was trained with probabilities.
    pub fn has_probabilities(&self) -> bool {
        !self.sigmoids.is_empty()
    }

    /// Number of tiles: how often [`Svm::add_to`] makes the sums of a descriptor.
    pub(crate) fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// Decision values and votes for a descriptor: bins in order of index, each index under 1728 and given once.
    pub fn decide(&self, bins: &[Bin]) -> Decision {
        let mut sums = Sums::default();
        for tile in 0..self.tiles.len() {
            self.add_to(&mut sums, tile, bins);
        }
        self.decision(&sums)
    }

    /// Adds one tile's part to a descriptor's sums. Sums are the same however tiles of several descriptors alternate.
    pub(crate) fn add_to(&self, sums: &mut Sums, tile: usize, bins: &[Bin]) {
        let features = &self.features[tile * self.tile_len..(tile + 1) * self.tile_len];
        let tile = &self.tiles[tile];
        let mut kernel = [0.0_f32; TILE];
        for bin in bins {
            let row = self.row_of_bin[bin.index as usize];
            if row != UNUSED {
                let start = row as usize * TILE;
                for (sum, feature) in kernel.iter_mut().zip(&features[start..start + TILE]) {
                    *sum += bin.weight * feature;
                }
            }
        }
        let norm2 = squared_norm(bins);
        for (product, of_vector) in kernel.iter_mut().zip(&tile.norm2) {
            let distance2 = norm2 + of_vector - 2.0 * *product;
            *product = exp_of_negative(-self.gamma * distance2.max(0.0));
        }
        let others = self.labels.len() - 1;
        for (sum, coefficients) in sums.0[tile.class].iter_mut().zip(&tile.coefficients).take(others) {
            *sum += weighted(&kernel, coefficients);
        }
    }

    /// Decision values and votes from the sums of all tiles.
    pub(crate) fn decision(&self, sums: &Sums) -> Decision {
        let classes = self.labels.len();
        let mut values = [0.0; PAIRS];
        let mut votes = [0; MAX_CLASSES];
        let mut pair = 0;
        for i in 0..classes {
            for j in i + 1..classes {
                let value = sums.0[i][j - 1] + sums.0[j][i] - self.rho[pair];
                values[pair] = value;
                votes[if value > 0.0 { i } else { j }] += 1;
                pair += 1;
            }
        }
        let winner = (1..classes).fold(0, |most, class| if votes[class] > votes[most] { class } else { most });
        Decision { winner, values }
    }

    /// Probability of each class in the model's order, sum 1, by pairwise coupling of the sigmoids; only for models of
    /// four classes with probabilities, else all equal. Its maximum need not be the class with the most votes.
    pub fn posterior(&self, decision: &Decision) -> [f64; MAX_CLASSES] {
        if self.sigmoids.len() != PAIRS {
            return [1.0 / MAX_CLASSES as f64; MAX_CLASSES];
        }
        let mut pairwise = [[0.0; MAX_CLASSES]; MAX_CLASSES];
        let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
        for ((i, j), (&[a, b], value)) in pairs.into_iter().zip(self.sigmoids.iter().zip(decision.values)) {
            pairwise[i][j] = pairwise_probability(value, a, b);
            pairwise[j][i] = 1.0 - pairwise[i][j];
        }
        couple(&pairwise)
    }
}

/// Sum of kernel values times coefficients.
fn weighted(kernel: &[f32; TILE], coefficients: &[f32; TILE]) -> f64 {
    let mut lanes = [0.0_f64; LANES];
    for (kernel, coefficients) in kernel.as_chunks::<LANES>().0.iter().zip(coefficients.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            lanes[lane] += f64::from(kernel[lane]) * f64::from(coefficients[lane]);
        }
    }
    lanes.iter().sum()
}

fn squared_norm(bins: &[Bin]) -> f32 {
    bins.iter().map(|bin| f64::from(bin.weight) * f64::from(bin.weight)).sum::<f64>() as f32
}
