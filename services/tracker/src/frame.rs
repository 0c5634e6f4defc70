use messages::EgoMotion;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The sensor's motion through one sweep, in the frame that obstacles are tracked in.
///
/// That frame is inertial where the header knows how the sensor moves; else the sensor's own axes stand for it, and what
/// is tracked is relative motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    /// Sensor time of the sweep's first firing [ns].
    pub(crate) start_ns: u64,
    /// Whether the sensor's motion is known.
    pub(crate) inertial: bool,
    position_m: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    /// Velocity of the sensor [m/s].
    pub(crate) velocity_mps: Vector3<f64>,
    spin_radps: Vector3<f64>,
}

/// Where the sensor is at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Its place [m].
    pub(crate) position_m: Vector3<f64>,
    /// Rotation from its axes to those of the frame.
    pub(crate) attitude: UnitQuaternion<f64>,
}

impl Frame {
    /// The frame of a sweep. A motion that is no motion (not finite, a quaternion of no length) counts as not known.
    pub(crate) fn new(start_ns: u64, ego: &EgoMotion) -> Self {
        let [w, x, y, z] = ego.attitude_wxyz;
        let all = [ego.position_m, ego.velocity_mps, ego.spin_radps];
        let attitude = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6);
        let finite =
            all.iter().flatten().all(|value| value.abs() < 1e12) && ego.attitude_wxyz.iter().all(|q| q.is_finite());
        match (ego.get(), attitude) {
            (Some(ego), Some(attitude)) if finite => Self {
                start_ns,
                inertial: true,
                position_m: ego.position_m.into(),
                attitude,
                velocity_mps: ego.velocity_mps.into(),
                spin_radps: ego.spin_radps.into(),
            },
            _ => Self {
                start_ns,
                inertial: false,
                position_m: Vector3::zeros(),
                attitude: UnitQuaternion::identity(),
                velocity_mps: Vector3::zeros(),
                spin_radps: Vector3::zeros(),
            },
        }
    }

    /// The frame of a later sweep of which nothing is known: the sensor goes on as it did.
    pub(crate) fn at_start(&self, start_ns: u64) -> Self {
        let pose = self.at(start_ns);
        Self { start_ns, position_m: pose.position_m, attitude: pose.attitude, ..*self }
    }

    /// Where the sensor is at a sensor time [ns].
    pub(crate) fn at(&self, time_ns: u64) -> Pose {
        if !self.inertial {
            return Pose { position_m: self.position_m, attitude: self.attitude };
        }
        let dt_s = seconds(self.start_ns, time_ns);
        Pose {
            position_m: self.position_m + self.velocity_mps * dt_s,
            attitude: UnitQuaternion::from_scaled_axis(self.spin_radps * dt_s) * self.attitude,
        }
    }
}

impl Pose {
    /// A place given along the sensor's axes [m], in the frame.
    pub(crate) fn place(&self, sensor_m: &Vector3<f64>) -> Vector3<f64> {
        self.position_m + self.attitude * sensor_m
    }
}

/// Time from one sensor time to another [s]; negative where the other is earlier.
pub(crate) fn seconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.wrapping_sub(from_ns) as i64 as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_at_rest_is_the_same_place_from_a_sensor_that_moves_and_turns() {
        let ego = EgoMotion {
            position_m: [1.0, 2.0, 3.0],
            attitude_wxyz: [0.8, 0.0, 0.6, 0.0],
            velocity_mps: [2.0, -1.0, 0.5],
            spin_radps: [0.3, -0.2, 0.7],
            known: 1,
        };
        let frame = Frame::new(1_000, &ego);
        let truth = Vector3::new(10.0, -4.0, 2.0);
        for offset_ns in [0, 13_000_000, 100_000_000] {
            let pose = frame.at(1_000 + offset_ns);
            let seen = pose.attitude.inverse() * (truth - pose.position_m);
            assert!((pose.place(&seen) - truth).norm() < 1e-12);
        }
        assert!((frame.at(1_000).attitude.angle() - 2.0 * 0.6_f64.asin()).abs() < 1e-12);
    }

    #[test]
    fn an_unknown_or_impossible_motion_leaves_the_sensors_own_axes() {
        let odd = [
            EgoMotion::default(),
            EgoMotion { known: 1, ..EgoMotion::default() },
            EgoMotion {
                known: 1,
                attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
                spin_radps: [f64::NAN; 3],
                ..EgoMotion::default()
            },
        ];
        for ego in odd {
            let frame = Frame::new(5, &ego);
            assert!(!frame.inertial);
            assert_eq!(frame.at(99).place(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(1.0, 2.0, 3.0));
        }
    }
}
