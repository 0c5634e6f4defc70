use nalgebra::{Matrix6, Vector3, Vector6};

use super::motion::root;
use super::paths::nearest_s;

/// Half of 32 points of a standard normal distribution in six dimensions; the others are their opposites. Their
/// covariance is the unit matrix (scrambled Sobol points, whitened, the best of 300 by fourth moments).
const POINTS: [[f64; 6]; 16] = [
    [0.0306, -0.1706, 0.3029, -0.7001, 0.3553, -0.3022],
    [-0.6452, 0.2480, -0.1770, 1.6609, 0.3043, 1.4087],
    [-1.5048, -1.8375, 0.2954, 0.2926, -1.5660, -0.8644],
    [0.8184, 2.2302, -1.3554, 0.4106, -0.0140, -1.1372],
    [2.5397, -0.9981, -0.6810, -0.9064, 0.3685, 1.1419],
    [-0.6757, 0.8394, 0.4411, -0.3316, -1.3183, 0.6761],
    [-0.1200, -0.3739, -0.9960, 0.7879, 0.8510, 0.5676],
    [0.4709, 0.3107, 2.2247, -1.4957, 1.0671, -0.8909],
    [0.3497, -1.1724, -1.2738, -0.5695, 0.0044, -2.1597],
    [-0.2370, 1.2641, 1.5427, 0.2028, 0.2139, -0.0148],
    [-0.9403, -0.0416, -0.6141, -2.3956, -0.6567, 1.5323],
    [1.3277, 0.0511, 0.0607, 0.3261, -1.6490, 0.9714],
    [0.9989, -0.6980, 0.9469, 1.4371, -0.6678, -0.5256],
    [-1.2068, 0.6728, -1.3757, -0.3662, 0.8563, -0.3371],
    [-0.4229, -0.9529, 0.4195, 0.5423, 2.1973, 0.7085],
    [0.2182, 0.8928, 0.0690, -0.0567, -0.6236, -0.3987],
];

/// Root mean square of what the least distance within the horizon differs from `distance_m` [m].
///
/// Each point has its own time of closest approach, so that this also holds where the mean passes near the origin and
/// where the velocity is hardly known.
pub(super) fn deviation_m(
    position: &Vector3<f64>,
    velocity: &Vector3<f64>,
    covariance: &Matrix6<f64>,
    horizon_s: f64,
    distance_m: f64,
) -> f64 {
    let root = root(covariance);
    let mut sum = 0.0;
    for point in &POINTS {
        let step = root * Vector6::from_row_slice(point);
        for sign in [-1.0, 1.0] {
            let position = position + step.fixed_rows::<3>(0) * sign;
            let velocity = velocity + step.fixed_rows::<3>(3) * sign;
            let time_s = nearest_s(&position, &velocity, 0.0, horizon_s);
            let difference = (position + velocity * time_s).norm() - distance_m;
            sum += difference * difference;
        }
    }
    (sum / (2 * POINTS.len()) as f64).sqrt()
}
