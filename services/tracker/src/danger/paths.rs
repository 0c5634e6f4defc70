use nalgebra::Vector3;

/// Speed below which a path is taken for a point [m/s].
const AT_REST_MPS: f64 = 1e-9;
/// Rounds in which the time of closest approach and the place on the line are made to agree, at most.
const ROUNDS: usize = 3;
/// Square of a change of place that is none [m²].
const CLOSE_M2: f64 = 1e-6;
/// Square of how far a place must move with s for s to make a difference.
const NO_STEP2: f64 = 1e-12;
/// What stands for a side without end.
const ENDLESS: f64 = 1e9;

/// Straight paths, one for each s: (point + s·point_step) + t·(velocity + s·velocity_step), t from `first_s` to `last_s`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paths {
    pub(super) point_m: Vector3<f64>,
    pub(super) point_step: Vector3<f64>,
    pub(super) velocity_mps: Vector3<f64>,
    pub(super) velocity_step: Vector3<f64>,
    pub(super) first_s: f64,
    pub(super) last_s: f64,
}

/// Time in [first, last] at which point + t·velocity is nearest to the origin; `first` for a path at rest.
pub(super) fn nearest_s(point: &Vector3<f64>, velocity: &Vector3<f64>, first_s: f64, last_s: f64) -> f64 {
    let speed2 = velocity.norm_squared();
    if speed2 < AT_REST_MPS * AT_REST_MPS {
        return first_s;
    }
    (-point.dot(velocity) / speed2).clamp(first_s, last_s)
}

impl Paths {
    /// Where the path `s` is at its own time of closest approach, and how that place moves with s at this time.
    fn nearest(&self, s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let point = self.point_m + self.point_step * s;
        let velocity = self.velocity_mps + self.velocity_step * s;
        let time_s = nearest_s(&point, &velocity, self.first_s, self.last_s);
        (point + velocity * time_s, self.point_step + self.velocity_step * time_s)
    }

    /// The s whose path comes nearest to the origin, nearly.
    ///
    /// At a fixed time the best s is the root of a linear equation, and at a fixed s the best time; they take turns.
    pub(super) fn middle(&self) -> f64 {
        let mut middle = 0.0;
        for _ in 0..ROUNDS {
            let (place, step) = self.nearest(middle);
            let step2 = step.norm_squared();
            if step2 < NO_STEP2 {
                break;
            }
            let change = place.dot(&step) / step2;
            middle = (middle - change).clamp(-ENDLESS, ENDLESS);
            if change * change * step2 < CLOSE_M2 {
                break;
            }
        }
        middle
    }

    /// The s round `middle` between which paths come within `reach_m` of the origin; none where that of the middle does
    /// not. Where s makes no difference, the sides are endless.
    pub(super) fn within(&self, middle: f64, reach_m: f64) -> Option<(f64, f64)> {
        self.side(middle, -1.0, reach_m).zip(self.side(middle, 1.0, reach_m))
    }

    /// The end of those within reach on one side of `middle`.
    ///
    /// At a fixed time it is the root of a quadratic. The distance at the best time is stationary in time, so that taking
    /// turns finds the end as Newton's method does, from within.
    fn side(&self, middle: f64, sign: f64, reach_m: f64) -> Option<f64> {
        let mut s = middle;
        for round in 0..ROUNDS {
            let (place, step) = self.nearest(s);
            let (step2, along) = (step.norm_squared(), place.dot(&step));
            let excess = place.norm_squared() - reach_m * reach_m;
            if step2 < NO_STEP2 {
                return (excess <= 0.0).then_some(sign * ENDLESS);
            }
            let discriminant = along * along - step2 * excess;
            if discriminant < 0.0 {
                // From the edge on this is rounding.
                return (round > 0).then_some(s);
            }
            let change = (sign * discriminant.sqrt() - along) / step2;
            s += change;
            if s.abs() > ENDLESS {
                return Some(sign * ENDLESS);
            }
            if change * change * step2 < CLOSE_M2 {
                break;
            }
        }
        Some(s)
    }
}
