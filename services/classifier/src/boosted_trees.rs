/// Gradient-boosted decision trees: a score for each class is the sum of one tree a round, and the posterior is their
/// softmax (Friedman, "Greedy function approximation: a gradient boosting machine", Annals of Statistics 29, 2001,
/// Sec. 4.6). Classes in the order of [`lidar::ObstacleClass::SOLIDS`].
///
/// A split sends a feature greater than its threshold to the right, everything else and NaN to the left.
#[derive(Clone, Debug, PartialEq)]
pub struct BoostedTrees {
    feature_names: Vec<String>,
    temperature: f64,
    base: [f64; 4],
    /// Of all trees, one after the other, a round's four in the order of classes.
    nodes: Vec<Node>,
    /// Of each node: what a leaf adds to the score, 0 at a split.
    values: Vec<f32>,
    /// Where each tree begins in `nodes`.
    roots: Vec<[u32; 4]>,
}

/// A node of a tree in preorder: after a split comes all of its left child, then all of its right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TreeNode {
    /// Features greater than `threshold` go right, others and NaN left.
    Split {
        /// Place of the feature.
        feature: u8,
        /// Finite.
        threshold: f32,
    },
    /// What the tree adds to the score; finite.
    Leaf(f32),
}

/// Eight bytes, so that the two children of a split mostly share a cache line. A leaf is a split whose only way leads
/// back to itself: trees of unequal depth are then walked side by side without asking which have ended.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    threshold: f32,
    /// Place of the left child within the tree; the right one is next to it.
    left: u16,
    feature: u8,
}

/// Why numbers are no boosted trees.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BoostedTreesError {
    /// Too few or too many features.
    #[error("the model has {0} features, must have 1 to {MAX_FEATURES}")]
    Features(usize),
    /// A feature's name cannot stand in a list of words, or stands there already.
    #[error("feature {0:?} must be one word of letters, digits and _, another for each feature")]
    Name(String),
    /// No usable temperature.
    #[error("temperature is {0}, must be {MIN_TEMPERATURE} to {MAX_TEMPERATURE}")]
    Temperature(f64),
    /// A base score is no number.
    #[error("the model has a base score of {0}, must be finite")]
    Base(f64),
    /// A round without a tree for each class.
    #[error("the model has {0} trees, must have four for each of at most {MAX_ROUNDS} rounds")]
    Trees(usize),
    /// A tree that does not hold.
    #[error("tree {tree} {error}")]
    Tree {
        /// From 1.
        tree: usize,
        /// What is wrong with it.
        error: TreeError,
    },
}

/// Why nodes are no tree; said of one.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeError {
    /// A split without both children, or nodes that belong to none.
    #[error("has {leaves} leaves for {splits} splits, must have one more, each where it belongs")]
    Shape {
        /// Leaves.
        leaves: usize,
        /// Splits.
        splits: usize,
    },
    /// Too large.
    #[error("has {0} nodes, must have at most {MAX_NODES}")]
    Nodes(usize),
    /// A split by a feature that is not there.
    #[error("has a split by feature {feature}, must be under {features}")]
    Feature {
        /// Of the split.
        feature: u8,
        /// That the model has.
        features: usize,
    },
    /// A threshold or a leaf is no number.
    #[error("has a number of {0}, must be finite")]
    Number(f32),
}

/// Features that a model can have.
pub const MAX_FEATURES: usize = 255;
/// Rounds that a model can have.
pub const MAX_ROUNDS: usize = 10_000;
/// Nodes that a tree can have: 4096 leaves.
pub const MAX_NODES: usize = 8_191;
/// Least temperature of a model.
pub const MIN_TEMPERATURE: f64 = 0.01;
/// Greatest temperature of a model.
pub const MAX_TEMPERATURE: f64 = 100.0;

impl BoostedTrees {
    /// A model of trees in preorder, four to a round in the order of classes; without any, every posterior is that of
    /// the base scores.
    ///
    /// # Errors
    /// Features that cannot be told apart, a number out of its range, or the first tree that does not hold.
    pub fn new<T: AsRef<[TreeNode]>>(
        feature_names: Vec<String>,
        base: [f64; 4],
        temperature: f64,
        trees: &[T],
    ) -> Result<Self, BoostedTreesError> {
        check_names(&feature_names)?;
        if let Some(&value) = base.iter().find(|value| !value.is_finite()) {
            return Err(BoostedTreesError::Base(value));
        }
        if !trees.len().is_multiple_of(4) || trees.len() / 4 > MAX_ROUNDS {
            return Err(BoostedTreesError::Trees(trees.len()));
        }
        let (nodes, values, roots) = (Vec::new(), Vec::new(), Vec::with_capacity(trees.len() / 4));
        let mut model = Self { feature_names, temperature: 1.0, base, nodes, values, roots };
        for (round, four) in trees.chunks_exact(4).enumerate() {
            let mut roots = [0; 4];
            for (class, (tree, root)) in four.iter().zip(&mut roots).enumerate() {
                // MAX_ROUNDS · 4 · MAX_NODES is under 2³².
                *root = model.nodes.len() as u32;
                let tree_number = 4 * round + class + 1;
                model.push(tree.as_ref()).map_err(|error| BoostedTreesError::Tree { tree: tree_number, error })?;
            }
            model.roots.push(roots);
        }
        model.with_temperature(temperature)
    }

