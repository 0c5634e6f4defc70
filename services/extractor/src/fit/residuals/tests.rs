//! First derivatives against central differences, at random bodies and rays.

use nalgebra::Matrix3;
use pulp::Scalar;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::super::descent::moved;
use super::super::sight::{Residuals, soften};
use super::super::solid::for_kind;
use super::super::system::MOST;
use super::super::tests::{V, at_outline, meet, narrow, random, random_aim, random_body, settings, wide};
use super::super::wide::Wide;
use super::super::{Kind, Ray};
use super::*;

const SIGMA_M: f64 = 0.02;
/// Step of the differences [m, rad, ln].
const STEP: f64 = 1e-7;

/// The body with one parameter grown by `by`.
fn nudged(kind: Kind, body: &Body, parameter: usize, by: f64) -> Body {
    let mut step = [0.0; MOST];
    step[parameter] = -by;
    for_kind!(kind, S => moved::<S>(body, &step))
}

/// A residual and its derivatives with respect to every parameter, as the sums take them.
type Row = (f64, [f64; MOST]);

fn row(kind: Kind, residuals: &Residuals<Scalar>) -> Row {
    let (mut rows, count) = ([super::Row::ZERO; MOST_LANES], parameters(kind.is_round()));
    if kind.is_round() {
        residuals.store::<true>(&mut rows)
    } else {
        residuals.store::<false>(&mut rows)
    }
    let row = rows[0].0;
    (row[count], std::array::from_fn(|parameter| if parameter < count { row[parameter] } else { 0.0 }))
}

fn hit_of(kind: Kind, body: &Body, ray: &Ray, how: Measure) -> Row {
    let sight = for_kind!(kind, S => Sight::new::<S>(Scalar, body, SIGMA_M));
    let ray = (wide(&ray.direction), sight.all(ray.range_m));
    row(kind, &for_kind!(kind, S => hit::<S, Scalar>(&sight, ray, how)))
}

fn miss_of(kind: Kind, body: &Body, ray: &Ray, how: Measure) -> Option<Row> {
    let sight = for_kind!(kind, S => Sight::new::<S>(Scalar, body, SIGMA_M));
    let ray = (wide(&ray.direction), sight.all(ray.range_m));
    let (_, residuals) = for_kind!(kind, S => miss::<S, Scalar>(&sight, ray, how))?;
    Some(row(kind, &residuals))
}

/// Asserts that `of` changes as its row says, within `tolerance` of the row's length.
fn check(kind: Kind, body: &Body, tolerance: f64, of: impl Fn(&Body) -> Row) {
    let (_, row) = of(body);
    let length = row.iter().map(|d| d * d).sum::<f64>().sqrt();
    for (parameter, derivative) in row.iter().enumerate().take(parameters(kind.is_round())) {
        let [more, less] = [STEP, -STEP].map(|by| of(&nudged(kind, body, parameter, by)).0);
        let difference = (more - less) / (2.0 * STEP);
        let off = (difference - derivative).abs() / length;
        assert!(off < tolerance, "{kind:?}, {parameter}: {derivative}, by differences {difference}, of {length}");
    }
}

/// Whether all rays within 1e-4 rad meet the same face at less than 85° to its normal.
fn is_clear_of_edges(kind: Kind, body: &Body, direction: &V, random: &mut ChaCha8Rng) -> bool {
    let half_m = body.ln_half.map(f64::exp);
    let normal = |direction: &V| meet(kind, body, direction).map(|m| m.normal.component_div(&half_m).normalize());
    let Some(here) = normal(direction) else { return false };
    let in_body = body.rotation.tr_mul(direction);
    here.dot(&in_body) < -0.09
        && (0..12).all(|_| {
            let aside = V::from_fn(|_, _| random.random_range(-1e-4..1e-4));
            normal(&(direction + aside).normalize()).is_some_and(|there| (there - here).norm() < 0.02)
        })
}

