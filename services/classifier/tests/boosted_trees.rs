//! Boosted trees against a plain recursive walk, and their file.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use classifier::{BoostedTrees, BoostedTreesError, BoostedTreesFileError, TreeError, TreeNode, softmax};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FEATURES: usize = 7;

/// A tree with this many leaves, of any shape.
fn tree(random: &mut ChaCha8Rng, leaves: usize) -> Vec<TreeNode> {
    if leaves == 1 {
        return vec![TreeNode::Leaf(random.random_range(-0.1..0.1))];
    }
    let left = random.random_range(1..leaves);
    let feature = random.random_range(0..FEATURES as u8);
    // Few thresholds, so that features equal to one occur.
    let threshold = random.random_range(-8..8) as f32 / 4.0;
    let mut nodes = vec![TreeNode::Split { feature, threshold }];
    nodes.extend(tree(random, left));
    nodes.extend(tree(random, leaves - left));
    nodes
}

fn trees(seed: u64, rounds: usize, leaves: usize) -> Vec<Vec<TreeNode>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..4 * rounds)
        .map(|_| {
            let leaves = random.random_range(1..=leaves);
            tree(&mut random, leaves)
        })
        .collect()
}

fn names() -> Vec<String> {
    (0..FEATURES).map(|feature| format!("feature_{feature}")).collect()
}

const BASE: [f64; 4] = [-1.5, -1.25, -1.0, -2.0];

fn model(trees: &[Vec<TreeNode>]) -> BoostedTrees {
    BoostedTrees::new(names(), BASE, 1.5, trees).unwrap()
}

fn leaf(value: f32) -> Vec<TreeNode> {
    vec![TreeNode::Leaf(value)]
}

/// What a tree adds, and how many of its nodes it has.
fn walk(tree: &[TreeNode], features: &[f32]) -> (f32, usize) {
    match tree[0] {
        TreeNode::Leaf(value) => (value, 1),
        TreeNode::Split { feature, threshold } => {
            let (left, left_nodes) = walk(&tree[1..], features);
            let (right, right_nodes) = walk(&tree[1 + left_nodes..], features);
            let goes_right = features[usize::from(feature)] > threshold;
            (if goes_right { right } else { left }, 1 + left_nodes + right_nodes)
        }
    }
}

#[test]
fn scores_are_those_of_a_recursive_walk() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (rounds, leaves) in [(0, 1), (1, 1), (1, 2), (3, 2), (20, 31), (2, 4_096)] {
        let trees = trees(rounds as u64, rounds, leaves);
        let model = model(&trees);
        assert_eq!(model.rounds(), rounds);
        for _ in 0..200 {
            let features: [f32; FEATURES] = std::array::from_fn(|_| match random.random_range(0..20) {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => f32::NEG_INFINITY,
                _ => random.random_range(-9..9) as f32 / 4.0,
            });
            let mut expected = BASE;
            for (place, tree) in trees.iter().enumerate() {
                let (value, nodes) = walk(tree, &features);
                assert_eq!(nodes, tree.len());
                expected[place % 4] += f64::from(value);
            }
            assert_eq!(model.scores(&features), expected);
            assert_eq!(model.posterior(&features), softmax(expected, 1.5));
        }
    }
}

#[test]
fn a_feature_at_the_threshold_or_unknown_or_missing_goes_left() {
    let stump = vec![TreeNode::Split { feature: 1, threshold: 2.0 }, TreeNode::Leaf(-1.0), TreeNode::Leaf(1.0)];
    let model = model(&[stump, leaf(0.0), leaf(0.0), leaf(0.0)]);
    let added = |features: &[f32]| model.scores(features)[0] - BASE[0];
    assert_eq!(added(&[9.0, 2.0]), -1.0);
    assert_eq!(added(&[9.0, 2.0_f32.next_up()]), 1.0);
    assert_eq!(added(&[9.0, f32::INFINITY]), 1.0);
    assert_eq!(added(&[9.0, f32::NEG_INFINITY]), -1.0);
    assert_eq!(added(&[9.0, f32::NAN]), -1.0);
    assert_eq!(added(&[9.0]), -1.0);
    assert_eq!(added(&[]), -1.0);
}

#[test]
fn a_posterior_is_the_softmax_of_scores_by_temperature() {
    let near = |found: [f64; 4], expected: [f64; 4]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
    };
    near(softmax([1.0_f64.ln(), 2.0_f64.ln(), 3.0_f64.ln(), 4.0_f64.ln()], 1.0), [0.1, 0.2, 0.3, 0.4]);
    near(softmax([0.0, 4.0_f64.ln(), 0.0, 0.0], 2.0), [0.2, 0.4, 0.2, 0.2]);
    near(softmax([1e300, -1e300, 0.0, -f64::MAX], 0.01), [1.0, 0.0, 0.0, 0.0]);
    near(softmax([-f64::MAX; 4], 100.0), [0.25; 4]);
    let hotter = model(&[]).with_temperature(3.0).unwrap();
    near(hotter.posterior(&[]), softmax(BASE, 3.0));
}

