use nalgebra::{Matrix3, Vector3};

/// Which turns of the body look the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symmetry {
    /// Box and ellipsoid: three planes; a fit may also give the axes in another order. 24 proper rotations.
    Planes,
    /// Cylinder: any turn about the axis z, and end for end.
    Axis,
    /// Cone: any turn about the axis z, which has a sign.
    Arrow,
}

/// The six orders of three axes: axis `i` of the body seen so far is axis `order[i]` of the fit.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];
/// Signs of the first two axes; the third's follows, so that the rotation is proper.
const SIGNS: [[f64; 2]; 4] = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];

/// The fitted attitude, its axes named and turned as in `expected`, and the order in which they were: of the 24 that look
/// the same the one with the least cost.
///
/// The cost is the squared angle between the two in units of `variance` (2 − 2·cos for an angle, so that half a turn
/// stays finite) and `order_cost` of the sizes that would have to be the same.
pub(super) fn alike(
    fitted: &Matrix3<f64>,
    expected: &Matrix3<f64>,
    variance: f64,
    order_cost: impl Fn([usize; 3]) -> f64,
) -> (Matrix3<f64>, [usize; 3]) {
    // Cosines between axes: expected axis in the row, fitted axis in the column.
    let cosines = expected.transpose() * fitted;
    let mut best = (f64::INFINITY, ORDERS[0], [1.0; 3]);
    for (place, order) in ORDERS.into_iter().enumerate() {
        let handed = if place < 3 { 1.0 } else { -1.0 };
        let sizes = order_cost(order);
        for [first, second] in SIGNS {
            let signs = [first, second, handed * first * second];
            let trace: f64 = (0..3).map(|axis| signs[axis] * cosines[(axis, order[axis])]).sum();
            let cost = (3.0 - trace) / variance + sizes;
            if cost < best.0 {
                best = (cost, order, signs);
            }
        }
    }
    let (_, order, signs) = best;
    (Matrix3::from_columns(&[0, 1, 2].map(|axis| fitted.column(order[axis]) * signs[axis])), order)
}

/// Turn [rad] that takes one unit vector into another by the shortest way; none between opposite ones.
pub(super) fn shortest(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let cross = from.cross(to);
    let sin = cross.norm();
    if sin < 1e-12 { Vector3::zeros() } else { cross * (sin.atan2(from.dot(to)) / sin) }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn every_way_to_name_a_boxs_axes_is_found_back() {
        let expected = Rotation3::from_euler_angles(0.3, -0.8, 1.9).into_inner();
        let off = Rotation3::from_euler_angles(0.05, 0.02, -0.04).into_inner();
        let mut ways = 0;
        for (place, order) in ORDERS.into_iter().enumerate() {
            for [first, second] in SIGNS {
                let third = if place < 3 { first * second } else { -first * second };
                let mut named = Matrix3::zeros();
                for (axis, sign) in [first, second, third].into_iter().enumerate() {
                    named.set_column(order[axis], &((off * expected).column(axis) * sign));
                }
                assert!((named.determinant() - 1.0).abs() < 1e-12);
                let (back, found) = alike(&named, &expected, 0.01, |_| 0.0);
                assert_eq!(found, order);
                assert!((back - off * expected).norm() < 1e-12);
                ways += 1;
            }
        }
        assert_eq!(ways, 24);
    }

    #[test]
    fn sizes_decide_where_angles_do_not() {
        let expected = Matrix3::identity();
        let eighth = Rotation3::from_euler_angles(0.0, 0.0, 0.79).into_inner();
        let keeps = |wanted: [usize; 3]| move |order: [usize; 3]| if order == wanted { 0.0 } else { 20.0 };
        let (kept, _) = alike(&eighth, &expected, 0.1, keeps([0, 1, 2]));
        assert!((kept - eighth).norm() < 1e-12);
        let (_, swapped) = alike(&eighth, &expected, 0.1, keeps([1, 0, 2]));
        assert_eq!(swapped, [1, 0, 2]);
    }

    #[test]
    fn the_shortest_turn_between_axes_is_across_both() {
        let (x, y) = (Vector3::x(), Vector3::y());
        assert!((shortest(&x, &y) - Vector3::z() * std::f64::consts::FRAC_PI_2).norm() < 1e-12);
        assert_eq!(shortest(&x, &x), Vector3::zeros());
        assert_eq!(shortest(&x, &-x), Vector3::zeros());
    }
}
