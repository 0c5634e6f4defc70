use serde::Deserialize;

use crate::MAX_OTHERS;
use crate::fit::{FitParams, FitParamsError, FitSettings};

/// `config/stages/extractor.toml`, as written.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Points of a neighbourhood, the point itself included: k of Eqs. 3 and 4.
    pub neighbours: u32,
    /// Azimuth that neighbouring columns should be apart [deg].
    pub spacing_deg: f64,
    /// Whether clusters get the paper's histogram: what Naive Bayes and the support vector machine judge.
    pub histogram: bool,
    /// Whether solids are fitted to clusters: what the boosted trees judge.
    pub solids: bool,
    /// What is made of clusters under overload.
    pub overload: OverloadParams,
    /// How solids are fitted.
    pub fit: FitParams,
}

/// `[overload]` of `config/stages/extractor.toml`, as written.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverloadParams {
    /// `fit.evaluations` at the step "fewer-starts", where it is the smaller of the two.
    pub evaluations: u64,
    /// Whether clusters get the paper's histogram at the step "paper-features", where no solids are fitted.
    pub histogram: bool,
}

/// Parameters that hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckedParams {
    /// Neighbours of a point, itself not counted: k − 1.
    pub others: usize,
    /// Azimuth that neighbouring columns should be apart [rad].
    pub spacing_rad: f32,
    /// Whether clusters get histograms.
    pub histogram: bool,
    /// How solids are fitted; none where they are not.
    pub fit: Option<FitSettings>,
    /// What is made of clusters under overload.
    pub overload: OverloadParams,
}

/// Why the extractor cannot start.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// Under 3 points no plane is known; over 6 the message could overflow.
    #[error("neighbours is {0}, must be 3 to {max}", max = MAX_OTHERS + 1)]
    Neighbours(u32),
    /// Not a usable angle.
    #[error("spacing_deg is {0}, must be within (0, 10]")]
    Spacing(f64),
    /// Nothing would be described.
    #[error("histogram and solids are both false, one must be true")]
    Nothing,
    /// A budget under overload that is none.
    #[error("overload.evaluations is {0}, must be 1 to 100000000")]
    Overload(u64),
    /// The fit's parameters do not hold.
    #[error(transparent)]
    Fit(#[from] FitParamsError),
}

