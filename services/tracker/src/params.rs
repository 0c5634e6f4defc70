use serde::Deserialize;

use crate::spin::SpinParams;

/// `config/stages/tracker.toml`, as written.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// What a new track is given.
    pub birth: BirthParams,
    /// How obstacles move.
    pub motion: MotionParams,
    /// How wrong fitted solids are.
    pub fit: FitParams,
    /// How wrong the mean of the visible returns is.
    pub centroid: CentroidParams,
    /// Which cluster is which track.
    pub association: AssociationParams,
    /// When tracks are believed in, and when given up.
    pub lifecycle: LifecycleParams,
    /// How verdicts of several sweeps add up.
    pub class: ClassParams,
    /// How obstacles spin.
    pub spin: SpinParams,
    /// What is a danger.
    pub danger: DangerParams,
}

/// `[birth]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BirthParams {
    /// Fewest returns of a cluster that a track begins with.
    pub min_points: u32,
    /// Standard deviation of an unknown velocity along each axis [m/s].
    pub velocity_sigma_mps: f64,
    /// Extent of an unknown obstacle along any axis [m].
    pub size_m: f64,
    /// Standard deviation of each [m].
    pub size_sigma_m: f64,
}

/// `[motion]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionParams {
    /// What a velocity may change along each axis in a second [m/s]; grows with the root of time.
    pub velocity_walk_mps: f64,
    /// What an extent may change in a second [m]; grows with the root of time.
    pub size_walk_m: f64,
}

/// `[fit]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitParams {
    /// Times the fit's own covariance.
    pub covariance_scale: f64,
    /// Returns at which that factor is doubled; beyond, it falls with the square of their number.
    pub few_points: f64,
    /// Standard deviation that every fit has beside [m].
    pub sigma_m: f64,
    /// The same of a fit to a single return, as a share of the obstacle's mean half extent; falls with their number.
    pub few_sigma: f64,
    /// How fast a track learns how far its own fits stray, as a share of what the last one strayed, 0 to 1.
    pub stray_gain: f64,
    /// How far fits stray where their covariances hold: squared Mahalanobis distance over its degrees of freedom.
    pub stray_expected: f64,
    /// Degrees of freedom of Student's t, by which fits far from what is expected count less.
    pub degrees_of_freedom: f64,
    /// Squared Mahalanobis distance beyond which a fit has jumped to another minimum.
    pub jump: f64,
    /// Jumps in a row after which it is the track that is wrong, and the fits are believed: at least so many.
    pub patience: u32,
    /// The same as a share of the fits that the track stands on.
    pub patience_share: f64,
    /// Standard deviation of a centre, and of half extents, that were fitted as another class than the obstacle's, as a share
    /// of the half extent.
    pub foreign_sigma: f64,
    /// Fits of a class whose posterior is less tell nothing of attitude.
    pub foreign_posterior: f64,
}

/// `[centroid]`. Lengths are shares of the obstacle's mean half extent.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CentroidParams {
    /// How far behind the mean of many returns the centre is, along the line of sight.
    pub depth: f64,
    /// Standard deviation of the centre about that place.
    pub sigma: f64,
    /// What of it falls with the root of the number of returns.
    pub few_sigma: f64,
    /// Standard deviation where the cluster is only a part of the obstacle, or more than it.
    pub torn_sigma: f64,
    /// Means of returns are used only where their variance is less than so many times that of the track.
    pub worth: f64,
}

/// `[association]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssociationParams {
    /// Squared Mahalanobis distance beyond which no cluster is the track's.
    pub gate: f64,
    /// How far outside a body a cluster's mean may be to be a piece of it [m].
    pub margin_m: f64,
}

/// `[lifecycle]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LifecycleParams {
    /// Sweeps of the last `confirm_sweeps` in which a track must be seen to be confirmed: M.
    pub confirm_hits: u32,
    /// N.
    pub confirm_sweeps: u32,
    /// Sweeps in a row in which a confirmed track was missed where it should have been seen: then it is given up.
    pub lost_misses: u32,
    /// Time unseen, hidden or not, after which a track is given up [s].
    pub unseen_s: f64,
    /// Standard deviation of a place along its worst axis at which a track that is not seen is given up [m].
    pub lost_sigma_m: f64,
    /// A longer step between two sweeps is one of the sensor's clock: all tracks begin anew [s].
    pub gap_s: f64,
    /// How long after its time a table may be acted on, at most [s].
    pub valid_s: f64,
}

