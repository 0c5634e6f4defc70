/// Levels of each angle: n_f of Sec. III-B.3.
pub const LEVELS: usize = 12;

/// Sines nearer to 0 than this are 0. With 12 levels an angle of 0 lies on an edge, and all angles of a flat surface
/// are 0 but for rounding (below 1e-4 at 100 m); they all go to the level above. Range noise moves angles by far more.
const FLAT: f32 = 1e-3;

/// The angles of one pair of neighbours, as the sines and cosines that Eq. 2 gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Darboux {
    /// α = v·n_j, in [−1, 1].
    pub alpha: f32,
    /// φ = u·(p_j − p_i) / ‖p_j − p_i‖, in [−1, 1].
    pub phi: f32,
    /// w·n_j: θ is the angle whose sine and cosine are in the ratio of this and `theta_cos`.
    pub theta_sin: f32,
    /// u·n_j.
    pub theta_cos: f32,
}

impl Darboux {
    /// Angles between the unit normals of a point and of its neighbour, `offset` = p_j − p_i [m] and `distance_m` its
    /// length. None where the frame is undefined: equal points, or a neighbour straight along the normal.
    ///
    /// v is made a unit vector, which Eq. 1 leaves out: else α would be no angle but grow with the distance.
    #[inline(always)]
    pub fn between(normal_i: [f32; 3], normal_j: [f32; 3], offset: [f32; 3], distance_m: f32) -> Option<Self> {
        let (pair, defined) = Self::or_undefined(normal_i, normal_j, offset, distance_m);
        defined.then_some(pair)
    }

    /// The same without a branch, so that pairs can be worked on side by side: the angles, and whether there are any.
    #[inline(always)]
    pub(crate) fn or_undefined(
        normal_i: [f32; 3],
        normal_j: [f32; 3],
        offset: [f32; 3],
        distance_m: f32,
    ) -> (Self, bool) {
        let towards = offset.map(|c| c / distance_m);
        let u = normal_i; // Eq. (1)
        let across = cross(towards, u);
        let length = dot(across, across).sqrt();
        let v = across.map(|c| c / length); // Eq. (1)
        let w = cross(u, v); // Eq. (1)
        let pair = Self {
            alpha: snapped(dot(v, normal_j)),     // Eq. (2)
            phi: snapped(dot(u, towards)),        // Eq. (2)
            theta_sin: snapped(dot(w, normal_j)), // Eq. (2)
            theta_cos: dot(u, normal_j),
        };
        (pair, (distance_m > 0.0) & (length >= 1e-6))
    }

    /// Place in the joint histogram: `(level(α)·12 + level(φ))·12 + level(θ)`, 0 to 1727.
    pub fn bin(self) -> usize {
        self.place() as usize
    }

    #[inline(always)]
    pub(crate) fn place(self) -> u32 {
        let theta = angle_level(self.theta_sin, self.theta_cos);
        (sine_level(self.alpha) * LEVELS as u32 + sine_level(self.phi)) * LEVELS as u32 + theta
    }
}

/// Joint bin of three levels, each 0 to 11.
pub const fn joint_bin(alpha: usize, phi: usize, theta: usize) -> usize {
    (alpha * LEVELS + phi) * LEVELS + theta
}

/// Level of a value in [−1, 1]: equal steps, a lower edge belongs to its level, 1 to the last.
#[inline(always)]
fn sine_level(value: f32) -> u32 {
    const LAST: f32 = LEVELS as f32 - 1.0;
    /// Added to a small number, it leaves the nearest whole number in the last bits: 2^23.
    const WHOLE: f32 = 8_388_608.0;
    let steps = (value + 1.0) * (LEVELS as f32 / 2.0);
    let steps = if steps > 0.0 { steps } else { 0.0 };
    let steps = if steps < LAST { steps } else { LAST };
    // A cast would be done one number at a time.
    let shifted = steps + WHOLE;
    (shifted.to_bits() - WHOLE.to_bits()) - u32::from(shifted - WHOLE > steps)
}

/// Level of θ = atan2(sin, cos) in [−π, π] in steps of 30°, found by signs: an edge belongs to the level farther from
/// 0 on either side, but 0 itself to the level above and ±π to the last and first.
#[inline(always)]
fn angle_level(sin: f32, cos: f32) -> u32 {
    const HALF: u32 = LEVELS as u32 / 2;
    const COS_30: f32 = 0.866_025_4;
    const SIN_30: f32 = 0.5;
    let height = sin.abs();
    let mut steps = 0;
    for (edge_sin, edge_cos) in [(SIN_30, COS_30), (COS_30, SIN_30), (1.0, 0.0), (COS_30, -SIN_30), (SIN_30, -COS_30)] {
        // The sine of θ less the edge.
        steps += u32::from(height * edge_cos - cos * edge_sin >= 0.0);
    }
    // Between 0 and 180° the five edges are passed one after the other, each sine staying positive up to 180°.
    if sin >= 0.0 { HALF + steps } else { HALF - 1 - steps }
}

#[inline(always)]
fn snapped(sine: f32) -> f32 {
    if sine.abs() < FLAT { 0.0 } else { sine }
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_1_SQRT_2;

    use super::*;

    #[test]
    fn a_flat_pair_lies_in_the_levels_above_zero() {
        let rounding = 1e-5;
        for tilt in [[0.0, 0.0], [rounding, 0.0], [-rounding, rounding], [0.0, -rounding]] {
            let normal_j = [1.0, tilt[0], tilt[1]];
            let pair = Darboux::between([1.0, 0.0, 0.0], normal_j, [tilt[0], 0.3, 0.4], 0.5).unwrap();
            assert_eq!(pair.bin(), joint_bin(6, 6, 6), "{tilt:?}");
        }
    }

    #[test]
    fn a_pair_without_a_frame_has_no_angles() {
        let up = [0.0, 0.0, 1.0];
        assert_eq!(Darboux::between(up, up, [0.0; 3], 0.0), None);
        assert_eq!(Darboux::between(up, up, [0.0, 0.0, 2.0], 2.0), None);
    }

    #[test]
    fn levels_of_a_sine_part_its_range_in_twelve() {
        for (value, level) in [(-1.0, 0), (-1.1, 0), (-0.01, 5), (0.0, 6), (0.16, 6), (0.17, 7), (0.99, 11), (1.0, 11)]
        {
            assert_eq!(sine_level(value), level, "{value}");
        }
        assert_eq!(sine_level(1.000_001), 11);
    }

    #[test]
    fn levels_of_an_angle_are_those_of_atan2() {
        for step in 0..7_200 {
            // Half a step off the edges, whose owner the signs decide.
            let theta = (f64::from(step) + 0.5) / 7_200.0 * std::f64::consts::TAU - std::f64::consts::PI;
            let expected = ((theta + std::f64::consts::PI) / std::f64::consts::TAU * 12.0).floor() as u32;
            assert_eq!(angle_level(theta.sin() as f32, theta.cos() as f32), expected, "{theta}");
        }
        assert_eq!(angle_level(0.0, 1.0), 6);
        assert_eq!(angle_level(0.0, -1.0), 11);
        assert_eq!(angle_level(-1e-3, -1.0), 0);
        assert_eq!(angle_level(FRAC_1_SQRT_2, FRAC_1_SQRT_2), 7);
    }
}