impl Params {
    /// The parameters as they are used.
    ///
    /// # Errors
    /// The first key whose value is out of range.
    pub fn checked(self) -> Result<CheckedParams, ParamsError> {
        if !(3..=MAX_OTHERS as u32 + 1).contains(&self.neighbours) {
            return Err(ParamsError::Neighbours(self.neighbours));
        }
        if !(self.spacing_deg > 0.0 && self.spacing_deg <= 10.0) {
            return Err(ParamsError::Spacing(self.spacing_deg));
        }
        if !self.histogram && !self.solids {
            return Err(ParamsError::Nothing);
        }
        let fit = self.fit.checked()?;
        if !(1..=100_000_000).contains(&self.overload.evaluations) {
            return Err(ParamsError::Overload(self.overload.evaluations));
        }
        Ok(CheckedParams {
            others: self.neighbours as usize - 1,
            spacing_rad: self.spacing_deg.to_radians() as f32,
            histogram: self.histogram,
            fit: self.solids.then_some(fit),
            overload: self.overload,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../../../config/stages/extractor.toml");

    fn shipped() -> Params {
        toml::from_str(FILE).unwrap()
    }

    /// The shipped file with the value of one key changed; a budget is changed in `[fit]`, and the one under overload is 1.
    fn with(key: &str, value: &str) -> Result<Params, toml::de::Error> {
        let is_key = |line: &&str| line.starts_with(&format!("{key} = "));
        let file = FILE.replacen(FILE.lines().find(|line| line.starts_with("evaluations = ")).unwrap(), "", 1);
        let file = file.replacen("\n[overload]\n", "\n[overload]\nevaluations_ = 1\n", 1);
        let line = file.lines().find(is_key).unwrap().to_owned();
        let file = file.replacen(&line, &format!("{key} = {value}"), 1);
        toml::from_str(&file.replacen("evaluations_", "evaluations", 1))
    }

    fn refused(key: &str, value: &str) -> String {
        with(key, value).unwrap().checked().unwrap_err().to_string()
    }

    #[test]
    fn the_shipped_file_holds() {
        let checked = shipped().checked().unwrap();
        assert_eq!(checked.others, 4);
        assert!(checked.fit.is_some() && !checked.histogram);
    }

    // verifies EXT-026
    #[test]
    fn each_value_out_of_range_is_refused_by_name() {
        let refusals = [
            ("neighbours", "2", "neighbours is 2, must be 3 to 6"),
            ("neighbours", "7", "neighbours is 7, must be 3 to 6"),
            ("spacing_deg", "0.0", "spacing_deg is 0, must be within (0, 10]"),
            ("spacing_deg", "-1.0", "spacing_deg is -1, must be within (0, 10]"),
            ("spacing_deg", "10.1", "spacing_deg is 10.1, must be within (0, 10]"),
            ("spacing_deg", "nan", "spacing_deg is NaN, must be within (0, 10]"),
            ("evaluations", "0", "fit.evaluations is 0, must be 1 to 100000000"),
            ("evaluations", "100000001", "fit.evaluations is 100000001, must be 1 to 100000000"),
            ("scouting_rays", "7", "fit.scouting_rays is 7, must be 8 to 64"),
            ("scouting_rays", "65", "fit.scouting_rays is 65, must be 8 to 64"),
            ("rays", "7", "fit.rays is 7, must be 8 to 4096"),
            ("rays", "4097", "fit.rays is 4097, must be 8 to 4096"),
            ("widest_m", "0.0", "fit.widest_m is 0, must be 0.1 to 100"),
            ("widest_m", "101.0", "fit.widest_m is 101, must be 0.1 to 100"),
            ("range_sigma_m", "0.0", "fit.range_sigma_m is 0, must be 0.0001 to 1"),
            ("range_sigma_m", "nan", "fit.range_sigma_m is NaN, must be 0.0001 to 1"),
            ("range_sigma_m", "1.1", "fit.range_sigma_m is 1.1, must be 0.0001 to 1"),
            ("ln_proportion_sigma", "0.0", "fit.ln_proportion_sigma is 0, must be 0.01 to 100"),
            ("ln_proportion_sigma", "inf", "fit.ln_proportion_sigma is inf, must be 0.01 to 100"),
            ("ln_half_mean", "-11.0", "fit.ln_half_mean is -11, must be -10 to 10"),
            ("ln_half_mean", "11.0", "fit.ln_half_mean is 11, must be -10 to 10"),
            ("ln_half_sigma", "0.0", "fit.ln_half_sigma is 0, must be 0.01 to 100"),
            ("ln_half_sigma", "101.0", "fit.ln_half_sigma is 101, must be 0.01 to 100"),
        ];
        for (key, value, message) in refusals {
            assert_eq!(refused(key, value), message);
        }
    }

    #[test]
    fn the_ends_of_each_range_are_accepted() {
        let accepted = [
            ("neighbours", ["3", "6"]),
            ("spacing_deg", ["0.001", "10.0"]),
            ("evaluations", ["1", "100000000"]),
            ("scouting_rays", ["8", "64"]),
            ("rays", ["8", "4096"]),
            ("widest_m", ["0.1", "100.0"]),
            ("range_sigma_m", ["0.0001", "1.0"]),
            ("ln_proportion_sigma", ["0.01", "100.0"]),
            ("ln_half_mean", ["-10.0", "10.0"]),
            ("ln_half_sigma", ["0.01", "100.0"]),
        ];
        for (key, values) in accepted {
            for value in values {
                assert!(with(key, value).unwrap().checked().is_ok(), "{key} = {value}");
            }
        }
    }

    #[test]
    fn a_budget_under_overload_that_is_none_is_refused() {
        let with = |evaluations| {
            let shipped = shipped();
            Params { overload: OverloadParams { evaluations, ..shipped.overload }, ..shipped }.checked()
        };
        assert!(with(1).is_ok() && with(100_000_000).is_ok());
        for evaluations in [0, 100_000_001] {
            let message = format!("overload.evaluations is {evaluations}, must be 1 to 100000000");
            assert_eq!(with(evaluations).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn a_room_that_would_describe_nothing_is_refused() {
        let refused = Params { histogram: false, solids: false, ..shipped() }.checked().unwrap_err();
        assert_eq!(refused.to_string(), "histogram and solids are both false, one must be true");
        for (histogram, solids) in [(true, false), (false, true), (true, true)] {
            let checked = Params { histogram, solids, ..shipped() }.checked().unwrap();
            assert_eq!((checked.histogram, checked.fit.is_some()), (histogram, solids));
        }
    }

    #[test]
    fn a_bad_fit_is_refused_even_where_no_solids_are_fitted() {
        let mut params = Params { histogram: true, solids: false, ..shipped() };
        params.fit.rays = 0;
        assert!(params.checked().is_err());
    }

    #[test]
    fn an_unknown_or_a_missing_key_is_refused() {
        let outer = FILE.replace("neighbours = 5", "neighbours = 5\nbins = 12");
        let inner = format!("{FILE}starts = 12\n");
        for (file, key) in [(outer, "bins"), (inner, "starts")] {
            assert!(toml::from_str::<Params>(&file).unwrap_err().to_string().contains(key));
        }
        for line in FILE.lines().filter(|line| line.contains(" = ") && !line.starts_with('#')) {
            assert!(toml::from_str::<Params>(&FILE.replacen(line, "", 1)).is_err(), "{line}");
        }
    }
}
