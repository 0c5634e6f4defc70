use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::calibrate::log_loss;

pub(super) fn params() -> BoostingParams {
    BoostingParams {
        rounds: 20,
        patience: 20,
        learning_rate: 0.25,
        leaves: 15,
        min_rows: 5,
        lambda_l2: 0.5,
        feature_share: 1.0,
        row_share: 1.0,
        seed: 1,
    }
}

/// A table of its own.
struct Table {
    names: Vec<String>,
    features: Vec<f32>,
    classes: Vec<u8>,
}

impl Table {
    /// Rows of uniform features in −1 to 1 and the class that `class` gives them.
    fn of<const N: usize>(count: usize, seed: u64, class: impl Fn(&[f32; N]) -> usize) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let rows: Vec<[f32; N]> = (0..count).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
        Self {
            names: (0..N).map(|feature| format!("f{feature}")).collect(),
            classes: rows.iter().map(|row| class(row) as u8).collect(),
            features: rows.into_flattened(),
        }
    }

    fn rows(&self) -> LabelledRows<'_> {
        LabelledRows { features: &self.features, classes: &self.classes, weights: None }
    }

    fn fit(&self, held_out: Option<&Table>, params: &BoostingParams) -> FittedTrees {
        let held_out = held_out.map(Table::rows);
        fit_trees(&self.names, &self.rows(), held_out.as_ref(), params, &mut |_| {}).unwrap()
    }

    fn each(&self) -> impl Iterator<Item = (&[f32], usize)> {
        self.features.chunks_exact(self.names.len()).zip(self.classes.iter().map(|&class| usize::from(class)))
    }

    fn share_right(&self, model: &BoostedTrees) -> f64 {
        let right = |(row, class): &(&[f32], usize)| {
            let scores = model.scores(row);
            (0..4).all(|q| q == *class || scores[q] < scores[*class])
        };
        self.each().filter(right).count() as f64 / self.classes.len() as f64
    }

    fn loss(&self, model: &BoostedTrees) -> f64 {
        let loss: f64 = self.each().map(|(row, class)| log_loss(model.scores(row), class, 1.0)).sum();
        loss / self.classes.len() as f64
    }
}

/// Two exclusive ors: no feature alone says anything.
fn two_xors(row: &[f32; 5]) -> usize {
    2 * usize::from((row[0] > 0.0) != (row[1] > 0.2)) + usize::from((row[2] > -0.1) != (row[3] > 0.0))
}

/// Four rings of about equal area round the origin.
fn rings(row: &[f32; 2]) -> usize {
    [0.5, 0.7, 0.9].iter().filter(|&&radius| row[0].hypot(row[1]) > radius).count()
}

/// Half of the rows have a class that their features do not tell.
fn noisy(row: &[f32; 4]) -> usize {
    let told = usize::from(row[0] > 0.0) + 2 * usize::from(row[1] * row[2] > 0.0);
    let noise = ((row[3] + 1.0) * 4_000.0) as usize;
    if noise.is_multiple_of(2) { told } else { noise / 2 % 4 }
}

#[test]
fn classes_that_no_single_feature_tells_are_learned() {
    let params = BoostingParams { rounds: 60, ..params() };
    let fitted = Table::of(4_000, 1, two_xors).fit(None, &params);
    let right = Table::of(2_000, 2, two_xors).share_right(&fitted.model);
    assert!(right > 0.98, "{right}");
    let fitted = Table::of(4_000, 3, rings).fit(None, &params);
    let right = Table::of(2_000, 4, rings).share_right(&fitted.model);
    assert!(right > 0.95, "{right}");
    assert_eq!(fitted.model.rounds(), 60);
}

#[test]
fn shares_of_rows_and_features_still_learn_and_differ_by_seed() {
    let train = Table::of(4_000, 5, two_xors);
    let shares = BoostingParams { rounds: 80, feature_share: 0.6, row_share: 0.5, ..params() };
    let fitted = train.fit(None, &shares);
    let right = Table::of(2_000, 6, two_xors).share_right(&fitted.model);
    assert!(right > 0.97, "{right}");
    assert_eq!(train.fit(None, &shares), fitted);
    let short = BoostingParams { rounds: 2, ..shares };
    assert_ne!(train.fit(None, &BoostingParams { seed: 2, ..short.clone() }), train.fit(None, &short));
}

/// All jobs on this thread, the last one first.
struct Backwards;

