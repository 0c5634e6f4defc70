use serde::Deserialize;

/// `[spin]`: what the filter believes before it sees anything.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpinParams {
    /// Fewest returns of a cluster whose attitude is believed.
    pub min_points: u32,
    /// Standard deviation of each component of the angular velocity before the first fit [rad/s].
    pub prior_radps: f64,
    /// What each component wanders by in a second [rad/s]; grows with the root of time.
    pub wander_radps: f64,
    /// Least standard deviation of a fitted attitude, about each axis [rad].
    pub floor_rad: f64,
    /// Factor on the variances of fits: errors of one sweep are still there in the next.
    pub inflation: f64,
    /// Further factor on the variances of ellipsoids: their axes are mistaken for one another most easily.
    pub ellipsoid_inflation: f64,
    /// Degrees of freedom of the Student distribution by which a fit counts the less, the farther off it is.
    pub freedom: f64,
    /// Standard deviation about an axis from which on a fit with planes may be taken for one that looks the same [rad]:
    /// what it says about that axis then counts less and less.
    pub blind_rad: f64,
    /// Squared Mahalanobis distance beyond which a fit is a wrong minimum and does not count at all.
    pub gate: f64,
    /// Fits in a row beyond the gate, or of another class, after which the newest is believed.
    pub patience: u32,
    /// Greatest standard deviation of an angular velocity that is called observed [rad/s].
    pub most_sigma_radps: f64,
}
