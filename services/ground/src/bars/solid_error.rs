//! How far a fitted solid is off the true one.

use messages::{Solid, TruthObject};
use nalgebra::{Matrix3, Vector3};

/// A normal vector of three components lies within this squared Mahalanobis distance in 95 % of cases (χ², 3 degrees of
/// freedom).
pub(crate) const WITHIN_95: f64 = 7.814_727_903;

/// What is wrong with one solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SolidError {
    /// Distance of the centres [m].
    pub(crate) centre_m: f64,
    /// Mean relative error of the three extents, each list sorted.
    pub(crate) size: f64,
    /// Squared error of the centre by its covariance, 3 on average where that is right; none for a covariance that is none.
    pub(crate) nees: Option<f64>,
}

impl SolidError {
    pub(crate) fn of(solid: &Solid, object: &TruthObject) -> Self {
        let error = Vector3::from_fn(|axis, _| f64::from(solid.centre_m[axis]) - f64::from(object.centre_m[axis]));
        let covariance = Matrix3::from_fn(|row, column| f64::from(solid.covariance_of(row, column)));
        let nees = covariance.cholesky().map(|factors| error.dot(&factors.solve(&error)));
        let [found, actual] = [solid.size_m, object.size_m].map(|mut extents| {
            extents.sort_unstable_by(f32::total_cmp);
            extents.map(f64::from)
        });
        let size = (0..3).map(|axis| (found[axis] / actual[axis] - 1.0).abs()).sum::<f64>() / 3.0;
        Self { centre_m: error.norm(), size, nees }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_of_sorted_extents_and_by_the_covariance() {
        let mut solid = Solid { centre_m: [1.0, 2.0, 3.3], size_m: [2.2, 1.0, 3.0], ..Solid::default() };
        // Variances of the centre: places 0, 9 and 17 of the triangle.
        for (place, variance) in [(0, 0.04), (9, 0.04), (17, 0.09)] {
            solid.covariance[place] = variance;
        }
        let object = TruthObject { centre_m: [1.2, 2.0, 3.0], size_m: [1.0, 3.0, 2.0], ..TruthObject::default() };
        let sut = SolidError::of(&solid, &object);
        assert!((sut.centre_m - 0.13_f64.sqrt()).abs() < 1e-6);
        assert!((sut.size - 0.1 / 3.0).abs() < 1e-6, "2.2 for 2, the others right");
        assert!((sut.nees.unwrap() - 2.0).abs() < 1e-5);
        assert_eq!(SolidError::of(&Solid::default(), &object).nees, None, "no covariance");
    }
}