impl Workers for Backwards {
    fn map<J: Sync, R: Send>(&self, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
        let mut done: Vec<R> = jobs.iter().rev().map(work).collect();
        done.reverse();
        done
    }
}

/// As many threads, each job to whoever is free.
struct Threads(usize);

impl Workers for Threads {
    fn map<J: Sync, R: Send>(&self, jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
        let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
        std::thread::scope(|scope| {
            for _ in 0..self.0 {
                scope.spawn(|| {
                    while let (place, Some(job)) = {
                        let place = next.fetch_add(1, Ordering::Relaxed);
                        (place, jobs.get(place))
                    } {
                        let result = work(job);
                        done.lock().unwrap().push((place, result));
                    }
                });
            }
        });
        let mut done = done.into_inner().unwrap();
        done.sort_by_key(|(place, _)| *place);
        done.into_iter().map(|(_, result)| result).collect()
    }
}

#[test]
fn the_same_rows_give_the_same_bytes_on_any_number_of_threads() {
    // More rows than two blocks.
    let (train, held_out) = (Table::of(20_000, 7, noisy), Table::of(17_000, 8, noisy));
    let params = BoostingParams { rounds: 6, feature_share: 0.7, row_share: 0.6, ..params() };
    fn fit(workers: &impl Workers, train: &Table, held_out: &Table, params: &BoostingParams) -> FittedTrees {
        fit_with(workers, &train.names, &train.rows(), Some(&held_out.rows()), params, &mut |_| {}).unwrap()
    }
    let expected = fit(&AllCores, &train, &held_out, &params);
    assert_eq!(expected.model.rounds(), 6);
    for found in [
        fit(&Backwards, &train, &held_out, &params),
        fit(&Threads(1), &train, &held_out, &params),
        fit(&Threads(3), &train, &held_out, &params),
        fit(&Threads(7), &train, &held_out, &params),
    ] {
        assert_eq!(found, expected);
        assert_eq!(found.model.to_text(), expected.model.to_text());
    }
}

#[test]
fn losses_are_those_of_the_model_written_and_read() {
    let (train, held_out) = (Table::of(3_000, 9, noisy), Table::of(1_000, 10, noisy));
    let fitted = train.fit(Some(&held_out), &BoostingParams { rounds: 5, ..params() });
    let model = BoostedTrees::parse(&fitted.model.to_text()).unwrap();
    assert_eq!((model.rounds(), fitted.losses.len()), (5, 6));
    let last = fitted.losses[5];
    assert!((last.training - train.loss(&model)).abs() < 1e-12);
    assert!((last.held_out.unwrap() - held_out.loss(&model)).abs() < 1e-12);
    let training = |pair: &[RoundLoss]| pair[1].training < pair[0].training;
    assert!(fitted.losses.windows(2).all(training), "{:?}", fitted.losses);
}

#[test]
fn rounds_end_where_the_held_out_loss_has_not_fallen_for_long_and_the_best_are_kept() {
    let (train, held_out) = (Table::of(2_000, 11, noisy), Table::of(2_000, 12, noisy));
    let mut heard = Vec::new();
    let params = BoostingParams { rounds: 200, patience: 7, learning_rate: 0.5, ..params() };
    let mut hear = |loss: &RoundLoss| heard.push(*loss);
    let fitted = fit_trees(&train.names, &train.rows(), Some(&held_out.rows()), &params, &mut hear).unwrap();
    assert_eq!(heard, fitted.losses);
    let loss = |rounds: usize| fitted.losses[rounds].held_out.unwrap();
    let best = fitted.model.rounds();
    assert!((1..150).contains(&best), "{best}");
    assert_eq!(fitted.losses.len(), best + 7 + 1);
    assert!(
        (0..fitted.losses.len()).all(|rounds| fitted.losses[rounds].rounds == rounds && loss(best) <= loss(rounds))
    );
    assert!((held_out.loss(&fitted.model) - loss(best)).abs() < 1e-12);
    let all = train.fit(None, &BoostingParams { rounds: 30, patience: 1, ..params });
    assert_eq!((all.model.rounds(), all.losses[30].held_out), (30, None));
}

