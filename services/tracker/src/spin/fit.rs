use lidar::ObstacleClass;
use nalgebra::{Matrix3, UnitQuaternion};

use super::SpinParams;

/// What a fit says of the attitude in one sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AttitudeFit {
    /// Time of the fit; any zero, but the same for all of an obstacle [s].
    pub(crate) time_s: f64,
    /// Rotation from the body to the frame in which the angular velocity is wanted.
    pub(crate) attitude: UnitQuaternion<f64>,
    /// Covariance of a small turn after the attitude, about that frame's axes [rad²].
    pub(crate) covariance_rad2: Matrix3<f64>,
    /// What the obstacle was taken for.
    pub(crate) class: ObstacleClass,
    /// Full extents along the body's axes [m].
    pub(crate) size_m: [f64; 3],
    /// Standard deviations of the extents [m].
    pub(crate) size_sigma_m: [f64; 3],
}

/// Whether it is a fit at all: finite, variances not negative.
pub(super) fn is_usable(fit: &AttitudeFit) -> bool {
    let covariance = &fit.covariance_rad2;
    let positive = (0..3).all(|axis| covariance[(axis, axis)] >= 0.0);
    positive && covariance.iter().chain(fit.attitude.coords.iter()).all(|x| x.is_finite()) && fit.time_s.is_finite()
}

/// The noise of an attitude of which the nearest of 24 is taken: about an axis about which it is known no better than
/// `blind_rad` the nearest says nothing (45° are the most it can be off), and its variance is raised accordingly.
pub(super) fn blind(noise: &Matrix3<f64>, blind_rad: f64) -> Matrix3<f64> {
    if noise.trace() < 0.25 * blind_rad * blind_rad {
        return *noise;
    }
    let mut parts = noise.symmetric_eigen();
    for variance in parts.eigenvalues.iter_mut() {
        let ratio = *variance / (blind_rad * blind_rad);
        *variance *= 1.0 + ratio * ratio;
    }
    parts.recompose()
}

/// Covariance of a fitted attitude as the filter believes it.
pub(super) fn noise(fit: &AttitudeFit, params: &SpinParams) -> Matrix3<f64> {
    let smooth = if fit.class == ObstacleClass::Ellipsoidal { params.ellipsoid_inflation } else { 1.0 };
    let symmetric = (fit.covariance_rad2 + fit.covariance_rad2.transpose()) * (0.5 * params.inflation * smooth);
    symmetric + Matrix3::identity() * (params.floor_rad * params.floor_rad)
}
