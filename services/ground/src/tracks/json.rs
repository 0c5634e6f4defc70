//! The results for machines.

use serde::Serialize;
use serde_json::{Value, json};

use super::classes::{AFTER, LEAST_RETURNS};
use super::consistency::Nees;
use super::errors::RETURNS;
use super::{Followed, HardObstacle, RootMeanSquare, TrackEvaluation, UnknownTracks};
use crate::RunNote;
use crate::bars::json::{bar, reliability, rounded, share};

/// What was evaluated, and what differs from run to run.
#[derive(Clone, Debug, Serialize)]
pub struct TracksNote {
    /// The classifier: method and model.
    pub classifier: String,
    /// The recording, if one was given.
    pub recording: Option<String>,
    /// Plan, machine, duration.
    pub run: RunNote,
}

impl TrackEvaluation {
    /// `tracks.json`: the same for the same plan and rooms, but for `run` and times.
    pub fn to_json(&self, note: &TracksNote) -> String {
        let (scores, hota) = (&self.scores, &self.scores.hota);
        let value = json!({
            "encke": env!("CARGO_PKG_VERSION"),
            "classifier": note.classifier,
            "plan": self.plan,
            "period_s": self.period_s,
            "holds": self.short().is_empty(),
            "bars": self.bars().iter().map(bar).collect::<Vec<_>>(),
            "obstacles": scores.obstacles,
            "tracks": scores.tracks,
            "followed": scores.followed.iter().map(followed).collect::<Vec<_>>(),
            "hota": {
                "hota": hota.hota().map(rounded),
                "detection": hota.detection().map(rounded),
                "association": hota.association().map(rounded),
                "localisation": hota.localisation().map(rounded),
            },
            "hardest": scores.hardest.iter().map(hardest).collect::<Vec<_>>(),
            "errors": self.errors_json(),
            "nees": self.nees_json(),
            "confirming": {
                "sweeps_p50_p95": scores.confirming.quantiles(),
                "found": scores.confirming.found(),
                "never": scores.confirming.never,
            },
            "classes": self.classes_json(),
            "bodies": {
                "size_per_cent_p50_p90": scores.bodies.size_per_cent().map(|both| both.map(rounded)),
                "with_a_size": share(scores.bodies.sized),
                "spin_dps_p50_p90_true": scores.bodies.spin_dps().map(|three| three.map(rounded)),
                "with_a_spin": share(scores.bodies.spinning),
            },
            "encounters": self.encounters_json(),
            "tracker": {
                "ms_p50_p99": self.time.ms.map(|both| both.map(rounded)),
                "sweeps": self.time.sweeps,
                "tracks": rounded(self.time.tracks),
            },
            "run": note.run,
        });
        format!("{value:#}\n")
    }

    fn errors_json(&self) -> Value {
        let errors = &self.scores.errors;
        let rows = RETURNS.iter().enumerate().map(|(row, &[least, most])| {
            json!({
                "from": least,
                "to": (most < u32::MAX).then_some(most),
                "position_m": mean_square(&errors.position_m[row]),
                "velocity_mps": mean_square(&errors.velocity_mps[row]),
            })
        });
        json!({
            "by_returns": rows.collect::<Vec<_>>(),
            "coasting_m": mean_square(&errors.coasting_m),
            "coasting_large_m": mean_square(&errors.coasting_large_m),
            "position_of_50_returns_m_p50_p90_p99": errors.large_quantiles_m().map(|three| three.map(rounded)),
            "position_by_age_m": errors.position_by_age_m.iter().map(mean_square).collect::<Vec<_>>(),
            "velocity_by_age_mps": errors.velocity_by_age_mps.iter().map(mean_square).collect::<Vec<_>>(),
        })
    }

    fn nees_json(&self) -> Value {
        let consistency = &self.scores.consistency;
        json!({
            "state": nees(&consistency.state),
            "position": nees(&consistency.position),
            "velocity": nees(&consistency.velocity),
            "by_sweep": consistency.by_sweep.iter().map(nees).collect::<Vec<_>>(),
            "by_age": consistency.by_age.iter().map(nees).collect::<Vec<_>>(),
        })
    }