    /// The same trees with another temperature.
    ///
    /// # Errors
    /// [`BoostedTreesError::Temperature`].
    pub fn with_temperature(self, temperature: f64) -> Result<Self, BoostedTreesError> {
        if (MIN_TEMPERATURE..=MAX_TEMPERATURE).contains(&temperature) {
            Ok(Self { temperature, ..self })
        } else {
            Err(BoostedTreesError::Temperature(temperature))
        }
    }

    /// Probability of each class given a cluster's features; sums to 1. See [`Self::scores`].
    pub fn posterior(&self, features: &[f32]) -> [f64; 4] {
        softmax(self.scores(features), self.temperature)
    }

    /// The base score of each class and what its trees add, for `features` in the order of [`Self::feature_names`].
    /// A feature that is missing at the end counts as NaN.
    pub fn scores(&self, features: &[f32]) -> [f64; 4] {
        let mut scores = self.base;
        for roots in &self.roots {
            let roots = roots.map(|root| root as usize);
            let mut places = roots;
            loop {
                let before = places;
                for (place, root) in places.iter_mut().zip(roots) {
                    let node = self.nodes[*place];
                    let feature = features.get(usize::from(node.feature)).copied().unwrap_or(f32::NAN);
                    *place = root + usize::from(node.left) + usize::from(feature > node.threshold);
                }
                if places == before {
                    break;
                }
            }
            for (score, place) in scores.iter_mut().zip(places) {
                *score += f64::from(self.values[place]);
            }
        }
        scores
    }

    /// Names of the features, in their order.
    pub fn feature_names(&self) -> &[String] {
        &self.feature_names
    }

    /// What scores are divided by before the softmax: found on examples that the trees have not seen.
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Score of each class before any tree.
    pub fn base(&self) -> [f64; 4] {
        self.base
    }

    /// Rounds of boosting, each with a tree for each class.
    pub fn rounds(&self) -> usize {
        self.roots.len()
    }

    /// The trees in preorder, as [`Self::new`] takes them.
    pub fn trees(&self) -> impl Iterator<Item = Vec<TreeNode>> {
        self.roots.iter().flatten().map(|&root| self.preorder(root as usize))
    }

    fn preorder(&self, root: usize) -> Vec<TreeNode> {
        let mut tree = Vec::new();
        let mut open = vec![root];
        while let Some(place) = open.pop() {
            let Node { threshold, left, feature } = self.nodes[place];
            let left = root + usize::from(left);
            if left == place {
                tree.push(TreeNode::Leaf(self.values[place]));
            } else {
                tree.push(TreeNode::Split { feature, threshold });
                open.extend([left + 1, left]);
            }
        }
        tree
    }

    /// Puts a tree behind the others, its nodes level by level.
    fn push(&mut self, tree: &[TreeNode]) -> Result<(), TreeError> {
        let right = right_children(tree)?;
        self.check_nodes(tree)?;
        // The nodes in preorder, and how many have a place: each is placed when its parent is met.
        let mut order = vec![0];
        let mut next = 0;
        while next < order.len() {
            let (node, value) = match tree[order[next]] {
                TreeNode::Split { feature, threshold } => {
                    let left = order.len() as u16;
                    order.extend([order[next] + 1, right[order[next]]]);
                    (Node { threshold, left, feature }, 0.0)
                }
                TreeNode::Leaf(value) => (Node { threshold: f32::INFINITY, left: next as u16, feature: 0 }, value),
            };
            self.nodes.push(node);
            self.values.push(value);
            next += 1;
        }
        Ok(())
    }

    fn check_nodes(&self, tree: &[TreeNode]) -> Result<(), TreeError> {
        let features = self.feature_names.len();
        for &node in tree {
            match node {
                TreeNode::Split { feature, .. } if usize::from(feature) >= features => {
                    return Err(TreeError::Feature { feature, features });
                }
                TreeNode::Split { threshold: number, .. } | TreeNode::Leaf(number) if !number.is_finite() => {
                    return Err(TreeError::Number(number));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Probabilities in proportion to e^(score / temperature), finite for any finite scores.
pub fn softmax(scores: [f64; 4], temperature: f64) -> [f64; 4] {
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let relative = scores.map(|score| ((score - most) / temperature).exp());
    let sum: f64 = relative.iter().sum();
    relative.map(|value| value / sum)
}

fn check_names(names: &[String]) -> Result<(), BoostedTreesError> {
    if !(1..=MAX_FEATURES).contains(&names.len()) {
        return Err(BoostedTreesError::Features(names.len()));
    }
    let is_word =
        |name: &str| !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    let refused = (0..names.len()).find(|&place| !is_word(&names[place]) || names[..place].contains(&names[place]));
    refused.map_or(Ok(()), |place| Err(BoostedTreesError::Name(names[place].clone())))
}

/// Place of each split's right child, 0 for a leaf.
fn right_children(tree: &[TreeNode]) -> Result<Vec<usize>, TreeError> {
    if tree.len() > MAX_NODES {
        return Err(TreeError::Nodes(tree.len()));
    }
    let leaves = tree.iter().filter(|node| matches!(node, TreeNode::Leaf(_))).count();
    let refused = TreeError::Shape { leaves, splits: tree.len() - leaves };
    let mut right = vec![0; tree.len()];
    // Where the subtrees begin that have no parent yet, the leftmost last.
    let mut orphans = Vec::new();
    for (place, node) in tree.iter().enumerate().rev() {
        if matches!(node, TreeNode::Split { .. }) {
            let (Some(_), Some(sibling)) = (orphans.pop(), orphans.pop()) else { return Err(refused) };
            right[place] = sibling;
        }
        orphans.push(place);
    }
    if orphans.len() == 1 { Ok(right) } else { Err(refused) }
}