/// `[class]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassParams {
    /// What each sweep after the first counts beside that one, 0 to 1: sweeps see nearly the same.
    pub fresh_share: f64,
    /// What is left of earlier sweeps' evidence after each sweep, 0 to 1.
    pub kept: f64,
    /// Least posterior that is believed of a single sweep.
    pub floor: f64,
}

/// `[danger]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DangerParams {
    /// Radius round the sensor that nothing may touch [m].
    pub own_radius_m: f64,
    /// How far ahead is looked [s].
    pub horizon_s: f64,
    /// Probability of being touched within the horizon from which a track is an alert, 0 to 1.
    pub alert_probability: f64,
    /// Age from which on a track can be an alert [sweeps]; 1 from its birth on.
    pub alert_age_sweeps: u32,
}

/// Why the tracker cannot start.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// A number that is no such number.
    #[error("{key} is {value}, must be {lowest} to {highest}")]
    Range {
        /// Table and key.
        key: &'static str,
        /// As written.
        value: f64,
        /// Least that is accepted.
        lowest: f64,
        /// Most that is accepted.
        highest: f64,
    },
    /// More hits than sweeps.
    #[error("lifecycle.confirm_hits is {hits}, must be at most confirm_sweeps, {sweeps}")]
    Confirm {
        /// M.
        hits: u32,
        /// N.
        sweeps: u32,
    },
}

impl Params {
    /// The parameters, all within their ranges.
    ///
    /// # Errors
    /// The first key whose value is not.
    pub fn checked(self) -> Result<Self, ParamsError> {
        for (key, value, lowest, highest) in self.ranges() {
            // False for NaN too.
            if !(lowest..=highest).contains(&value) {
                return Err(ParamsError::Range { key, value, lowest, highest });
            }
        }
        let LifecycleParams { confirm_hits: hits, confirm_sweeps: sweeps, .. } = self.lifecycle;
        if hits > sweeps {
            return Err(ParamsError::Confirm { hits, sweeps });
        }
        Ok(self)
    }