    fn classes_json(&self) -> Value {
        let classes = &self.scores.classes;
        let rows = LEAST_RETURNS.iter().zip(&classes.right).map(|(least, row)| {
            json!({ "least_returns": least, "right": row.iter().map(|&right| share(right)).collect::<Vec<_>>() })
        });
        json!({
            "after_sweeps": AFTER,
            "by_returns": rows.collect::<Vec<_>>(),
            "actual_by_predicted": classes.confusion,
            "reliability": reliability(&classes.reliability()),
        })
    }

    fn encounters_json(&self) -> Value {
        let (encounters, table) = (&self.encounters, self.encounters.table());
        let bins = table.bins.iter().map(|bin| {
            json!({
                "count": bin.count,
                "happened": bin.happened,
                "predicted": bin.predicted().map(rounded),
                "interval": bin.interval().map(|ends| ends.map(rounded)),
            })
        });
        let errors = encounters.distance_errors();
        json!({
            "own_radius_m": encounters.danger.own_radius_m,
            "horizon_s": encounters.danger.horizon_s,
            "alert": encounters.danger.alert,
            "count": encounters.all.len(),
            "tracked": share(encounters.tracked()),
            "bins": bins.collect::<Vec<_>>(),
            "expected_calibration_error": table.expected_calibration_error().map(rounded),
            "brier": table.brier().map(rounded),
            "missed": share(encounters.missed()),
            "missed_centres": share(encounters.missed_centres()),
            "false_alerts": share(encounters.false_alerts()),
            "distance_error_m_p50_p90": errors.map(|(both, _)| both.map(rounded)),
            "distance_within_95": errors.map(|(_, within)| share(within)),
        })
    }
}

impl UnknownTracks {
    /// `tracks.json` of a recording: the same for the same recording and rooms, but for `run`.
    pub fn to_json(&self, note: &TracksNote) -> String {
        let six = |values: Option<[f64; 6]>| values.map(|values| values.map(rounded));
        let value = json!({
            "encke": env!("CARGO_PKG_VERSION"),
            "classifier": note.classifier,
            "recording": note.recording,
            "sweeps": self.sweeps,
            "rejected": self.rejected,
            "confirmed": self.confirmed,
            "unconfirmed": self.unconfirmed,
            "length_sweeps_p10_p25_p50_p75_p90_most": six(self.length_sweeps),
            "believed_a_sweep": self.believed,
            "seen": share(self.seen),
            "speed_mps_p10_p25_p50_p75_p90_p99": six(self.speed_mps),
            "speed_of_50_points_mps_p10_p25_p50_p75_p90_p99": six(self.large_speed_mps),
            "births": { "count": self.births.0, "confirmed": self.confirmed_births, "sweeps": self.births.1 },
            "covered": share(self.covered),
            "changed": share(self.changed),
            "run": note.run,
        });
        format!("{value:#}\n")
    }
}

fn followed(row: &Followed) -> Value {
    json!({
        "least_returns": row.least_returns,
        "match_m": row.match_m,
        "objects": row.clear.objects,
        "matched": row.clear.matched,
        "missed": row.clear.missed,
        "false": row.clear.false_tracks,
        "switches": row.clear.switches,
        "mota": row.clear.mota().map(rounded),
        "motp_m": row.clear.motp_m().map(rounded),
        "idf1": row.identity.idf1().map(rounded),
    })
}

fn hardest(one: &HardObstacle) -> Value {
    json!({
        "scene": one.scene,
        "obstacle": one.id,
        "class": one.class.name(),
        "size_m": one.size_m.map(rounded),
        "returns": one.returns,
        "range_m": rounded(one.range_m),
        "sweeps": one.sweeps,
        "missed": one.missed,
        "tracks": one.tracks,
        "off_m": mean_square(&one.off_m),
    })
}

fn mean_square(one: &RootMeanSquare) -> Value {
    json!({ "rmse": one.value().map(rounded), "of": one.count })
}

fn nees(one: &Nees) -> Value {
    json!({ "below": one.below, "inside": one.inside, "above": one.above, "mean": one.mean().map(rounded) })
}