#[test]
fn a_row_of_weight_two_counts_as_two_rows() {
    let mut table = Table::of(600, 13, noisy);
    for value in &mut table.features {
        *value = (*value * 20.0).round();
    }
    let weights: Vec<f32> = (0..600).map(|row| if row % 3 == 0 { 2.0 } else { 1.0 }).collect();
    let mut twice = Table { names: table.names.clone(), features: Vec::new(), classes: Vec::new() };
    for ((features, class), &weight) in table.each().zip(&weights) {
        for _ in 0..weight as usize {
            twice.features.extend(features);
            twice.classes.push(class as u8);
        }
    }
    let params = BoostingParams { rounds: 5, min_rows: 1, ..params() };
    let rows = LabelledRows { weights: Some(&weights), ..table.rows() };
    let weighted = fit_trees(&table.names, &rows, Some(&rows), &params, &mut |_| {}).unwrap();
    let repeated = twice.fit(Some(&twice), &params);
    for (a, b) in weighted.losses.iter().zip(&repeated.losses) {
        assert!((a.training - b.training).abs() < 1e-6 && a.held_out == Some(a.training), "{a:?} {b:?}");
    }
    assert_ne!(weighted.losses, table.fit(None, &params).losses);
}

#[test]
fn every_leaf_has_rows_enough() {
    let table = Table::of(1_000, 14, noisy);
    let fitted = table.fit(None, &BoostingParams { rounds: 3, min_rows: 60, leaves: 31, ..params() });
    for tree in fitted.model.trees() {
        let mut rows = vec![0; tree.len()];
        for (features, _) in table.each() {
            let mut place = 0;
            while let TreeNode::Split { feature, threshold } = tree[place] {
                place += 1;
                if features[usize::from(feature)] > threshold {
                    // Over the left child: a tree is whole once it has one leaf more than splits.
                    let mut open = 1;
                    while open > 0 {
                        open = if matches!(tree[place], TreeNode::Leaf(_)) { open - 1 } else { open + 1 };
                        place += 1;
                    }
                }
            }
            rows[place] += 1;
        }
        let leaves = tree.iter().zip(rows).filter(|(node, _)| matches!(node, TreeNode::Leaf(_)));
        assert!(tree.len() > 10 && leaves.map(|(_, rows)| rows).all(|rows| rows >= 60), "{tree:?}");
    }
}

#[test]
fn whether_a_feature_is_known_can_tell_a_class() {
    let mut table = Table::of(2_000, 15, two_xors);
    for (row, class) in table.classes.iter().enumerate().filter(|(_, class)| **class == 2) {
        assert_eq!(*class, 2);
        table.features[5 * row + 4] = f32::NAN;
    }
    let fitted = table.fit(None, &BoostingParams { rounds: 30, ..params() });
    for row in [[0.1, 0.2, 0.3, 0.4, f32::NAN], [-0.5, 0.5, -0.5, 0.5, f32::NEG_INFINITY]] {
        assert!(fitted.model.posterior(&row)[2] > 0.95);
    }
    assert!(fitted.model.posterior(&[0.5, -0.5, 0.5, 0.5, -1e30])[2] < 0.05);
}

#[test]
fn features_that_tell_nothing_give_the_shares_of_the_classes() {
    let table = Table {
        names: vec!["same".to_owned(), "unknown".to_owned()],
        features: [7.0, f32::NAN].repeat(10),
        classes: vec![0, 0, 0, 0, 1, 1, 1, 2, 2, 3],
    };
    let fitted = table.fit(None, &params());
    let posterior = fitted.model.posterior(&[7.0, f32::NAN]);
    assert!(posterior.iter().zip([0.4, 0.3, 0.2, 0.1]).all(|(a, b)| (a - b).abs() < 1e-6), "{posterior:?}");
}

