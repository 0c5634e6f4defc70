//! One tree: the leaf whose split gains most is split, until there are enough leaves or no gain.

use std::ops::Range;

use classifier::TreeNode;

use super::BoostingParams;
use super::bins::{Binned, Quantiles};
use super::histogram::{Histogram, Split, Sum};

/// A tree over bins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GrownTree {
    nodes: Vec<GrownNode>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum GrownNode {
    /// The right child is next to the left one.
    Split {
        feature: usize,
        bin: u8,
        left: usize,
    },
    Leaf(f32),
}

/// A leaf while the tree grows: its rows are a range of the table's, in order.
struct Leaf {
    node: usize,
    rows: Range<usize>,
    sum: Sum,
    histogram: Histogram,
    split: Option<Split>,
}

struct Growth<'a> {
    binned: &'a Binned,
    features: Vec<u32>,
    params: &'a BoostingParams,
    rows: Vec<u32>,
    gradients: Vec<[f32; 2]>,
}

/// Grows a tree to the derivatives of `rows` by some of the features.
pub(super) fn grow(
    binned: &Binned,
    features: Vec<u32>,
    rows: Vec<u32>,
    gradients: Vec<[f32; 2]>,
    params: &BoostingParams,
) -> GrownTree {
    let mut growth = Growth { binned, features, params, rows, gradients };
    let mut sum = Sum::default();
    growth.gradients.iter().for_each(|&derivatives| sum.add_row(derivatives));
    let leaf_of = |sum: &Sum| GrownNode::Leaf((params.learning_rate * sum.step(params.lambda_l2)) as f32);
    let mut nodes = vec![leaf_of(&sum)];
    let whole = 0..growth.rows.len();
    let mut leaves = vec![growth.leaf(0, whole.clone(), sum, growth.histogram(whole))];
    for left in (1..2 * params.leaves - 1).step_by(2) {
        let Some((place, split)) = best(&leaves) else { break };
        let parent = leaves.swap_remove(place);
        nodes[parent.node] = GrownNode::Split { feature: split.feature, bin: split.bin, left };
        nodes.extend([leaf_of(&split.left), leaf_of(&split.right)]);
        // The last leaves are not split again.
        if left + 2 < 2 * params.leaves - 1 {
            leaves.extend(growth.children(parent, &split, left));
        }
    }
    GrownTree { nodes }
}

/// Where the greatest gain is; of equals the leaf made first.
fn best(leaves: &[Leaf]) -> Option<(usize, Split)> {
    let mut best: Option<(usize, Split)> = None;
    for (place, leaf) in leaves.iter().enumerate() {
        let better =
            |split: &Split| best.is_none_or(|(other, most)| (split.gain, leaves[other].node) > (most.gain, leaf.node));
        if let Some(split) = leaf.split.filter(better) {
            best = Some((place, split));
        }
    }
    best
}

impl Growth<'_> {
    fn histogram(&self, rows: Range<usize>) -> Histogram {
        Histogram::of(self.binned, &self.features, &self.rows[rows.clone()], &self.gradients[rows])
    }

    fn leaf(&self, node: usize, rows: Range<usize>, sum: Sum, histogram: Histogram) -> Leaf {
        let split = histogram.best_split(self.binned, &self.features, &sum, self.params);
        Leaf { node, rows, sum, histogram, split }
    }

    /// The two leaves that a leaf becomes. Only the smaller one's rows are read again.
    fn children(&mut self, parent: Leaf, split: &Split, left: usize) -> [Leaf; 2] {
        let middle = self.divide(parent.rows.clone(), split);
        let ranges = [parent.rows.start..middle, middle..parent.rows.end];
        let small = usize::from(ranges[1].len() < ranges[0].len());
        let of_small = self.histogram(ranges[small].clone());
        let of_large = parent.histogram.without(&of_small);
        let histograms = if small == 0 { [of_small, of_large] } else { [of_large, of_small] };
        debug_assert_eq!(parent.sum.rows as usize, parent.rows.len());
        let [left_rows, right_rows] = ranges;
        let [of_left, of_right] = histograms;
        [self.leaf(left, left_rows, split.left, of_left), self.leaf(left + 1, right_rows, split.right, of_right)]
    }

    /// Puts the rows that go left before those that go right, each in their order; where the right ones begin.
    fn divide(&mut self, range: Range<usize>, split: &Split) -> usize {
        let column = self.binned.column(split.feature);
        let mut right = Vec::with_capacity(split.right.rows as usize);
        let mut next = range.start;
        for place in range.clone() {
            let (row, derivatives) = (self.rows[place], self.gradients[place]);
            if column[row as usize] > split.bin {
                right.push((row, derivatives));
            } else {
                (self.rows[next], self.gradients[next]) = (row, derivatives);
                next += 1;
            }
        }
        for (place, (row, derivatives)) in (next..range.end).zip(right) {
            (self.rows[place], self.gradients[place]) = (row, derivatives);
        }
        next
    }
}

impl GrownTree {
    /// What the tree adds to a row's score.
    pub(super) fn value(&self, binned: &Binned, row: usize) -> f32 {
        let mut place = 0;
        loop {
            match self.nodes[place] {
                GrownNode::Split { feature, bin, left } => {
                    place = left + usize::from(binned.column(feature)[row] > bin);
                }
                GrownNode::Leaf(value) => return value,
            }
        }
    }

    /// The tree with thresholds for bins, as the classifier takes it.
    pub(super) fn preorder(&self, quantiles: &Quantiles) -> Vec<TreeNode> {
        let mut tree = Vec::with_capacity(self.nodes.len());
        let mut open = vec![0];
        while let Some(place) = open.pop() {
            match self.nodes[place] {
                GrownNode::Split { feature, bin, left } => {
                    // A model has at most 255 features.
                    tree.push(TreeNode::Split { feature: feature as u8, threshold: quantiles.threshold(feature, bin) });
                    open.extend([left + 1, left]);
                }
                GrownNode::Leaf(value) => tree.push(TreeNode::Leaf(value)),
            }
        }
        tree
    }
}
