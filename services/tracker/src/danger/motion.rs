use nalgebra::{Matrix2, Matrix3, Matrix6, SMatrix, Vector3};

/// Standard deviations, in the sum over all directions, beyond which nothing is looked for: less than 1e-6.
const BEYOND: f64 = 5.0;
/// Parts of the time until the horizon that are looked at apart.
const PARTS: usize = 8;

/// Position and velocity relative to the own craft, and their covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    /// Covariance of the position [m²].
    pub(super) pp: Matrix3<f64>,
    /// Covariance of velocity (rows) and position (columns) [m²/s].
    pub(super) vp: Matrix3<f64>,
    /// Covariance of the velocity [m²/s²].
    pub(super) vv: Matrix3<f64>,
}

impl Motion {
    pub(super) fn new(position: &Vector3<f64>, velocity: &Vector3<f64>, covariance: &Matrix6<f64>) -> Self {
        Self {
            position: *position,
            velocity: *velocity,
            pp: covariance.fixed_view::<3, 3>(0, 0).into(),
            vp: covariance.fixed_view::<3, 3>(3, 0).into(),
            vv: covariance.fixed_view::<3, 3>(3, 3).into(),
        }
    }

    /// Whether the obstacle surely stays farther than `touch_m` until the horizon: in each of some parts of the time, the
    /// mean stays farther than that by [`BEYOND`] standard deviations.
    pub(super) fn is_beyond(&self, touch_m: f64, horizon_s: f64) -> bool {
        let (a, b, c) = (self.pp.trace(), self.vp.trace(), self.vv.trace());
        let variance = |t: f64| (a + 2.0 * b * t + c * t * t).max(0.0);
        let part_s = horizon_s / PARTS as f64;
        let moved_m = 0.5 * part_s * self.velocity.norm();
        (0..PARTS).all(|part| {
            let start_s = part as f64 * part_s;
            let middle = self.position + self.velocity * (start_s + 0.5 * part_s);
            let gap_m = middle.norm() - moved_m - touch_m;
            // A variance is a convex function of time: nowhere greater than at one of the ends.
            let most = variance(start_s).max(variance(start_s + part_s));
            gap_m > 0.0 && gap_m * gap_m > BEYOND * BEYOND * most
        })
    }
}

/// Principal variances of two numbers, the greater first.
pub(super) fn principal(covariance: &Matrix2<f64>) -> [f64; 2] {
    let half = 0.5 * covariance.trace();
    let radius = (0.5 * (covariance[(0, 0)] - covariance[(1, 1)])).hypot(covariance[(0, 1)]);
    [half + radius, half - radius]
}

/// Turn about the first of three axes that makes the other two the principal axes of `covariance`, the greater first.
pub(super) fn about_first(covariance: &Matrix2<f64>) -> Matrix3<f64> {
    let angle = 0.5 * (2.0 * covariance[(0, 1)]).atan2(covariance[(0, 0)] - covariance[(1, 1)]);
    let (sin, cos) = angle.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos)
}

/// Two unit vectors that make a right-handed frame with the unit vector `along`, as rows.
pub(super) fn frame(along: &Vector3<f64>) -> Matrix3<f64> {
    let mut least = Vector3::zeros();
    least[along.iamin()] = 1.0;
    let first = along.cross(&least).normalize();
    Matrix3::from_rows(&[along.transpose(), first.transpose(), along.cross(&first).transpose()])
}

/// Lower triangular root of a covariance that may be singular: L·Lᵀ. Directions without variance, or with less than none,
/// get none.
pub(super) fn root<const N: usize>(covariance: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut rest = *covariance;
    let mut root = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        let pivot = rest[(column, column)];
        if pivot <= 1e-12 * covariance[(column, column)].abs() || pivot < 1e-18 {
            continue;
        }
        let scale = 1.0 / pivot.sqrt();
        for row in column..N {
            root[(row, column)] = rest[(row, column)] * scale;
        }
        for one in column + 1..N {
            for other in column + 1..N {
                rest[(one, other)] -= root[(one, column)] * root[(other, column)];
            }
        }
    }
    root
}
