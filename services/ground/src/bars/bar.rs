//! The bars: adding one is adding an entry to [`BARS`], and its target to the plans.

use std::collections::BTreeMap;
use std::fmt;

use super::Evaluation;
use super::share::Share;

/// What is measured against a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Its key in a plan's `bars`.
    pub key: &'static str,
    /// What it says.
    pub says: &'static str,
    /// Unit of target and value.
    pub unit: &'static str,
    /// Which side of the target is the good one.
    pub sense: Sense,
    /// The target; none where the plan has none.
    pub target: Option<f64>,
    /// What was measured.
    pub measured: Measure,
}

/// Which side of a target is the good one. The target itself is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// At least the target.
    AtLeast,
    /// At most the target.
    AtMost,
}

/// A measured value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measure {
    /// The value; none where there was nothing to measure, which reaches no target.
    pub value: Option<f64>,
    /// Its standard error, where it is a share.
    pub error: Option<f64>,
    /// What it was measured on: so many.
    pub of: u32,
}

/// Where a value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// The target is reached.
    Holds,
    /// It is not.
    FallsShort,
    /// The plan has no target.
    NotJudged,
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "ok",
            Self::FallsShort => "FALLS SHORT",
            Self::NotJudged => "no target",
        })
    }
}

impl Sense {
    /// The sign of the comparison.
    pub fn sign(self) -> &'static str {
        match self {
            Self::AtLeast => "≥",
            Self::AtMost => "≤",
        }
    }
}

impl Bar {
    /// Where the value stands.
    pub fn standing(&self) -> Standing {
        let reached = match (self.target, self.measured.value, self.sense) {
            (None, ..) => return Standing::NotJudged,
            (Some(target), Some(value), Sense::AtLeast) => value >= target,
            (Some(target), Some(value), Sense::AtMost) => value <= target,
            (Some(_), None, _) => false,
        };
        if reached { Standing::Holds } else { Standing::FallsShort }
    }
}

/// How a bar is measured on an evaluation `E`.
pub(crate) struct Definition<E> {
    pub(crate) key: &'static str,
    says: &'static str,
    unit: &'static str,
    sense: Sense,
    measure: fn(&E) -> Measure,
}

impl<E> Definition<E> {
    /// What was measured, against these targets.
    pub(crate) fn bar(&self, evaluation: &E, targets: &BTreeMap<String, f64>) -> Bar {
        Bar {
            key: self.key,
            says: self.says,
            unit: self.unit,
            sense: self.sense,
            target: targets.get(self.key).copied(),
            measured: (self.measure)(evaluation),
        }
    }
}

/// Every bar, in the order of reports.
pub(crate) const BARS: [Definition<Evaluation>; 16] = [
    at_least("clusters", "clusters of at least 5 points that all is measured on", "", |e| Measure {
        value: Some(e.reference.all.of.into()),
        error: None,
        of: e.reference.all.of,
    }),
    at_least("accuracy_per_cent", "right, of at least 5 points", "%", |e| share(e.reference.all)),
    at_least("accuracy_50_per_cent", "right, of at least 50 points", "%", |e| share(e.reference.large())),
    at_least("accuracy_20_to_49_per_cent", "right, of 20 to 49 points", "%", |e| share(e.reference.by_points[2])),
    at_least("worst_class_per_cent", "right of the worst class, of at least 5 points", "%", |e| {
        e.reference.worst_class().map_or(Measure::default(), |(_, right)| share(right))
    }),
    at_least("confident_accuracy_per_cent", "right where the posterior is at least 0.9", "%", |e| {
        share(e.reference.confident().right)
    }),
    at_least("confident_coverage_per_cent", "clusters whose posterior is at least 0.9", "%", |e| {
        share(e.reference.confident().kept)
    }),
    at_most("calibration_error", "expected calibration error of the posterior", "", |e| {
        let of = e.reference.reliability.bins.iter().map(|bin| bin.count as u32).sum();
        number((of > 0).then(|| e.reference.reliability.expected_calibration_error()), of)
    }),
    at_most("false_alarm_per_cent", "solids with a fit taken for none of the four", "%", |e| {
        share(e.reference.withheld)
    }),
    at_least("noisy_accuracy_per_cent", "right with more noise, of at least 5 points", "%", |e| share(e.noisy.all)),
    at_least("dropout_accuracy_per_cent", "right with lost echoes, of at least 5 points", "%", |e| {
        share(e.dropouts.all)
    }),
    at_least("flat_accuracy_per_cent", "right with flatter and slimmer bodies, of at least 5 points", "%", |e| {
        share(e.flat.all)
    }),
    at_most("centre_error_m", "centre off, median, of at least 50 points, class right", "m", |e| {
        let solids = &e.reference.large_solids;
        number(solids.centre_m.map(|[median, _]| median), solids.count)
    }),
    at_most("size_error_per_cent", "extents off, median, of at least 50 points, class right", "%", |e| {
        let solids = &e.reference.large_solids;
        number(solids.size_per_cent.map(|[median, _]| median), solids.count)
    }),
    at_most("fit_ms", "time of a fit, mean over the default scene, one core", "ms", |e| {
        number(e.fit.median_ms, e.fit.fits)
    }),
    at_least("summed_accuracy_per_cent", "obstacles right by log posteriors summed over sweeps", "%", |e| {
        share(e.summed.all())
    }),
];

pub(crate) const fn at_least<E>(
    key: &'static str,
    says: &'static str,
    unit: &'static str,
    measure: fn(&E) -> Measure,
) -> Definition<E> {
    Definition { key, says, unit, sense: Sense::AtLeast, measure }
}

pub(crate) const fn at_most<E>(
    key: &'static str,
    says: &'static str,
    unit: &'static str,
    measure: fn(&E) -> Measure,
) -> Definition<E> {
    Definition { key, says, unit, sense: Sense::AtMost, measure }
}

pub(crate) fn share(share: Share) -> Measure {
    Measure { value: share.per_cent(), error: share.standard_error_per_cent(), of: share.of }
}

pub(crate) fn number(value: Option<f64>, of: u32) -> Measure {
    Measure { value, error: None, of }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_reached_by_itself_and_never_by_nothing() {
        let bar = |sense, target, value| Bar {
            key: "",
            says: "",
            unit: "",
            sense,
            target,
            measured: Measure { value, ..Measure::default() },
        };
        for (sense, better, worse) in [(Sense::AtLeast, 2.1, 1.9), (Sense::AtMost, 1.9, 2.1)] {
            let standing = |target, value| bar(sense, target, value).standing();
            assert_eq!(standing(Some(2.0), Some(2.0)), Standing::Holds);
            assert_eq!(standing(Some(2.0), Some(better)), Standing::Holds);
            assert_eq!(standing(Some(2.0), Some(worse)), Standing::FallsShort);
            assert_eq!(standing(Some(2.0), Some(f64::NAN)), Standing::FallsShort);
            assert_eq!(standing(Some(2.0), None), Standing::FallsShort);
            assert_eq!(standing(None, Some(worse)), Standing::NotJudged);
        }
    }
}
