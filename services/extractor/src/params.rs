use serde::Deserialize;

use crate::MAX_OTHERS;

/// `config/stages/extractor.toml`, as written.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Points of a neighbourhood, the point itself included: k of Eqs. 3 and 4.
    pub neighbours: u32,
    /// Azimuth that neighbouring columns should be apart [deg].
    pub spacing_deg: f64,
}

/// Parameters that hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckedParams {
    /// Neighbours of a point, itself not counted: k − 1.
    pub others: usize,
    /// Azimuth that neighbouring columns should be apart [rad].
    pub spacing_rad: f32,
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
        Ok(CheckedParams { others: self.neighbours as usize - 1, spacing_rad: self.spacing_deg.to_radians() as f32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds() {
        let file = include_str!("../../../config/stages/extractor.toml");
        let params: Params = toml::from_str(file).unwrap();
        assert_eq!(params.checked().unwrap().others, 4);
    }

    #[test]
    fn each_value_out_of_range_is_refused_by_name() {
        let good = Params { neighbours: 5, spacing_deg: 0.72 };
        for neighbours in [0, 2, 7, u32::MAX] {
            let refused = Params { neighbours, ..good }.checked().unwrap_err();
            assert!(refused.to_string().starts_with(&format!("neighbours is {neighbours}, must be 3 to 6")));
        }
        for spacing_deg in [0.0, -1.0, 10.1, f64::NAN] {
            let refused = Params { spacing_deg, ..good }.checked().unwrap_err();
            assert!(refused.to_string().contains("spacing_deg is"), "{refused}");
        }
        assert!(Params { neighbours: 3, ..good }.checked().is_ok());
        assert!(Params { neighbours: 6, ..good }.checked().is_ok());
    }

    #[test]
    fn an_unknown_key_is_refused() {
        let refused = toml::from_str::<Params>("neighbours = 5\nspacing_deg = 0.72\nbins = 12\n").unwrap_err();
        assert!(refused.to_string().contains("bins"));
    }
}