#[test]
fn numbers_that_are_no_model_are_refused() {
    let refused = |names: Vec<String>, base, temperature, trees: &[Vec<TreeNode>]| {
        BoostedTrees::new(names, base, temperature, trees).unwrap_err()
    };
    let of_tree = |tree: Vec<TreeNode>| match refused(names(), BASE, 1.0, &[leaf(0.0), tree, leaf(0.0), leaf(0.0)]) {
        BoostedTreesError::Tree { tree: 2, error } => error,
        other => panic!("{other}"),
    };
    let split = |feature, threshold| TreeNode::Split { feature, threshold };
    let end = TreeNode::Leaf(0.5);
    assert_eq!(refused(vec![], BASE, 1.0, &[]), BoostedTreesError::Features(0));
    let many = (0..256).map(|place| format!("f{place}")).collect();
    assert_eq!(refused(many, BASE, 1.0, &[]), BoostedTreesError::Features(256));
    for name in ["", "a b", "a\n", "a"] {
        let error = refused(vec!["a".to_owned(), name.to_owned()], BASE, 1.0, &[]);
        assert_eq!(error, BoostedTreesError::Name(name.to_owned()));
    }
    for temperature in [0.0, -1.0, 0.009, 100.1, f64::INFINITY] {
        assert_eq!(refused(names(), BASE, temperature, &[]), BoostedTreesError::Temperature(temperature));
    }
    assert!(matches!(refused(names(), BASE, f64::NAN, &[]), BoostedTreesError::Temperature(_)));
    let infinite = f64::INFINITY;
    assert_eq!(refused(names(), [0.0, infinite, 0.0, 0.0], 1.0, &[]), BoostedTreesError::Base(infinite));
    assert_eq!(refused(names(), BASE, 1.0, &[leaf(0.0), leaf(0.0)]), BoostedTreesError::Trees(2));
    assert_eq!(of_tree(vec![]), TreeError::Shape { leaves: 0, splits: 0 });
    assert_eq!(of_tree(vec![end, end]), TreeError::Shape { leaves: 2, splits: 0 });
    assert_eq!(of_tree(vec![split(0, 0.0), end]), TreeError::Shape { leaves: 1, splits: 1 });
    assert_eq!(of_tree(vec![end, split(0, 0.0), end]), TreeError::Shape { leaves: 2, splits: 1 });
    assert_eq!(of_tree(vec![split(7, 0.0), end, end]), TreeError::Feature { feature: 7, features: 7 });
    assert_eq!(of_tree(vec![split(0, f32::INFINITY), end, end]), TreeError::Number(f32::INFINITY));
    assert_eq!(of_tree(leaf(f32::NEG_INFINITY)), TreeError::Number(f32::NEG_INFINITY));
    assert_eq!(of_tree(tree(&mut ChaCha8Rng::seed_from_u64(1), 4_097)), TreeError::Nodes(8_193));
}

#[test]
fn a_model_written_and_read_is_the_same_and_writes_the_same_file() {
    for (rounds, leaves) in [(0, 1), (1, 1), (30, 31)] {
        let model = model(&trees(5, rounds, leaves));
        let read = BoostedTrees::parse(&model.to_text()).unwrap();
        assert_eq!(read, model);
        assert_eq!(read.to_text(), model.to_text());
    }
    let odd = [f32::MIN, f32::MAX, f32::MIN_POSITIVE, f32::EPSILON, 1e-40, -0.0, 1.0, 16_777_216.0];
    let model = model(&odd.map(leaf));
    let read = BoostedTrees::parse(&model.to_text()).unwrap();
    let bits = |model: &BoostedTrees| -> Vec<u32> {
        model.trees().map(|tree| if let [TreeNode::Leaf(value)] = tree[..] { value.to_bits() } else { 0 }).collect()
    };
    assert_eq!(bits(&read), odd.map(f32::to_bits));
    assert_eq!(read.to_text(), model.to_text());
}

const TEXT: &str = "\
encke boosted-trees 1
classes rectangular ellipsoidal cylindrical conical
features 2
names range_m points
temperature 1.25
base -1.4 -1.3 -1.4 -1.5
rounds 1
0:12.5 1:7 -0.02 0.013 0.041
0.5
1:0.25 -0.125 1
0
";

