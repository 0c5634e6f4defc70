//! The bars of tracks: adding one is adding an entry to [`BARS`], and its target to the plans.

use super::TrackEvaluation;
use crate::Measure;
use crate::bars::bar::{Definition, at_least, at_most, number, share};

/// Every bar, in the order of reports.
pub(crate) const BARS: [Definition<TrackEvaluation>; 20] = [
    at_least(
        "obstacle_sweeps",
        "obstacles of at least 5 returns, in each sweep anew, that all is counted on",
        "",
        |e| {
            let of = e.scores.judged().clear.objects;
            number(Some(of.into()), of)
        },
    ),
    at_least("idf1_per_cent", "IDF1, of at least 5 returns", "%", |e| {
        let judged = e.scores.judged().identity;
        number(judged.idf1().map(|value| 100.0 * value), judged.objects)
    }),
    at_least("mota_per_cent", "MOTA, of at least 5 returns", "%", |e| {
        let judged = e.scores.judged().clear;
        number(judged.mota().map(|value| 100.0 * value), judged.objects)
    }),
    at_least("hota_per_cent", "HOTA, of at least 5 returns", "%", |e| {
        number(e.scores.hota.hota().map(|value| 100.0 * value), e.scores.judged().clear.objects)
    }),
    at_most("position_rmse_m", "position off, root mean square, seen and confirmed, at least 50 returns", "m", |e| {
        let errors = e.scores.errors.position_m[3];
        number(errors.value(), errors.count)
    }),
    at_most(
        "velocity_1s_rmse_mps",
        "velocity off, root mean square, 1 s after birth, at least 20 returns",
        "m/s",
        |e| aged(e, 1.0),
    ),
    at_most(
        "velocity_2s_rmse_mps",
        "velocity off, root mean square, 2 s after birth, at least 20 returns",
        "m/s",
        |e| aged(e, 2.0),
    ),
    at_least("nees_inside_per_cent", "NEES of position and velocity inside its two-sided 95 % bounds", "%", |e| {
        share(e.scores.consistency.state.inside())
    }),
    at_most("nees_inside_at_most_per_cent", "the same: more means covariances that are too wide", "%", |e| {
        share(e.scores.consistency.state.inside())
    }),
    at_most(
        "confirm_sweeps",
        "sweeps until an obstacle of 5 returns has a confirmed track, 95th percentile",
        "",
        |e| {
            let confirming = &e.scores.confirming;
            number(confirming.quantiles().map(|[_, most]| most), confirming.found())
        },
    ),
    at_least("class_10_sweeps_per_cent", "class right after 10 sweeps, median of at least 5 returns", "%", |e| {
        share(e.scores.classes.last(5))
    }),
    at_least("class_10_sweeps_10_returns_per_cent", "the same, of at least 10 returns", "%", |e| {
        share(e.scores.classes.last(10))
    }),
    at_most("size_error_per_cent", "extents off, median, at least 50 returns", "%", |e| {
        let bodies = &e.scores.bodies;
        number(bodies.size_per_cent().map(|[median, _]| median), bodies.sized.count)
    }),
    at_most("spin_error_dps", "spin off, median, 2 s after birth, at least 50 returns", "deg/s", |e| {
        let bodies = &e.scores.bodies;
        number(bodies.spin_dps().map(|[median, ..]| median), bodies.spinning.count)
    }),
    at_least("encounters", "encounters that the collision probability is judged on", "", |e| {
        let of = e.encounters.table().count();
        number(Some(of.into()), of)
    }),
    at_most("collision_calibration_error", "expected calibration error of the collision probability", "", |e| {
        let table = e.encounters.table();
        number(table.expected_calibration_error(), table.count())
    }),
    at_most("encounters_missed", "contacts without a warning, at least 20 returns", "", |e| {
        let missed = e.encounters.missed();
        number((missed.of > 0).then_some(missed.count.into()), missed.of)
    }),
    at_most("miss_distance_error_m", "closest distance of the centre off, median, at least 20 returns", "m", |e| {
        let errors = e.encounters.distance_errors();
        number(errors.map(|([median, _], _)| median), errors.map_or(0, |(_, within)| within.of))
    }),
    at_most("tracker_ms", "time of the tracker a sweep, median, one core", "ms", |e| {
        number(e.time.ms.map(|[median, _]| median), e.time.sweeps)
    }),
    at_least("believed_tracks", "tracks that are believed while it is timed, mean", "", |e| {
        number((e.time.sweeps > 0).then_some(e.time.tracks), e.time.sweeps)
    }),
];

/// The velocity's error so long after a track's birth.
fn aged(evaluation: &TrackEvaluation, age_s: f64) -> Measure {
    let errors = evaluation.scores.errors.velocity_by_age_mps.get(evaluation.sweeps_in(age_s));
    number(errors.and_then(|errors| errors.value()), errors.map_or(0, |errors| errors.count))
}
