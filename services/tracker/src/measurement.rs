use lidar::ObstacleClass;
use messages::{SOLID_PARAMETERS, Solid};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::filter::Measured;
use crate::params::{CentroidParams, FitParams};
use crate::sighting::Sighting;

/// Standard deviation that stands for "not measured" [m]. No more, so that sums with millimetres stay exact.
pub(crate) const UNKNOWN_M: f64 = 100.0;
/// Least variance of the new part of an error [m²]: a millimetre.
const LEAST_M2: f64 = 1e-6;

/// Places of centre and size among a solid's parameters.
const PLACES: [usize; 6] = [0, 1, 2, 6, 7, 8];

/// A body axis of each extent, longest extent first.
pub(crate) type AxisOrder = [usize; 3];

/// Axes of a solid from the longest extent to the shortest; of equals the first.
pub(crate) fn axis_order(size_m: &[f32; 3]) -> AxisOrder {
    let mut order = [0, 1, 2];
    // Three items are sorted in place.
    order.sort_by(|&a, &b| size_m[b].total_cmp(&size_m[a]));
    order
}

/// What a fitted solid measures: its centre in the tracks' frame, and its extents from the longest to the shortest.
///
/// The fit's own covariance, scaled, and a floor that grows with the obstacle. A covariance without a root counts as its
/// diagonal.
pub(crate) fn of_solid(solid: &Solid, sighting: &Sighting, half_m: f64, params: &FitParams) -> Measured {
    let order = axis_order(&solid.size_m);
    let places = PLACES.map(|place| if place < 3 { place } else { 6 + order[place - 6] });
    debug_assert!(places.iter().all(|&place| place < SOLID_PARAMETERS));
    let bounded = |value: f32| f64::from(value).clamp(-UNKNOWN_M * UNKNOWN_M, UNKNOWN_M * UNKNOWN_M);
    let own = Matrix6::from_fn(|row, column| bounded(solid.covariance_of(places[row], places[column])));
    let floor = (params.sigma_m.powi(2) + (params.relative_sigma * half_m).powi(2)).max(LEAST_M2);
    let floor = Matrix6::from_diagonal_element(floor);
    let mut covariance = own * params.covariance_scale + floor;
    if covariance.cholesky().is_none() {
        let diagonal = own.diagonal().map(|variance| variance.max(0.0));
        covariance = Matrix6::from_diagonal(&diagonal) * params.covariance_scale + floor;
    }
    // Centre turned into the tracks' frame; extents are the body's own.
    let mut turn = Matrix6::identity();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(sighting.pose.attitude.to_rotation_matrix().matrix());
    let covariance = turn * covariance * turn.transpose();
    let covariance = (covariance + covariance.transpose()) * 0.5;
    let centre = sighting.pose.place(&Vector3::from(solid.centre_m).cast());
    let extent = |place: usize| f64::from(solid.size_m[order[place]]);
    Measured {
        value: Vector6::new(centre.x, centre.y, centre.z, extent(0), extent(1), extent(2)),
        sized: true,
        slow: covariance * params.slow_share,
        white: covariance * (1.0 - params.slow_share),
    }
}

/// A solid of another class than the obstacle's: its centre is one of the right body only roughly, its extents are none.
pub(crate) fn as_foreign(measured: &mut Measured, half_m: f64, params: &FitParams) {
    let variance = (params.foreign_sigma * half_m).powi(2);
    for axis in 0..3 {
        measured.slow[(axis, axis)] += variance * params.slow_share;
        measured.white[(axis, axis)] += variance * (1.0 - params.slow_share);
    }
    unsize(measured);
}