#[test]
fn gradients_are_derivatives_of_the_loss() {
    let features = [0.0; 4];
    let rows = LabelledRows { features: &features, classes: &[0, 1, 2, 3], weights: Some(&[1.0, 2.0, 0.5, 0.0]) };
    let base = [-1.0, 0.5, 0.0, 2.0];
    let scored = Scored::new(&AllCores, &rows, &Quantiles::of(&AllCores, &rows, 1), base);
    for row in 0..4 {
        for class in 0..4 {
            let loss = |step: f64| {
                let mut scores = base;
                scores[class] += step;
                rows.weight_of(row) * log_loss(scores, row, 1.0)
            };
            let first = (loss(1e-4) - loss(-1e-4)) / 2e-4;
            let second = (loss(1e-4) - 2.0 * loss(0.0) + loss(-1e-4)) / 1e-8;
            let [gradient, hessian] = scored.gradient(row, class).map(f64::from);
            assert!((gradient - first).abs() < 1e-6 && (hessian - second * 4.0 / 3.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_sample_has_its_share_in_order_and_each_number_as_often() {
    let mut often = [0; 50];
    for seed in 0..2_000 {
        let sample = sample(&mut stream(seed, 3), 0.3, 50);
        assert_eq!(sample.len(), 15);
        assert!(sample.is_sorted_by(|a, b| a < b));
        sample.iter().for_each(|&number| often[number as usize] += 1);
    }
    // 600 ± 20.
    assert!(often.iter().all(|count| (500..700).contains(count)), "{often:?}");
    assert_eq!(sample(&mut stream(1, 0), 1.0, 4), [0, 1, 2, 3]);
    assert_eq!(sample(&mut stream(1, 0), 0.01, 4).len(), 1);
}

#[test]
fn each_parameter_out_of_range_is_refused_by_name() {
    let table = Table::of(100, 16, rings);
    let refused = |breaks: fn(&mut BoostingParams)| {
        let mut params = params();
        breaks(&mut params);
        fit_trees(&table.names, &table.rows(), None, &params, &mut |_| {}).unwrap_err().to_string()
    };
    assert_eq!(refused(|p| p.rounds = 0), "rounds is 0, must be 1 to 10000");
    assert_eq!(refused(|p| p.patience = 0), "patience is 0, must be 1 to 10000");
    assert_eq!(refused(|p| p.learning_rate = 1.5), "learning_rate is 1.5, must be over 0 and at most 1");
    assert_eq!(refused(|p| p.leaves = 1), "leaves is 1, must be 2 to 4096");
    assert_eq!(refused(|p| p.min_rows = 0), "min_rows is 0, must be 1 to 1000000");
    assert_eq!(refused(|p| p.lambda_l2 = f64::NAN), "lambda_l2 is NaN, must be 0 to 1000000");
    assert_eq!(refused(|p| p.feature_share = 0.0), "feature_share is 0, must be over 0 and at most 1");
    assert_eq!(refused(|p| p.row_share = -1.0), "row_share is -1, must be over 0 and at most 1");
    let text = toml::to_string(&params()).unwrap();
    assert_eq!(toml::from_str(&text), Ok(params()));
    assert!(toml::from_str::<BoostingParams>(&format!("{text}depth = 3\n")).is_err());
}

#[test]
fn rows_that_do_not_fit_together_are_refused() {
    let table = Table::of(100, 17, rings);
    let refused = |names: &[String], training: LabelledRows, held_out: Option<LabelledRows>| {
        fit_trees(names, &training, held_out.as_ref(), &params(), &mut |_| {}).unwrap_err().to_string()
    };
    let rows = table.rows();
    let names = &table.names[..];
    let short = LabelledRows { features: &table.features[1..], ..rows };
    assert_eq!(refused(names, short, None), "features has 199 entries, must have 200");
    assert_eq!(refused(names, rows, Some(short)), "features has 199 entries, must have 200");
    let short = LabelledRows { weights: Some(&[1.0]), ..rows };
    assert_eq!(refused(names, short, None), "weights has 1 entries, must have 100");
    let mut weights = [1.0; 100];
    weights[7] = f32::NAN;
    let unweighable = LabelledRows { weights: Some(&weights), ..rows };
    assert_eq!(refused(names, unweighable, None), "weight of row 7 is NaN, must be 0 to 1000000");
    let mut classes = table.classes.clone();
    classes[9] = 4;
    assert_eq!(refused(names, LabelledRows { classes: &classes, ..rows }, None), "class of row 9 is 4, must be 0 to 3");
    let classes: Vec<u8> = table.classes.iter().map(|&class| class.min(2)).collect();
    let without = refused(names, LabelledRows { classes: &classes, ..rows }, None);
    assert_eq!(without, "no row with a weight is conical, must be at least one");
    let nothing = LabelledRows { features: &[], classes: &[], weights: None };
    assert!(refused(names, nothing, None).starts_with("no row with a weight is rectangular"));
    assert!(refused(names, rows, Some(nothing)).starts_with("the weights of the held-out rows"));
    let same = vec!["a".to_owned(); 2];
    assert!(refused(&same, rows, None).starts_with("feature \"a\" must be one word"));
}
