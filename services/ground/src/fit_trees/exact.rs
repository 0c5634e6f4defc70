//! A tree grown by trying every split of every leaf, each with sums taken anew, against the one grown on histograms.

use classifier::TreeNode;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bins::Quantiles;
use super::grow::grow;
use super::histogram::{Split, Sum};
use super::tests::params;
use super::{AllCores, BoostingParams, LabelledRows};

const FEATURES: usize = 3;

struct Exact<'a> {
    rows: &'a [[f32; FEATURES]],
    gradients: &'a [[f32; 2]],
    params: &'a BoostingParams,
}

enum Node {
    Leaf(Vec<usize>),
    Split { feature: usize, threshold: f32, left: Box<Node>, right: Box<Node> },
}

impl Exact<'_> {
    fn sum(&self, rows: &[usize]) -> Sum {
        let mut sum = Sum::default();
        rows.iter().for_each(|&row| sum.add_row(self.gradients[row]));
        sum
    }

    /// The first of the best splits of these rows, at thresholds halfway between the table's values.
    fn best(&self, rows: &[usize]) -> Option<(f64, usize, f32)> {
        let mut best: Option<(f64, usize, f32)> = None;
        for feature in 0..FEATURES {
            let mut values: Vec<f32> = self.rows.iter().map(|row| row[feature]).collect();
            values.sort_by(f32::total_cmp);
            values.dedup();
            for pair in values.windows(2) {
                let threshold = (pair[0] + pair[1]) / 2.0;
                let (right, left): (Vec<_>, Vec<_>) =
                    rows.iter().partition(|&&row| self.rows[row][feature] > threshold);
                let gain = Split::gain(&self.sum(&left), &self.sum(&right), self.params);
                if let Some(gain) = gain.filter(|&gain| best.is_none_or(|best| gain > best.0)) {
                    best = Some((gain, feature, threshold));
                }
            }
        }
        best
    }

    /// Splits the leaf of greatest gain; false where there is none.
    fn split_best(&self, root: &mut Node) -> bool {
        fn leaves<'n>(node: &'n mut Node, found: &mut Vec<&'n mut Node>) {
            match node {
                Node::Leaf(_) => found.push(node),
                Node::Split { left, right, .. } => {
                    leaves(left, found);
                    leaves(right, found);
                }
            }
        }
        let mut found = Vec::new();
        leaves(root, &mut found);
        let mut best: Option<((f64, usize, f32), &mut Node)> = None;
        for leaf in found {
            let Node::Leaf(rows) = &*leaf else { continue };
            if let Some(split) = self.best(rows).filter(|split| best.as_ref().is_none_or(|best| split.0 > best.0.0)) {
                best = Some((split, leaf));
            }
        }
        let Some(((_, feature, threshold), leaf)) = best else { return false };
        let Node::Leaf(rows) = &*leaf else { return false };
        let (right, left) = rows.iter().partition(|&&row| self.rows[row][feature] > threshold);
        let (left, right) = (Box::new(Node::Leaf(left)), Box::new(Node::Leaf(right)));
        *leaf = Node::Split { feature, threshold, left, right };
        true
    }

    fn preorder(&self, node: &Node, tree: &mut Vec<TreeNode>) {
        match node {
            Node::Leaf(rows) => {
                let sum = self.sum(rows);
                let step = -sum.gradient / (sum.hessian + self.params.lambda_l2);
                tree.push(TreeNode::Leaf((self.params.learning_rate * step) as f32));
            }
            Node::Split { feature, threshold, left, right } => {
                tree.push(TreeNode::Split { feature: *feature as u8, threshold: *threshold });
                self.preorder(left, tree);
                self.preorder(right, tree);
            }
        }
    }
}

#[test]
fn a_tree_is_the_one_that_trying_every_split_gives() {
    let mut most_leaves = 0;
    for seed in 0..60 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let count: usize = random.random_range(1..120);
        let values: u32 = random.random_range(1..200);
        let rows: Vec<[f32; FEATURES]> =
            (0..count).map(|_| std::array::from_fn(|_| random.random_range(0..values) as f32)).collect();
        // Of few binary digits: sums are exact, so that a sum less another is the sum of the rest.
        let gradients: Vec<[f32; 2]> = (0..count)
            .map(|_| {
                [random.random_range(-4_096..4_096) as f32 / 4_096.0, random.random_range(1..1_024) as f32 / 4_096.0]
            })
            .collect();
        let params = BoostingParams {
            leaves: random.random_range(2..12),
            min_rows: random.random_range(1..6),
            lambda_l2: random.random_range(0..3).into(),
            ..params()
        };

        let features = rows.as_flattened();
        let table = LabelledRows { features, classes: &vec![0; count], weights: None };
        let quantiles = Quantiles::of(&AllCores, &table, FEATURES);
        let binned = quantiles.bin(&AllCores, &table);
        let all = Vec::from_iter(0..count as u32);
        let found = grow(&binned, vec![0, 1, 2], all, gradients.clone(), &params);

        let exact = Exact { rows: &rows, gradients: &gradients, params: &params };
        let mut root = Node::Leaf((0..count).collect());
        let mut leaves = 1;
        while leaves < params.leaves && exact.split_best(&mut root) {
            leaves += 1;
        }
        let mut expected = Vec::new();
        exact.preorder(&root, &mut expected);
        assert_eq!(found.preorder(&quantiles), expected, "seed {seed}");
        most_leaves = most_leaves.max(leaves);
    }
    assert!(most_leaves >= 10);
}