/// What the mean of the visible returns measures: the centre lies behind it, along the line of sight, by a share of the
/// obstacle's half extent, and strays by another. `torn`: the cluster is a part of the obstacle, or more than it.
pub(crate) fn of_centroid(
    sighting: &Sighting,
    half_m: f64,
    half_sigma_m: f64,
    torn: bool,
    params: &CentroidParams,
) -> Measured {
    let depth = depth(sighting.points, params);
    let centre = sighting.centroid_m + sighting.line_of_sight * (depth * half_m);
    let half_m = if torn { half_m.max(sighting.half_width_m) } else { half_m };
    let along = sighting.line_of_sight * sighting.line_of_sight.transpose() * (depth * half_sigma_m).powi(2);
    let covariance = Matrix3::identity() * spread(sighting.points, half_m, torn, params) + along;
    let mut measured = Measured {
        value: Vector6::new(centre.x, centre.y, centre.z, 0.0, 0.0, 0.0),
        sized: false,
        slow: Matrix6::identity() * LEAST_M2,
        white: Matrix6::zeros(),
    };
    measured.slow.fixed_view_mut::<3, 3>(0, 0).copy_from(&(covariance * params.slow_share));
    measured.white.fixed_view_mut::<3, 3>(0, 0).copy_from(&(covariance * (1.0 - params.slow_share)));
    unsize(&mut measured);
    measured
}

/// How far behind the mean of some returns the centre is, in half extents: a single return may be anywhere.
pub(crate) fn depth(points: f64, params: &CentroidParams) -> f64 {
    params.depth * (1.0 - 1.0 / points.max(1.0))
}

/// Variance of the centre about that place, along each axis [m²].
pub(crate) fn spread(points: f64, half_m: f64, torn: bool, params: &CentroidParams) -> f64 {
    let torn = if torn { params.torn_sigma * params.torn_sigma } else { 0.0 };
    let share = params.sigma * params.sigma + params.few_sigma * params.few_sigma / points.max(1.0) + torn;
    (share * half_m * half_m).max(LEAST_M2)
}

/// Adds what an unknown time makes of a known velocity.
pub(crate) fn blur(measured: &mut Measured, velocity: &Vector3<f64>, uncertain: &Matrix3<f64>, sigma_s: f64) {
    let moved = (velocity * velocity.transpose() + uncertain) * (sigma_s * sigma_s);
    let mut white = measured.white.fixed_view_mut::<3, 3>(0, 0);
    white += moved;
}

/// Leaves the extents out.
fn unsize(measured: &mut Measured) {
    measured.sized = false;
    for place in 3..6 {
        for other in 0..6 {
            for matrix in [&mut measured.slow, &mut measured.white] {
                matrix[(place, other)] = 0.0;
                matrix[(other, place)] = 0.0;
            }
        }
        measured.slow[(place, place)] = LEAST_M2;
        measured.white[(place, place)] = UNKNOWN_M * UNKNOWN_M;
    }
}