#[test]
fn a_file_reads_as_its_format_says() {
    let model = BoostedTrees::parse(TEXT).unwrap();
    assert_eq!(model.feature_names(), ["range_m", "points"]);
    assert_eq!((model.rounds(), model.temperature(), model.base()), (1, 1.25, [-1.4, -1.3, -1.4, -1.5]));
    assert_eq!(model.scores(&[12.5, 7.5]), [-1.4 + f64::from(0.013_f32), -0.8, -0.399_999_999_999_999_9, -1.5]);
    assert_eq!(model.scores(&[13.0, 0.0])[0], -1.4 + f64::from(0.041_f32));
    assert_eq!(model.to_text(), TEXT);
}

#[test]
fn each_broken_line_is_refused_by_number() {
    let refused = |from: &str, to: &str| {
        assert!(TEXT.contains(from), "{from}");
        BoostedTrees::parse(&TEXT.replacen(from, to, 1)).unwrap_err().to_string()
    };
    assert!(refused("trees 1", "trees 2").starts_with("line 1 is \"encke boosted-trees 2\", must be \"encke"));
    assert!(refused("rectangular ell", "ell").starts_with("line 2 is"));
    assert!(refused("features 2", "features 0").starts_with("line 3 is \"features 0\", must be"));
    assert!(refused("features 2", "features 256").starts_with("line 3 is"));
    assert!(refused("features 2", "features2").starts_with("line 3 is"));
    assert!(refused("features 2", "features 3").starts_with("line 4 is \"names range_m points\", must be"));
    assert!(refused("points", "range_m").starts_with("line 4: feature \"range_m\" must be one word"));
    assert!(refused("points", "pöints").starts_with("line 4: feature"));
    assert!(refused("temperature 1.25", "temperature hot").starts_with("line 5 is"));
    assert!(refused("temperature 1.25", "temperature 0").starts_with("line 5: temperature is 0, must be 0.01 to 100"));
    assert!(refused("base -1.4", "base").starts_with("line 6 is"));
    assert!(refused("base -1.4", "base inf").starts_with("line 6: the model has a base score of inf"));
    assert!(refused("rounds 1", "rounds 10001").starts_with("line 7 is \"rounds 10001\", must be"));
    assert!(refused("rounds 1", "rounds 2").starts_with("line 12 is \"\", must be a tree of splits"));
    assert!(refused("rounds 1", "rounds 0").starts_with("line 8 is \"0:12.5 1:7 -0.02 0.013 0.041\", must be the end"));
    assert!(refused("0:12.5", "0:x").starts_with("line 8 is \"0:x\", must be a tree of splits"));
    assert!(refused("0:12.5", "256:1").starts_with("line 8 is \"256:1\""));
    assert!(refused("0:12.5", "2:1").starts_with("line 8: tree 1 has a split by feature 2, must be under 2"));
    assert!(refused("0:12.5", "0:NaN").starts_with("line 8: tree 1 has a number of NaN, must be finite"));
    assert!(refused("0.041", "1e39").starts_with("line 8: tree 1 has a number of inf, must be finite"));
    assert!(refused("0.5\n", "\n").starts_with("line 9 is \"\""));
    assert!(refused("-0.125", "").starts_with("line 10: tree 3 has 1 leaves for 1 splits"));
    assert!(refused("-0.125", "-0.125 2").starts_with("line 10: tree 3 has 3 leaves for 1 splits"));
    assert!(BoostedTrees::parse(&format!("{TEXT}0\n")).unwrap_err().to_string().starts_with("line 12 is \"0\""));
    assert!(matches!(BoostedTrees::parse(""), Err(BoostedTreesFileError::Line { line: 1, .. })));
}

#[test]
fn no_damage_to_a_file_makes_reading_it_panic() {
    let text = model(&trees(6, 5, 31)).to_text();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut accepted = 0;
    for _ in 0..3_000 {
        let mut bytes = text.clone().into_bytes();
        for _ in 0..random.random_range(1..4) {
            let place = random.random_range(0..bytes.len());
            bytes[place] = match random.random_range(0..3) {
                0 => random.random(),
                1 => bytes[random.random_range(0..text.len())],
                _ => *b" :.-e0\n".get(random.random_range(0..7)).unwrap(),
            };
        }
        if random.random_bool(0.2) {
            bytes.truncate(random.random_range(0..bytes.len()));
        }
        if let Ok(model) = BoostedTrees::parse(&String::from_utf8_lossy(&bytes)) {
            accepted += 1;
            let posterior = model.posterior(&[0.25; FEATURES]);
            assert!((posterior.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{posterior:?}");
            assert_eq!(BoostedTrees::parse(&model.to_text()).unwrap(), model);
        }
    }
    assert!((100..2_900).contains(&accepted), "{accepted} damaged files still read");
}