// verifies EXT-023
#[test]
fn ranges_of_hits_change_as_their_derivatives_say() {
    let mut random = random(31);
    for kind in Kind::ALL {
        let mut checked = 0;
        for _ in 0..1_500 {
            let body = random_body(kind, &mut random);
            let direction = random_aim(&body, 0.9, &mut random);
            if !is_clear_of_edges(kind, &body, &direction, &mut random) {
                continue;
            }
            checked += 1;
            let there_m = meet(kind, &body, &direction).unwrap().distance;
            // As they are, and softened: off by up to 10 standard deviations.
            let off_m = SIGMA_M * random.random_range(-10.0..10.0);
            let ray = Ray { direction, range_m: there_m + off_m };
            check(kind, &body, 1e-4, |body| hit_of(kind, body, &ray, Measure::Range));
            // Along the normal: exact on the surface, where the cosine's change tells nothing.
            let ray = Ray { direction, range_m: there_m };
            check(kind, &body, 1e-4, |body| hit_of(kind, body, &ray, Measure::Near));
        }
        assert!(checked > 500, "{kind:?}: {checked}");
    }
}

#[test]
fn a_hit_on_the_very_apex_of_a_cone_has_derivatives() {
    let half_m = V::new(0.5, 0.5, 1.0);
    // The axis is the ray: towards the sensor, -z.
    let rotation = Matrix3::from_columns(&[V::x(), -V::y(), -V::z()]);
    let body = Body { centre_m: V::z() * 5.0, rotation, ln_half: half_m.map(f64::ln) };
    let ray = Ray { direction: V::z(), range_m: 4.1 };
    for how in [Measure::Near, Measure::Range] {
        let residual = hit_of(Kind::Cone, &body, &ray, how);
        assert!((residual.0.abs() - 5.0).abs() < 1.1, "{}", residual.0);
        assert!(residual.1.iter().all(|d| d.is_finite()), "{how:?}");
    }
}

// verifies EXT-023
#[test]
fn hits_beside_and_misses_in_the_way_change_as_their_derivatives_say() {
    let mut random = random(32);
    for kind in Kind::ALL {
        for _ in 0..1_000 {
            let body = random_body(kind, &mut random);
            // Distances are of first order for the round ones: the derivatives hold at the outline.
            let [within, beside] = at_outline(kind, &body, 1e-6, &mut random);
            for how in [Measure::Near, Measure::Range] {
                let ray = Ray { direction: beside, range_m: body.centre_m.norm() };
                check(kind, &body, 1e-2, |body| hit_of(kind, body, &ray, how));
                let ray = Ray { direction: within, range_m: 100.0 };
                check(kind, &body, 1e-2, |body| miss_of(kind, body, &ray, how).unwrap());
            }
        }
    }
}

// verifies EXT-023
#[test]
fn beliefs_change_as_their_derivatives_say() {
    let mut random = random(33);
    let beliefs = settings().beliefs;
    let none = Beam::new(0);
    let rays = Rays { arch: Arch::new(), hits: &none, misses: &none, sigma_m: SIGMA_M, beliefs: &beliefs };
    for kind in Kind::ALL {
        for _ in 0..100 {
            let body = random_body(kind, &mut random);
            let at = |body: &Body| for_kind!(kind, S => measure::<S>(body, &rays, Measure::Range, f64::INFINITY));
            let (system, parts) = at(&body);
            assert_eq!(system.cost, parts.beliefs);
            for parameter in 0..parameters(kind.is_round()) {
                let [more, less] = [1e-3, -1e-3].map(|by| at(&nudged(kind, &body, parameter, by)).0);
                let slope = (more.cost - less.cost) / 4e-3;
                assert!((system.gradient[parameter] - slope).abs() < 1e-8, "{kind:?} parameter {parameter}");
                let bend = (more.cost - 2.0 * system.cost + less.cost) / 2e-6;
                assert!((system.curvature[parameter][parameter] - bend).abs() < 1e-5, "{kind:?} parameter {parameter}");
            }
        }
    }
}

fn soften_one(residual: f64) -> (f64, f64) {
    let (soft, slope) = soften(Wide::splat(Scalar, residual));
    (narrow(soft), narrow(slope))
}

#[test]
fn a_residual_is_softened_without_a_jump_in_value_or_slope() {
    for residual in [0.0, 1.0, -3.9, 3.999_999, 4.0, 4.000_001, -7.0, 1e3, -1e9] {
        let (soft, slope) = soften_one(residual);
        let difference = (soften_one(residual + 1e-6).0 - soften_one(residual - 1e-6).0) / 2e-6;
        assert!((slope - difference).abs() < 1e-5, "{residual}");
        assert!(soft.abs() <= residual.abs() && soft * residual >= 0.0);
        assert!(residual.abs() >= 4.0 || soft == residual);
    }
}
