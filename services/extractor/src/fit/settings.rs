use serde::Deserialize;

use super::frames::MOST_POINTS;

/// `[fit]` of `config/stages/extractor.toml`, as written.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitParams {
    /// Residuals that may be evaluated for one cluster.
    pub evaluations: u64,
    /// Most hits, and most misses, that starts are scouted on.
    pub scouting_rays: usize,
    /// Most hits, and most misses, that bodies are fitted to.
    pub rays: usize,
    /// Clusters wider than this along x, y or z are not fitted [m].
    pub widest_m: f32,
    /// Least standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// Standard deviation of ln of a half extent about the mean of all three.
    pub ln_proportion_sigma: f64,
    /// Mean of the mean of ln of the half extents, ln m.
    pub ln_half_mean: f64,
    /// Standard deviation of that mean.
    pub ln_half_sigma: f64,
}

/// What is believed of a body before any ray has met it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beliefs {
    /// Standard deviation of ln of a half extent about the mean of all three.
    pub ln_proportion_sigma: f64,
    /// Mean of the mean of ln of the half extents, ln m.
    pub ln_half_mean: f64,
    /// Standard deviation of that mean.
    pub ln_half_sigma: f64,
}

/// How solids are fitted: parameters that hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// Residuals that may be evaluated for one cluster; what every solid is owed may exceed them.
    pub evaluations: u64,
    /// Most hits, and most misses, that starts are scouted on.
    pub scouting_rays: usize,
    /// Most hits, and most misses, that bodies are fitted to.
    pub rays: usize,
    /// Clusters wider than this along x, y or z are not fitted [m].
    pub widest_m: f32,
    /// Least standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// What is believed of a body before any ray has met it.
    pub beliefs: Beliefs,
}

/// Why the parameters of a fit are refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitParamsError {
    /// A number is out of its range.
    #[error("fit.{key} is {value}, must be {expected}")]
    Number {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
}

impl FitParams {
    /// The settings that these parameters make.
    ///
    /// # Errors
    /// The first key whose value is out of range.
    pub fn checked(self) -> Result<FitSettings, FitParamsError> {
        let within = |key, value: f64, least: f64, most: f64, expected| {
            if (least..=most).contains(&value) { Ok(()) } else { Err(FitParamsError::Number { key, value, expected }) }
        };
        within("evaluations", self.evaluations as f64, 1.0, 1e8, "1 to 100000000")?;
        // Frames are found from all of these, and from no more than `MOST_POINTS`.
        within("scouting_rays", self.scouting_rays as f64, 8.0, MOST_POINTS as f64, "8 to 64")?;
        within("rays", self.rays as f64, 8.0, 4_096.0, "8 to 4096")?;
        within("widest_m", f64::from(self.widest_m), 0.1, 100.0, "0.1 to 100")?;
        within("range_sigma_m", self.range_sigma_m, 1e-4, 1.0, "0.0001 to 1")?;
        within("ln_proportion_sigma", self.ln_proportion_sigma, 0.01, 100.0, "0.01 to 100")?;
        within("ln_half_mean", self.ln_half_mean, -10.0, 10.0, "-10 to 10")?;
        within("ln_half_sigma", self.ln_half_sigma, 0.01, 100.0, "0.01 to 100")?;
        Ok(FitSettings {
            evaluations: self.evaluations,
            scouting_rays: self.scouting_rays,
            rays: self.rays,
            widest_m: self.widest_m,
            range_sigma_m: self.range_sigma_m,
            beliefs: Beliefs {
                ln_proportion_sigma: self.ln_proportion_sigma,
                ln_half_mean: self.ln_half_mean,
                ln_half_sigma: self.ln_half_sigma,
            },
        })
    }
}
