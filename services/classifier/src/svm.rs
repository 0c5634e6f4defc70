use messages::Bin;

use crate::coupling::{couple, pairwise_probability};
use crate::kernel::{Kernels, Query, Sums};
use crate::svm_file::SvmFile;

/// Most classes of a model.
pub const MAX_CLASSES: usize = 4;

/// Pairs of [`MAX_CLASSES`].
pub const PAIRS: usize = MAX_CLASSES * (MAX_CLASSES - 1) / 2;

/// Descriptors that are worked on at a time by [`Svm::decide_all`]: while they pass by, a tile of support vectors stays in
/// the cache.
const TOGETHER: usize = 64;

/// A support vector machine with the kernel exp(−γ‖x − s‖²) (paper, Sec. V-2), voting one against one as libsvm does.
///
/// All memory for [`Svm::decide_all`] is taken when it is built.
#[derive(Clone, Debug)]
pub struct Svm {
    kernels: Kernels,
    labels: Vec<i32>,
    rho: Vec<f64>,
    sigmoids: Vec<[f64; 2]>,
    support_vectors: usize,
    queries: Vec<Query>,
}

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
        Self {
            kernels: Kernels::new(file),
            labels: file.labels.clone(),
            rho: file.rho.clone(),
            sigmoids: file.sigmoids.clone(),
            support_vectors: file.vectors.len(),
            queries: vec![Query::new(); TOGETHER],
        }
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

    /// Decision values and votes for a descriptor: bins in order of index, each index under 1728 and given once.
    pub fn decide(&self, bins: &[Bin]) -> Decision {
        let mut query = [Query::new()];
        query[0].set(&self.kernels, bins);
        self.kernels.sum(&mut query);
        self.decision(&query[0].sums())
    }

    /// [`Svm::decide`] for many descriptors, several at a time, which is faster; gives `each` the descriptor's place and
    /// the same decision.
    pub fn decide_all<'a>(
        &mut self,
        mut descriptors: impl Iterator<Item = &'a [Bin]>,
        mut each: impl FnMut(&Self, usize, Decision),
    ) {
        let mut queries = std::mem::take(&mut self.queries);
        let mut first = 0;
        loop {
            let mut taken = 0;
            for (query, bins) in queries.iter_mut().zip(&mut descriptors) {
                query.set(&self.kernels, bins);
                taken += 1;
            }
            self.kernels.sum(&mut queries[..taken]);
            for (place, query) in (first..).zip(&queries[..taken]) {
                each(self, place, self.decision(&query.sums()));
            }
            first += taken;
            if taken < TOGETHER {
                break;
            }
        }
        self.queries = queries;
    }

    /// Decision values and votes from the sums of all tiles.
    fn decision(&self, sums: &Sums) -> Decision {
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
