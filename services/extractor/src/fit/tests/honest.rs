//! Errors against what covariances say of them: over scenes of many bodies, and where it is known what bounds a body.

use nalgebra::{Rotation3, SMatrix};

use super::fits::covariance;
use super::stand::{Field, Stand};
use super::*;
use crate::fit::Fitter;

const SIGMA_M: f64 = 0.02;
/// Along these a body's errors are looked at; of a round body the first two are the same.
const AXES: [&str; 9] = ["x", "y", "z", "size x", "size y", "size z", "sight", "level", "upright"];

/// Squared errors in units of their variances, one list for each of [`AXES`].
type Errors = [Vec<f64>; 9];

/// The true size along each axis of a fitted body: a cuboid's and an ellipsoid's axes have no names.
fn true_size_m(kind: Kind, body: &Body, rotation: &Matrix3<f64>) -> V {
    let size_m = body.ln_half.map(|ln_half| 2.0 * ln_half.exp());
    if kind.is_round() {
        return size_m;
    }
    let alike = (rotation.transpose() * body.rotation).abs();
    let order = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]]
        .into_iter()
        .max_by(|a, b| {
            let sum = |order: &[usize; 3]| (0..3).map(|axis| alike[(axis, order[axis])]).sum::<f64>();
            sum(a).total_cmp(&sum(b))
        })
        .unwrap();
    V::from(order.map(|axis| size_m[axis]))
}

/// From the solid's axes to the sensor frame.
fn attitude(solid: &messages::Solid) -> Matrix3<f64> {
    let [w, i, j, k] = solid.attitude_wxyz.map(f64::from);
    let attitude = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    attitude.to_rotation_matrix().into_inner()
}

/// Squared errors along the body's axes, of its sizes, along the line of sight and across, each over its variance.
fn squares(kind: Kind, body: &Body, solid: &messages::Solid) -> [f64; 9] {
    let vector = |components: [f32; 3]| V::from(components.map(f64::from));
    let rotation = attitude(solid);
    let off_m = vector(solid.centre_m) - body.centre_m;
    let size_off_m = vector(solid.size_m) - true_size_m(kind, body, &rotation);
    let covariance = covariance(solid);
    let of_centre: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
    let sight = vector(solid.centre_m).normalize();
    let level = sight.cross(&V::z()).normalize();
    let square = |along: V| off_m.dot(&along).powi(2) / along.dot(&(of_centre * along));
    std::array::from_fn(|place| match place {
        0..3 => square(rotation.column(place).into()),
        3..6 => size_off_m[place - 3].powi(2) / covariance[(3 + place, 3 + place)],
        6 => square(sight),
        7 => square(level),
        _ => square(level.cross(&sight)),
    })
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

// verifies EXT-028
#[test]
fn errors_are_about_as_large_as_covariances_say() {
    const POINTS: [(usize, usize); 3] = [(50, usize::MAX), (20, 50), (5, 20)];
    let mut sut = Fitter::new(settings());
    let mut errors: [[Errors; 4]; 3] = Default::default();
    for seed in 21..25 {
        let mut field = Field::new(seed);
        for sweep in 0..20 {
            field.show(10 * sweep, |known| {
                let fit = sut.fit(known.rays, SIGMA_M);
                let costs = fit.solids.map(|solid| solid.cost());
                let own = known.kind as usize;
                // Only a cluster that is taken for what it is has its own solid's covariance.
                if costs.iter().any(|&cost| cost < costs[own]) {
                    return;
                }
                let row = POINTS.iter().position(|(least, most)| (*least..*most).contains(&known.points)).unwrap();
                let squares = squares(known.kind, &known.body, &fit.solids[own].solid);
                for (list, square) in errors[row][own].iter_mut().zip(squares) {
                    list.push(square);
                }
            });
        }
    }
    println!("squared error over variance, median · 95 % quantile (normal: 0.45 · 3.84)");
    for ((least, _), errors) in POINTS.iter().zip(&mut errors) {
        for (kind, errors) in Kind::ALL.iter().zip(errors) {
            print!("{least} points, {} {kind:?}:", errors[0].len());
            for (axis, errors) in AXES.iter().zip(errors) {
                errors.sort_by(f64::total_cmp);
                print!("  {axis} {:.2} · {:.1}", quantile(errors, 0.5), quantile(errors, 0.95));
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                assert!(mean.is_finite(), "{kind:?}, {axis}");
            }
            println!();
        }
    }
    for (row, (least_median, most_median, most)) in
        [(0.15, 0.8, 8.0), (0.15, 0.8, 12.0), (0.08, 1.0, 40.0)].iter().enumerate()
    {
        for (kind, errors) in Kind::ALL.iter().zip(&errors[row]) {
            for (axis, errors) in AXES.iter().zip(errors) {
                let (median, high) = (quantile(errors, 0.5), quantile(errors, 0.95));
                assert!((*least_median..*most_median).contains(&median), "{row}, {kind:?}, {axis}: {median}");
                assert!(high < *most, "{row}, {kind:?}, {axis}: {high}");
            }
        }
    }
}

/// Standard deviations of depth, width and height of a box whose near face is square to the line of sight, and how far
/// rings are apart there [m].
fn face_on(elevation_deg: f64) -> ([f64; 3], f64) {
    let (range_m, half_m) = (8.0, V::new(0.8, 0.7, 0.9));
    let rotation = Rotation3::from_axis_angle(&V::y_axis(), -elevation_deg.to_radians()).into_inner();
    let centre_m = rotation * V::x() * (range_m + half_m.x);
    let body = Body { centre_m, rotation, ln_half: half_m.map(f64::ln) };
    let mut stand = Stand::new(SIGMA_M);
    let rays = stand.rays(Kind::Cuboid, &body).unwrap();
    // Of all rays, so that the gap at an edge is that between rays.
    let mut sut = Fitter::new(FitSettings { rays: 4_096, evaluations: 1_000_000, ..settings() });
    let solid = sut.fit(rays, SIGMA_M).solids[Kind::Cuboid as usize].solid;
    let attitude = attitude(&solid);
    let covariance: SMatrix<f64, 9, 9> = covariance(&solid);
    let deviations_m = std::array::from_fn(|axis| {
        let own = (attitude.transpose() * rotation.column(axis)).iamax();
        covariance[(6 + own, 6 + own)].sqrt()
    });
    (deviations_m, range_m * 1.333_f64.to_radians())
}

// verifies EXT-028
#[test]
fn a_box_seen_face_on_is_as_long_as_rays_beside_it_say() {
    let ([depth_m, width_m, height_m], gap_m) = face_on(-10.0);
    // Upper and lower edge each lie in a gap between rings: 1/√12 of it each, more where the fit is not in the middle.
    let one = gap_m / 12.0_f64.sqrt();
    assert!((one..3.0 * one).contains(&height_m), "{height_m}, {one}");
    // Columns are 23 mm apart.
    assert!((0.003..0.04).contains(&width_m), "{width_m}");
    assert!(depth_m > 0.2, "nothing bounds it behind: {depth_m}");
}

// verifies EXT-028
#[test]
fn a_box_that_reaches_beyond_the_uppermost_ring_may_be_far_higher() {
    let ([_, width_m, height_m], gap_m) = face_on(8.0);
    assert!(height_m > gap_m, "{height_m}");
    assert!(width_m < 0.04, "{width_m}");
}
