//! The results for machines.

use lidar::ObstacleClass;
use serde::Serialize;
use serde_json::{Value, json};

use super::share::Share;
use super::tally::{POINTS, RINGS, SolidErrors, Tally};
use super::{Bar, BudgetPoint, Claims, Evaluation, FitTime, Sense, Standing, Summed};
use crate::{Reliability, RunNote};

/// What was evaluated, and what differs from run to run.
#[derive(Clone, Debug, Serialize)]
pub struct EvaluationNote {
    /// The classifier: method and model.
    pub classifier: String,
    /// The recording that claims are of, if one was given.
    pub recording: Option<String>,
    /// Plan, machine, duration.
    pub run: RunNote,
}

impl Evaluation {
    /// `evaluate.json`: the same for the same plan and classifier, but for `run` and times.
    pub fn to_json(&self, note: &EvaluationNote) -> String {
        let value = json!({
            "encke": env!("CARGO_PKG_VERSION"),
            "classifier": note.classifier,
            "plan": self.plan,
            "holds": self.short().is_empty(),
            "bars": self.bars().iter().map(bar).collect::<Vec<_>>(),
            "classes": ObstacleClass::ALL.map(ObstacleClass::name),
            "reference": tally(&self.reference),
            "noisy": tally(&self.noisy),
            "dropout": tally(&self.dropouts),
            "flat": tally(&self.flat),
            "dense": tally(&self.dense),
            "summed": summed(&self.summed),
            "fit": time(&self.fit),
            "budget": self.budget.iter().map(budget).collect::<Vec<_>>(),
            "recording": self.claims.as_ref().map(|claimed| claims(claimed, note)),
            "run": note.run,
        });
        format!("{value:#}\n")
    }
}

pub(crate) fn bar(bar: &Bar) -> Value {
    json!({
        "key": bar.key,
        "says": bar.says,
        "unit": bar.unit,
        "sense": match bar.sense { Sense::AtLeast => "at least", Sense::AtMost => "at most" },
        "target": bar.target,
        "measured": bar.measured.value.map(rounded),
        "standard_error": bar.measured.error.map(rounded),
        "of": bar.measured.of,
        "holds": match bar.standing() {
            Standing::Holds => Some(true),
            Standing::FallsShort => Some(false),
            Standing::NotJudged => None,
        },
    })
}

pub(crate) fn share(share: Share) -> Value {
    json!({ "count": share.count, "of": share.of, "per_cent": share.per_cent().map(rounded) })
}

/// The ends of a row; the last row has no upper one.
fn range([least, most]: [u32; 2], right: Share) -> Value {
    let mut row = share(right);
    row["from"] = least.into();
    row["to"] = (most < u32::MAX).then_some(most).into();
    row
}

fn tally(tally: &Tally) -> Value {
    let thresholds = tally.thresholds.iter().map(|row| {
        json!({
            "posterior": row.posterior,
            "right": share(row.right),
            "coverage": share(row.kept),
        })
    });
    json!({
        "clusters": tally.all.of,
        "under_5_points": tally.small,
        "right": share(tally.all),
        "actual_by_predicted": tally.confusion,
        "worst_class": tally.worst_class().map(|(class, _)| class.name()),
        "by_points": POINTS.iter().zip(tally.by_points).map(|(&ends, right)| range(ends, right)).collect::<Vec<_>>(),
        "by_rings": RINGS.iter().zip(tally.by_rings).map(|(&ends, right)| range(ends, right)).collect::<Vec<_>>(),
        "reliability": reliability(&tally.reliability),
        "by_posterior": thresholds.collect::<Vec<_>>(),
        "withheld_with_a_fit": share(tally.withheld),
        "solids": solids(&tally.solids),
        "solids_of_50_points": solids(&tally.large_solids),
    })
}

pub(crate) fn reliability(table: &Reliability) -> Value {
    let bins = table.bins.iter().filter(|bin| bin.count > 0).map(
        |bin| json!({ "count": bin.count, "confidence": rounded(bin.confidence), "accuracy": rounded(bin.accuracy) }),
    );
    json!({
        "expected_calibration_error": rounded(table.expected_calibration_error()),
        "bins": bins.collect::<Vec<_>>(),
    })
}

fn solids(errors: &SolidErrors) -> Value {
    let both = |values: Option<[f64; 2]>| values.map(|values| values.map(rounded));
    json!({
        "count": errors.count,
        "centre_m_p50_p90": both(errors.centre_m),
        "size_per_cent_p50_p90": both(errors.size_per_cent),
        "nees_per_dof_mean_median": both(errors.nees_per_dof),
        "within_95": share(errors.within_95),
    })
}

fn summed(summed: &Summed) -> Value {
    json!({
        "single_sweep": share(summed.single),
        "after_sweeps": summed.after.iter().map(|&right| share(right)).collect::<Vec<_>>(),
        "reliability": reliability(&summed.reliability),
    })
}

fn time(time: &FitTime) -> Value {
    json!({ "fits": time.fits, "median_ms": time.median_ms.map(rounded), "least_ms": time.least_ms.map(rounded) })
}

fn budget(point: &BudgetPoint) -> Value {
    json!({
        "evaluations": point.evaluations,
        "right": share(point.all),
        "right_of_50_points": share(point.large),
        "fit": time(&point.time),
    })
}

fn claims(claims: &Claims, note: &EvaluationNote) -> Value {
    json!({
        "recording": note.recording,
        "sweeps": claims.sweeps,
        "under_5_points": claims.small,
        "by_class": claims.by_class,
        "fitted": share(claims.fitted),
        "posterior_at_least_0.9": share(claims.confident),
        "unclassified": share(claims.unclassified),
    })
}

/// To four places.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
