use messages::{SOLID_PARAMETERS, Solid};
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use crate::filter::Measured;
use crate::params::{CentroidParams, FitParams};
use crate::sighting::Sighting;

/// Standard deviation that stands for "not measured" [m]. No more, so that sums with millimetres stay exact.
pub(crate) const UNKNOWN_M: f64 = 100.0;
/// Least variance of the new part of an error [m²]: a millimetre.
const LEAST_M2: f64 = 1e-6;

/// Places of centre and size among a solid's parameters.
const PLACES: [usize; 6] = [0, 1, 2, 6, 7, 8];

/// Which body axis of a solid each of the track's extents is along.
pub(crate) type AxisOrder = [usize; 3];

const ORDERS: [AxisOrder; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Names the axes of a solid as the track does: those that lie nearest to where the track's axes lay. Two fits of a body
/// may name its axes differently.
pub(crate) fn axis_order(attitude: &UnitQuaternion<f64>, axes: Option<&Matrix3<f64>>) -> AxisOrder {
    let Some(axes) = axes else { return ORDERS[0] };
    let along = axes.transpose() * attitude.to_rotation_matrix().matrix();
    let agreement = |order: &AxisOrder| (0..3).map(|axis| along[(axis, order[axis])].abs()).sum::<f64>();
    let best = ORDERS.iter().max_by(|a, b| agreement(a).total_cmp(&agreement(b)));
    best.copied().unwrap_or(ORDERS[0])
}

/// What a fitted solid measures: its centre in the tracks' frame, and its extents in the order of the track's axes.
///
/// The fit's own covariance, scaled, and a floor that falls with the number of returns; all of it times `stray`, which the
/// track has learned. A covariance without a root counts as its diagonal.
pub(crate) fn of_solid(
    solid: &Solid,
    order: &AxisOrder,
    sighting: &Sighting,
    half_m: f64,
    stray: f64,
    params: &FitParams,
) -> Measured {
    let places = PLACES.map(|place| if place < 3 { place } else { 6 + order[place - 6] });
    debug_assert!(places.iter().all(|&place| place < SOLID_PARAMETERS));
    let bounded = |value: f32| f64::from(value).clamp(-UNKNOWN_M * UNKNOWN_M, UNKNOWN_M * UNKNOWN_M);
    let own = Matrix6::from_fn(|row, column| bounded(solid.covariance_of(places[row], places[column])));
    let floor = (params.sigma_m.powi(2) + (params.few_sigma * half_m / sighting.points.max(1.0)).powi(2)).max(LEAST_M2);
    let floor = Matrix6::from_diagonal_element(floor);
    let scale = params.covariance_scale * (1.0 + (params.few_points / sighting.points.max(1.0)).powi(2));
    let mut covariance = own * scale + floor;
    if covariance.cholesky().is_none() {
        let diagonal = own.diagonal().map(|variance| variance.max(0.0));
        covariance = Matrix6::from_diagonal(&diagonal) * scale + floor;
    }
    // Centre turned into the tracks' frame; extents are the body's own.
    let mut turn = Matrix6::identity();
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(sighting.pose.attitude.to_rotation_matrix().matrix());
    let covariance = turn * covariance * turn.transpose() * stray;
    let centre = sighting.pose.place(&Vector3::from(solid.centre_m).cast());
    let extent = |place: usize| f64::from(solid.size_m[order[place]]);
    Measured {
        value: Vector6::new(centre.x, centre.y, centre.z, extent(0), extent(1), extent(2)),
        sized: true,
        covariance: (covariance + covariance.transpose()) * 0.5,
    }
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
    let place = Matrix3::identity() * spread(sighting.points, half_m, torn, params) + along;
    Measured::of_place(&centre, &place)
}

impl Measured {
    /// A centre and its covariance, and nothing of the extents.
    fn of_place(centre: &Vector3<f64>, place: &Matrix3<f64>) -> Self {
        let mut covariance = Matrix6::from_diagonal_element(UNKNOWN_M * UNKNOWN_M);
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(place);
        Self { value: Vector6::new(centre.x, centre.y, centre.z, 0.0, 0.0, 0.0), sized: false, covariance }
    }

    /// A solid of a class that the obstacle has with this probability only: one of another class is off by a share of the
    /// half extent, and so are its extents.
    pub(crate) fn doubted(mut self, probability: f64, half_m: f64, params: &FitParams) -> Self {
        let variance = (params.foreign_sigma * half_m).powi(2) * (1.0 - probability);
        for place in 0..6 {
            self.covariance[(place, place)] += if place < 3 { variance } else { 4.0 * variance };
        }
        self
    }

    /// Variance of the centre, over all axes [m²].
    pub(crate) fn place_m2(&self) -> f64 {
        self.covariance.fixed_view::<3, 3>(0, 0).trace()
    }
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
    let mut place = measured.covariance.fixed_view_mut::<3, 3>(0, 0);
    place += moved;
}

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
    fn extents_are_measured_in_the_order_of_the_tracks_axes_with_their_own_covariances() {
        let params = params().fit;
        let measured = of_solid(&solid(), &[1, 2, 0], &sighting(9, &EgoMotion::default()), 1.0, 1.0, &params);
        assert_eq!(measured.value, Vector6::new(11.0, 0.0, 0.0, 3.0, 2.0, 1.0));
        let floor = params.sigma_m.powi(2) + (params.few_sigma / 9.0).powi(2);
        let scale = params.covariance_scale * (1.0 + (params.few_points / 9.0).powi(2));
        // Extents y, z, x are parameters 7, 8, 6.
        for (place, parameter) in [(3, 7), (4, 8), (5, 6)] {
            let own = f64::from(solid().covariance_of(parameter, parameter)) * scale;
            assert!((measured.covariance[(place, place)] - own - floor).abs() < 1e-6);
        }
        let mixed = f64::from(solid().covariance_of(0, 7)) * scale;
        assert!((measured.covariance[(0, 3)] - mixed).abs() < 1e-9);
    }

    // verifies TRA-025
    #[test]
    fn axes_keep_their_names_whatever_a_fit_calls_them() {
        let attitude = UnitQuaternion::from_euler_angles(0.3, -0.5, 1.0);
        let axes = *attitude.to_rotation_matrix().matrix();
        assert_eq!(axis_order(&attitude, None), [0, 1, 2]);
        // A turn of 5°, and the axes named x → y → z → x.
        let small = UnitQuaternion::from_scaled_axis(Vector3::new(0.05, 0.05, -0.05));
        let cyclic = UnitQuaternion::from_scaled_axis(Vector3::repeat(std::f64::consts::TAU / 3.0 / 3.0_f64.sqrt()));
        let named = small * attitude * cyclic;
        let order = axis_order(&named, Some(&axes));
        for axis in 0..3 {
            let found = named.to_rotation_matrix().matrix().column(order[axis]).dot(&axes.column(axis));
            assert!(found.abs() > 0.9, "{order:?}");
        }
    }

    #[test]
    fn a_centre_and_its_covariance_turn_with_the_sensor() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // A quarter turn about z: the sensor's x is the frame's y.
        let ego = EgoMotion { attitude_wxyz: [half, 0.0, 0.0, half], known: 1, ..EgoMotion::default() };
        let params = params().fit;
        let level = of_solid(&solid(), &[0, 1, 2], &sighting(9, &EgoMotion::default()), 1.0, 1.0, &params);
        let turned = of_solid(&solid(), &[0, 1, 2], &sighting(9, &ego), 1.0, 1.0, &params);
        assert!((turned.value.fixed_rows::<3>(0) - Vector3::new(0.0, 11.0, 0.0)).norm() < 1e-9);
        assert!((turned.covariance[(1, 1)] - level.covariance[(0, 0)]).abs() < 1e-9);
        assert!((turned.covariance[(1, 4)] - level.covariance[(0, 4)]).abs() < 1e-9);
    }

    #[test]
    fn a_covariance_that_is_none_is_measured_all_the_same() {
        let odd = [[0.0; 45], [-1.0; 45], [1e30; 45], std::array::from_fn(|place| if place == 1 { 5.0 } else { 0.0 })];
        for covariance in odd {
            let solid = Solid { covariance, ..solid() };
            let whole = of_solid(&solid, &[0, 1, 2], &sighting(9, &EgoMotion::default()), 1.0, 1.0, &params().fit);
            assert!(whole.covariance.cholesky().is_some(), "{covariance:?}");
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
        assert!(one.place_m2() > many.place_m2());
        let torn = of_centroid(&sighting(1_000, &EgoMotion::default()), 2.0, 0.0, true, &params);
        assert!(torn.covariance[(1, 1)] > many.covariance[(1, 1)]);
    }

    #[test]
    fn an_unknown_size_is_unknown_along_the_line_of_sight_alone() {
        let params = params().centroid;
        let sure = of_centroid(&sighting(100, &EgoMotion::default()), 1.0, 0.0, false, &params);
        let unsure = of_centroid(&sighting(100, &EgoMotion::default()), 1.0, 0.5, false, &params);
        assert!(unsure.covariance[(0, 0)] > sure.covariance[(0, 0)]);
        assert_eq!(unsure.covariance[(1, 1)], sure.covariance[(1, 1)]);
    }

    #[test]
    fn a_solid_of_an_unlikely_class_is_off_by_a_share_of_the_half_extent() {
        let params = FitParams { foreign_sigma: 0.5, ..params().fit };
        let own = of_solid(&solid(), &[0, 1, 2], &sighting(9, &EgoMotion::default()), 2.0, 1.0, &params);
        assert_eq!(own.doubted(1.0, 2.0, &params).covariance, own.covariance);
        let wider = own.doubted(0.25, 2.0, &params).covariance - own.covariance;
        // 1 m, as a half extent 2 m, of three quarters of all.
        assert!((wider - Matrix6::from_diagonal(&Vector6::new(0.75, 0.75, 0.75, 3.0, 3.0, 3.0))).norm() < 1e-9);
    }

    #[test]
    fn fits_that_stray_are_wider_as_a_whole_and_those_of_few_returns_by_far() {
        let params = params().fit;
        let at = |points, stray| {
            of_solid(&solid(), &[0, 1, 2], &sighting(points, &EgoMotion::default()), 1.0, stray, &params)
        };
        assert!((at(9, 4.0).covariance - at(9, 1.0).covariance * 4.0).norm() < 1e-9);
        let ratio = |points| at(points, 1.0).covariance[(5, 5)] / f64::from(solid().covariance_of(8, 8));
        assert!(ratio(5) > 10.0 * ratio(1_000), "{} {}", ratio(5), ratio(1_000));
    }
}