/// Which error a measurement has: of a solid of that class, or, for `Unclassified`, of a centroid.
pub(crate) type Kind = ObstacleClass;

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Detection, EgoMotion, SweepHeader};

    use super::*;
    use crate::frame::Frame;
    use crate::params::Params;

    fn params() -> Params {
        toml::from_str(include_str!("../../../config/stages/tracker.toml")).unwrap()
    }

    fn sighting(points: u32, ego: &EgoMotion) -> Sighting {
        let summary = ClusterSummary { points, rings: 1, centroid_m: [10.0, 0.0, 0.0], ..ClusterSummary::default() };
        let detection = Detection { summary, ..Detection::default() };
        Sighting::new(0, &detection, &SweepHeader::default(), &Frame::new(0, ego))
    }

    fn solid() -> Solid {
        let mut solid = Solid { centre_m: [11.0, 0.0, 0.0], size_m: [1.0, 3.0, 2.0], ..Solid::default() };
        for row in 0..9 {
            for column in row..9 {
                let value = if row == column { 0.01 * (row + 1) as f32 } else { 1e-4 * (row * 10 + column) as f32 };
                solid.covariance[row * 9 - row * (row + 1) / 2 + column] = value;
            }
        }
        solid
    }

    #[test]
    fn extents_are_measured_from_the_longest_to_the_shortest_with_their_own_covariances() {
        let params = params().fit;
        let measured = of_solid(&solid(), &sighting(9, &EgoMotion::default()), 1.0, &params);
        assert_eq!(measured.value, Vector6::new(11.0, 0.0, 0.0, 3.0, 2.0, 1.0));
        let whole = measured.slow + measured.white;
        let floor = params.sigma_m.powi(2) + params.relative_sigma.powi(2);
        // Extents y, z, x are parameters 7, 8, 6.
        for (place, parameter) in [(3, 7), (4, 8), (5, 6)] {
            let own = f64::from(solid().covariance_of(parameter, parameter));
            assert!((whole[(place, place)] - own * params.covariance_scale - floor).abs() < 1e-9);
        }
        let mixed = f64::from(solid().covariance_of(0, 7)) * params.covariance_scale;
        assert!((whole[(0, 3)] - mixed).abs() < 1e-9 && (whole[(3, 0)] - mixed).abs() < 1e-9);
    }

    #[test]
    fn a_centre_and_its_covariance_turn_with_the_sensor() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // A quarter turn about z: the sensor's x is the frame's y.
        let ego = EgoMotion { attitude_wxyz: [half, 0.0, 0.0, half], known: 1, ..EgoMotion::default() };
        let params = params().fit;
        let level = of_solid(&solid(), &sighting(9, &EgoMotion::default()), 1.0, &params);
        let turned = of_solid(&solid(), &sighting(9, &ego), 1.0, &params);
        assert!((turned.value.fixed_rows::<3>(0) - Vector3::new(0.0, 11.0, 0.0)).norm() < 1e-9);
        assert!((turned.white[(1, 1)] - level.white[(0, 0)]).abs() < 1e-9);
        assert!((turned.white[(1, 4)] - level.white[(0, 4)]).abs() < 1e-9);
    }

    #[test]
    fn a_covariance_that_is_none_is_measured_all_the_same() {
        let odd = [[0.0; 45], [-1.0; 45], [1e30; 45], std::array::from_fn(|place| if place == 1 { 5.0 } else { 0.0 })];
        for covariance in odd {
            let measured =
                of_solid(&Solid { covariance, ..solid() }, &sighting(9, &EgoMotion::default()), 1.0, &params().fit);
            assert!(measured.white.cholesky().is_some(), "{covariance:?}");
        }
    }

    // verifies TRA-005
    #[test]
    fn a_centre_is_expected_behind_what_is_visible_of_it() {
        let params = params().centroid;
        let many = of_centroid(&sighting(1_000, &EgoMotion::default()), 2.0, 0.0, false, &params);
        assert!((many.value.x - (10.0 + 2.0 * params.depth)).abs() < 0.01);
        assert_eq!((many.value.y, many.value.z, many.sized), (0.0, 0.0, false));
        let one = of_centroid(&sighting(1, &EgoMotion::default()), 2.0, 0.0, false, &params);
        assert_eq!(one.value.x, 10.0);
        assert!(one.white[(0, 0)] > many.white[(0, 0)]);
        let torn = of_centroid(&sighting(1_000, &EgoMotion::default()), 2.0, 0.0, true, &params);
        assert!(torn.white[(1, 1)] > many.white[(1, 1)]);
    }

    #[test]
    fn an_unknown_size_is_unknown_along_the_line_of_sight_alone() {
        let params = params().centroid;
        let sure = of_centroid(&sighting(100, &EgoMotion::default()), 1.0, 0.0, false, &params);
        let unsure = of_centroid(&sighting(100, &EgoMotion::default()), 1.0, 0.5, false, &params);
        assert!(unsure.white[(0, 0)] > sure.white[(0, 0)]);
        assert_eq!(unsure.white[(1, 1)], sure.white[(1, 1)]);
    }

    #[test]
    fn a_foreign_solid_tells_no_extents_and_its_centre_roughly() {
        let params = params();
        let mut measured = of_solid(&solid(), &sighting(9, &EgoMotion::default()), 1.0, &params.fit);
        let before = measured.white[(0, 0)];
        as_foreign(&mut measured, 1.0, &params.fit);
        assert!(!measured.sized && measured.white[(0, 0)] > before && measured.white[(0, 3)] == 0.0);
    }
}