    /// Each key with its value and the range that it must be in.
    fn ranges(&self) -> [(&'static str, f64, f64, f64); 50] {
        let Self { birth, motion, fit, centroid, association, lifecycle, class, spin, danger } = self;
        [
            ("birth.min_points", f64::from(birth.min_points), 1.0, 1e5),
            ("birth.velocity_sigma_mps", birth.velocity_sigma_mps, 1e-3, 1e4),
            ("birth.size_m", birth.size_m, 0.01, 100.0),
            ("birth.size_sigma_m", birth.size_sigma_m, 0.01, 100.0),
            ("motion.velocity_walk_mps", motion.velocity_walk_mps, 0.0, 1e3),
            ("motion.size_walk_m", motion.size_walk_m, 0.0, 10.0),
            ("fit.covariance_scale", fit.covariance_scale, 0.01, 100.0),
            ("fit.few_points", fit.few_points, 0.0, 1e5),
            ("fit.sigma_m", fit.sigma_m, 1e-3, 10.0),
            ("fit.few_sigma", fit.few_sigma, 0.0, 100.0),
            ("fit.stray_gain", fit.stray_gain, 0.0, 1.0),
            ("fit.stray_expected", fit.stray_expected, 0.01, 100.0),
            ("fit.patience", f64::from(fit.patience), 1.0, 1e6),
            ("fit.patience_share", fit.patience_share, 0.0, 1e6),
            ("centroid.worth", centroid.worth, 0.0, 1e6),
            ("fit.degrees_of_freedom", fit.degrees_of_freedom, 1.0, 1e6),
            ("fit.jump", fit.jump, 1.0, 1e6),
            ("fit.foreign_sigma", fit.foreign_sigma, 0.0, 10.0),
            ("fit.foreign_posterior", fit.foreign_posterior, 0.0, 1.0),
            ("centroid.depth", centroid.depth, 0.0, 1.0),
            ("centroid.sigma", centroid.sigma, 0.01, 10.0),
            ("centroid.few_sigma", centroid.few_sigma, 0.0, 10.0),
            ("centroid.torn_sigma", centroid.torn_sigma, 0.01, 10.0),
            ("association.gate", association.gate, 1.0, 1e3),
            ("association.margin_m", association.margin_m, 0.0, 10.0),
            ("lifecycle.confirm_hits", f64::from(lifecycle.confirm_hits), 1.0, 32.0),
            ("lifecycle.confirm_sweeps", f64::from(lifecycle.confirm_sweeps), 1.0, 32.0),
            ("lifecycle.lost_misses", f64::from(lifecycle.lost_misses), 1.0, 1e6),
            ("lifecycle.unseen_s", lifecycle.unseen_s, 1e-3, 1e4),
            ("lifecycle.lost_sigma_m", lifecycle.lost_sigma_m, 0.01, 100.0),
            ("lifecycle.gap_s", lifecycle.gap_s, 1e-3, 1e3),
            ("lifecycle.valid_s", lifecycle.valid_s, 0.0, 1e3),
            ("class.fresh_share", class.fresh_share, 0.0, 1.0),
            ("class.kept", class.kept, 0.0, 1.0),
            ("class.floor", class.floor, 1e-9, 0.25),
            ("spin.min_points", f64::from(spin.min_points), 1.0, 1e5),
            ("spin.prior_radps", spin.prior_radps, 1e-3, 100.0),
            ("spin.wander_radps", spin.wander_radps, 1e-6, 100.0),
            ("spin.floor_rad", spin.floor_rad, 1e-4, 1.0),
            ("spin.inflation", spin.inflation, 0.01, 100.0),
            ("spin.ellipsoid_inflation", spin.ellipsoid_inflation, 0.01, 100.0),
            ("spin.freedom", spin.freedom, 1.0, 1e6),
            ("spin.blind_rad", spin.blind_rad, 1e-3, 1.0),
            ("spin.gate", spin.gate, 1.0, 1e6),
            ("spin.patience", f64::from(spin.patience), 1.0, 1e6),
            ("spin.most_sigma_radps", spin.most_sigma_radps, 1e-3, 100.0),
            ("danger.own_radius_m", danger.own_radius_m, 0.0, 1e3),
            ("danger.horizon_s", danger.horizon_s, 0.0, 1e4),
            ("danger.alert_probability", danger.alert_probability, 0.0, 1.0),
            ("danger.alert_age_sweeps", f64::from(danger.alert_age_sweeps), 1.0, 1e6),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../../../config/stages/tracker.toml");

    fn keys() -> Vec<String> {
        let table: toml::Table = FILE.parse().unwrap();
        let names = |(table, keys): (&String, &toml::Value)| {
            keys.as_table().unwrap().keys().map(|key| format!("{table}.{key}")).collect::<Vec<_>>()
        };
        table.iter().flat_map(names).collect()
    }

    fn with(key: &str, value: toml::Value) -> Result<Params, String> {
        let mut file: toml::Table = FILE.parse().unwrap();
        let (table, key) = key.split_once('.').unwrap();
        file[table].as_table_mut().unwrap().insert(key.to_owned(), value);
        let params: Params = file.try_into().map_err(|error: toml::de::Error| error.to_string())?;
        params.checked().map_err(|error| error.to_string())
    }

    #[test]
    fn the_shipped_file_holds_and_has_a_range_for_every_key() {
        let params: Params = toml::from_str(FILE).unwrap();
        let checked = params.checked().unwrap();
        for key in keys() {
            assert!(checked.ranges().iter().any(|range| range.0 == key), "{key}");
        }
        assert_eq!((checked.lifecycle.confirm_hits, checked.lifecycle.confirm_sweeps), (3, 5));
    }

    // verifies TRA-020
    #[test]
    fn each_value_out_of_range_is_refused_by_name() {
        for key in keys() {
            let whole = ["min_points", "confirm_hits", "confirm_sweeps", "lost_misses", "patience", "alert_age_sweeps"]
                .iter()
                .any(|end| key.ends_with(end));
            let bad = match whole {
                true => vec![toml::Value::Integer(0), toml::Value::Integer(4_000_000_000)],
                false => [-1.0, 1e9, f64::NAN].map(toml::Value::Float).to_vec(),
            };
            for value in bad {
                let refused = with(&key, value).unwrap_err();
                assert!(refused.starts_with(&format!("{key} is ")), "{refused}");
            }
        }
    }

    #[test]
    fn more_hits_than_sweeps_are_refused() {
        let refused = with("lifecycle.confirm_hits", toml::Value::Integer(6)).unwrap_err();
        assert_eq!(refused, "lifecycle.confirm_hits is 6, must be at most confirm_sweeps, 5");
    }

    #[test]
    fn an_unknown_or_a_missing_key_is_refused() {
        for line in FILE.lines().filter(|line| line.contains(" = ") && !line.starts_with('#')) {
            assert!(toml::from_str::<Params>(&FILE.replacen(line, "", 1)).is_err(), "{line}");
            assert!(toml::from_str::<Params>(&FILE.replacen(line, &format!("{line}\nodd = 1"), 1)).is_err(), "{line}");
        }
    }
}
