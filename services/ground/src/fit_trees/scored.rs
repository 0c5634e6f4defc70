//! Rows with the scores that the trees so far give them.

use classifier::softmax;

use super::bins::{Binned, Quantiles};
use super::grow::GrownTree;
use super::{LabelledRows, Workers};
use crate::calibrate::log_loss;

/// Rows of a block: what is summed within one is then summed over them, whatever the number of cores.
const BLOCK: usize = 8_192;

/// Rows, binned and scored.
pub(super) struct Scored<'a> {
    rows: LabelledRows<'a>,
    binned: Binned,
    blocks: Vec<Block>,
    weight: f64,
}

struct Block {
    first: usize,
    scores: Vec<[f64; 4]>,
    posteriors: Vec<[f64; 4]>,
    /// Weighted sum over the rows.
    loss: f64,
}

impl<'a> Scored<'a> {
    pub(super) fn new(workers: &impl Workers, rows: &LabelledRows<'a>, quantiles: &Quantiles, base: [f64; 4]) -> Self {
        let count = rows.classes.len();
        let starts: Vec<usize> = (0..count).step_by(BLOCK).collect();
        let blocks = workers.map(&starts, |&first| Block::new(rows, first, vec![base; BLOCK.min(count - first)]));
        Self { rows: *rows, binned: quantiles.bin(workers, rows), blocks, weight: rows.weight() }
    }

    /// Adds a round's trees to the scores.
    pub(super) fn advance(&mut self, workers: &impl Workers, trees: &[GrownTree]) {
        self.blocks = workers.map(&self.blocks, |block| {
            let mut scores = block.scores.clone();
            for (class, tree) in trees.iter().enumerate() {
                for (score, row) in scores.iter_mut().zip(block.first..) {
                    score[class] += f64::from(tree.value(&self.binned, row));
                }
            }
            Block::new(&self.rows, block.first, scores)
        });
    }

    /// Weighted mean.
    pub(super) fn loss(&self) -> f64 {
        self.blocks.iter().map(|block| block.loss).sum::<f64>() / self.weight
    }

    pub(super) fn binned(&self) -> &Binned {
        &self.binned
    }

    /// First and second derivative of a row's loss by its score for a class. The second is p(1 − p) made greater by
    /// K / (K − 1) for K = 4 classes, which makes Newton's step the one of Friedman's Algorithm 6.
    pub(super) fn gradient(&self, row: usize, class: usize) -> [f32; 2] {
        let p = self.blocks[row / BLOCK].posteriors[row % BLOCK][class];
        let is = f64::from(u8::from(usize::from(self.rows.classes[row]) == class));
        let weight = self.rows.weight_of(row);
        [(weight * (p - is)) as f32, (weight * p * (1.0 - p) * 4.0 / 3.0) as f32]
    }
}

impl Block {
    fn new(rows: &LabelledRows, first: usize, scores: Vec<[f64; 4]>) -> Self {
        let loss_of = |(row, &scores)| rows.weight_of(row) * log_loss(scores, usize::from(rows.classes[row]), 1.0);
        let loss = (first..).zip(&scores).map(loss_of).sum();
        let posteriors = scores.iter().map(|&scores| softmax(scores, 1.0)).collect();
        Self { first, scores, posteriors, loss }
    }
}
