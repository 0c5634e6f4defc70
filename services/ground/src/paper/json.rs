//! The results for machines.

use lidar::ObstacleClass;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Choice, FourClass, Reproduction, published};
use crate::Confusion;

/// What differs from run to run; results hang on none of it.
#[derive(Clone, Debug, Serialize)]
pub struct RunNote {
    /// The plan's file.
    pub plan_file: String,
    /// Processor.
    pub machine: String,
    /// Cores that were used.
    pub cores: usize,
    /// From the first line read to the last test \[s\].
    pub duration_s: f64,
}

impl Reproduction {
    /// `paper.json`: the same for the same plan, but for `run`.
    pub fn to_json(&self, run: &RunNote) -> String {
        let shares = self.c_tried.iter().map(|&(c, right)| json!({ "c": c, "per_cent": rounded(100.0 * right) }));
        let two_class = self.two_class.iter().zip(published::TWO_CLASS).map(|(pair, (_, _, paper))| {
            let classes = pair.classes;
            let counts: Vec<[u32; 2]> =
                classes.iter().map(|&row| classes.map(|column| pair.cluttered.counts()[row][column])).collect();
            json!({
                "classes": classes.map(|class| ObstacleClass::SOLIDS[class].name()),
                "actual_by_predicted": counts,
                "c": pair.c,
                "mean_per_cent": rounded(pair.mean_per_cent()),
                "paper_per_cent": paper,
            })
        });
        let convergence = self.convergence.iter().map(|point| {
            json!({
                "examples_of_each_class": point.examples,
                "svm_per_cent": rounded(point.svm.mean_per_cent()),
                "svm_on_its_training_per_cent": rounded(point.svm_training.mean_per_cent()),
                "naive_bayes_per_cent": rounded(point.naive_bayes.mean_per_cent()),
            })
        });
        let (judged, right) = self.pictures.scene.right();
        let combinations = &self.pictures.combinations;
        let share_at = |place: usize| combinations.share.each_ref().map(|class| rounded(class[place][0]));
        let value = json!({
            "encke": env!("CARGO_PKG_VERSION"),
            "plan": self.plan,
            "classes": ObstacleClass::SOLIDS.map(ObstacleClass::name),
            "table_1": table("naive-bayes", &self.naive_bayes, &published::NAIVE_BAYES),
            "table_2": table("svm", &self.svm, &published::SVM),
            "svm": { "gamma": self.plan.svm.gamma, "c": self.c, "c_tried": shares.collect::<Vec<_>>() },
            "table_3": two_class.collect::<Vec<_>>(),
            "figure_2": self.pictures.scans.iter().map(|scan| json!({
                "class": scan.class.name(),
                "training_obstacle": scan.number,
                "returns": scan.points_m.len(),
                "size_m": scan.truth.size_m,
            })).collect::<Vec<_>>(),
            "figure_3": combinations.index.iter().enumerate().map(|(place, &index)| json!({
                "combination": index,
                "mean_per_cent": share_at(place),
            })).collect::<Vec<_>>(),
            "figure_6": {
                "seed": self.plan.reproduction.as_ref().map(|r| r.picture_seed),
                "obstacles": self.pictures.scene.objects.len(),
                "clusters": self.pictures.scene.clusters.len(),
                "judged": judged,
                "right": right,
            },
            "figure_7": convergence.collect::<Vec<_>>(),
            "choices": self.choices.iter().map(choice).collect::<Vec<_>>(),
            "run": run,
        });
        format!("{value:#}\n")
    }
}

fn table(method: &str, ours: &FourClass, paper: &published::Table) -> Value {
    json!({
        "method": method,
        "cluttered": confusion(&ours.cluttered),
        "alone": confusion(&ours.alone),
        "paper_per_cent": paper,
        "paper_mean_per_cent": published::mean(paper),
    })
}

fn confusion(confusion: &Confusion) -> Value {
    json!({
        "actual_by_predicted": confusion.counts(),
        "per_cent": confusion.per_cent().map(|row| row.map(rounded)),
        "mean_per_cent": rounded(confusion.mean_per_cent()),
        "standard_error_per_cent": rounded(confusion.standard_error_per_cent()),
        "too_few_points": confusion.unclassified(),
    })
}

fn choice(choice: &Choice) -> Value {
    json!({
        "name": choice.name,
        "open": choice.open,
        "ours": choice.ours,
        "tried": choice.tried,
        "naive_bayes": choice.naive_bayes.as_ref().map(confusion),
        "svm": choice.svm.as_ref().map(confusion),
        "c": choice.c,
        "svm_by_distance": choice.by_distance.iter().map(confusion).collect::<Vec<_>>(),
    })
}

fn rounded(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}
