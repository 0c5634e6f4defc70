use messages::{SOLID_PARAMETERS, Solid, SolidFit};
use nalgebra::{Matrix3, Rotation3, SMatrix, UnitQuaternion};

use super::descent::Descent;
use super::system::{MOST, decompose, parameters, solve};

/// Standard deviation of a centre that no ray tells anything of [m].
const FAR_M: f64 = 5.0;
/// Standard deviation of a turn of which nothing is known [rad]: uniform over a turn.
const ANY_TURN_RAD: f64 = 1.813_799_364_234_217_8;
/// Most that a message says of how far the next minimum is behind.
const FAR_BEHIND: f64 = 100.0;

/// Covariance of the fit's parameters, in their own order.
pub(crate) type Square = SMatrix<f64, MOST, MOST>;

/// What a fit says of one solid, from its best descent and the next best; `spread` is the covariance of the best's
/// parameters, in place of Gauss's and Newton's.
pub(crate) fn solid_fit(best: &Descent, next: Option<&Descent>, spread: Option<Square>) -> SolidFit {
    let round = best.kind.is_round();
    let factor = factor(&best.system.curvature, round);
    let covariance = spread.or_else(|| factor.map(|factor| inverse(&factor, round).into()));
    let ln_information = factor.map_or(0.0, |factor| (0..parameters(round)).map(|i| 2.0 * factor[i][i].ln()).sum());
    let behind = next.map_or(FAR_BEHIND, |next| next.cost() - best.cost());
    SolidFit {
        solid: solid(best, &covariance.unwrap_or_default()),
        hit_cost: best.parts.hits as f32,
        miss_cost: best.parts.misses as f32,
        belief_cost: best.parts.beliefs as f32,
        ln_information: ln_information as f32,
        runner_up: behind.min(FAR_BEHIND) as f32,
        strayed: best.parts.strayed,
        violated: best.parts.violated,
    }
}

/// Cholesky's factor of the information of the fit's parameters. To the rays' information comes what is known without:
/// [`FAR_M`], [`ANY_TURN_RAD`]. None where it is not positive definite.
#[inline(always)]
pub(crate) fn factor(curvature: &[[f64; MOST]; MOST], round: bool) -> Option<[[f64; MOST]; MOST]> {
    let turns = if round { 5 } else { 6 };
    let mut factor = *curvature;
    for (i, row) in factor.iter_mut().enumerate().take(turns) {
        row[i] += if i < 3 { FAR_M.powi(-2) } else { ANY_TURN_RAD.powi(-2) };
    }
    decompose(&mut factor, parameters(round))?;
    Some(factor)
}

/// The inverse of what such a factor is of; 0 beyond a round body's parameters.
#[inline(always)]
pub(crate) fn inverse(factor: &[[f64; MOST]; MOST], round: bool) -> [[f64; MOST]; MOST] {
    let count = parameters(round);
    let mut inverse = [[0.0; MOST]; MOST];
    for (place, row) in inverse.iter_mut().enumerate().take(count) {
        row[place] = 1.0;
        solve(factor, count, row);
    }
    inverse
}

fn solid(descent: &Descent, covariance: &Square) -> Solid {
    let body = &descent.body;
    let size_m = body.ln_half.map(|ln_half| 2.0 * ln_half.exp());
    let attitude = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(body.rotation));

    // From the fit's parameters (shift and turn about the body's axes, ln of half extents) to those of the message.
    let mut change = SMatrix::<f64, SOLID_PARAMETERS, MOST>::zeros();
    let rotation: &Matrix3<f64> = &body.rotation;
    change.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    let round = descent.kind.is_round();
    if round {
        change.fixed_view_mut::<3, 2>(3, 3).copy_from(&rotation.fixed_columns::<2>(0));
        change[(6, 5)] = size_m.x;
        change[(7, 5)] = size_m.y;
        change[(8, 6)] = size_m.z;
    } else {
        change.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
        for axis in 0..3 {
            change[(6 + axis, 6 + axis)] = size_m[axis];
        }
    }
    let mut wide = change * covariance * change.transpose();
    if round {
        // Nothing tells how a round body is turned about its axis.
        let axis = rotation.column(2);
        let about = axis * axis.transpose() * ANY_TURN_RAD.powi(2);
        for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
            wide[(3 + row, 3 + column)] += about[(row, column)];
        }
    }
    let mut triangle = [0.0; SOLID_PARAMETERS * (SOLID_PARAMETERS + 1) / 2];
    let pairs = (0..SOLID_PARAMETERS).flat_map(|row| (row..SOLID_PARAMETERS).map(move |column| (row, column)));
    for (entry, pair) in triangle.iter_mut().zip(pairs) {
        *entry = wide[pair] as f32;
    }
    Solid {
        centre_m: body.centre_m.map(|c| c as f32).into(),
        attitude_wxyz: [attitude.w as f32, attitude.i as f32, attitude.j as f32, attitude.k as f32],
        size_m: size_m.map(|c| c as f32).into(),
        covariance: triangle,
    }
}
