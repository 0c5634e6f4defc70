use lidar::MAX_RETURNS;
use serde::Deserialize;

/// Ranges d that are accepted [m]. Below a millimetre a sensor's own quantisation decides; above a kilometre all is one.
const RANGE_D_M: [f32; 2] = [0.001, 1_000.0];

/// `config/stages/clusterer.toml`, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Two returns are joined when their distance is at most this [m].
    pub range_d_m: f32,
    /// How the returns are partitioned; the partition is the same for all.
    pub method: Method,
    /// Smallest number of points for which the cells round a cluster are given.
    pub min_points: u32,
}

/// How the returns are partitioned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The scan window where the sweep is organised and as regular as a sensor's, else the k-d tree.
    Auto,
    /// The scan window wherever it is exact, however irregular the sweep; else the k-d tree.
    Scan,
    /// Always the k-d tree.
    Kdtree,
}

/// Parameters as used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Checked {
    pub(crate) range_d_m: f32,
    pub(crate) method: Method,
    pub(crate) min_points: usize,
}

/// Why the parameters are refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// The range d is no length that the method can work with.
    #[error("range_d_m is {0}, must be {lowest} to {highest}", lowest = RANGE_D_M[0], highest = RANGE_D_M[1])]
    RangeD(f32),
    /// No cluster has fewer than one point, or more than a sweep has returns.
    #[error("min_points is {0}, must be 1 to {MAX_RETURNS}")]
    MinPoints(u32),
}

impl Params {
    pub(crate) fn checked(&self) -> Result<Checked, ParamsError> {
        // False for NaN too.
        if !(RANGE_D_M[0]..=RANGE_D_M[1]).contains(&self.range_d_m) {
            return Err(ParamsError::RangeD(self.range_d_m));
        }
        let min_points = self.min_points as usize;
        if !(1..=MAX_RETURNS).contains(&min_points) {
            return Err(ParamsError::MinPoints(self.min_points));
        }
        Ok(Checked { range_d_m: self.range_d_m, method: self.method, min_points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../../../config/stages/clusterer.toml");

    fn refused(from: &str, to: &str) -> String {
        let text = FILE.replace(from, to);
        assert_ne!(text, FILE);
        match toml::from_str::<Params>(&text) {
            Ok(params) => params.checked().unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_shipped_file_is_accepted() {
        let params: Params = toml::from_str(FILE).unwrap();
        assert_eq!(params.checked(), Ok(Checked { range_d_m: 1.0, method: Method::Auto, min_points: 5 }));
    }

    // verifies CLU-012
    #[test]
    fn each_broken_key_is_refused_by_name() {
        assert_eq!(refused("range_d_m = 1.0", "range_d_m = 0.0"), "range_d_m is 0, must be 0.001 to 1000");
        assert_eq!(refused("range_d_m = 1.0", "range_d_m = nan"), "range_d_m is NaN, must be 0.001 to 1000");
        assert!(refused("range_d_m = 1.0", "range_d_m = inf").contains("range_d_m is inf"));
        assert_eq!(refused("min_points = 5", "min_points = 0"), "min_points is 0, must be 1 to 147456");
        assert!(refused("method = \"auto\"", "method = \"octree\"").contains("unknown variant `octree`"));
        assert!(refused("min_points = 5", "min_points = 5\nrange = 2").contains("unknown field `range`"));
        assert!(refused("min_points = 5", "").contains("missing field `min_points`"));
    }
}
