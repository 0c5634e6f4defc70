//! How the sensor itself moves.

use messages::EgoMotion;
use nalgebra::{UnitQuaternion, Vector3};

use crate::obstacle::Pose;

/// Constant velocity and constant spin of the sensor, in the inertial frame that is its own at time 0. At rest unless the
/// scene says otherwise.
///
/// Obstacles of a scene move relative to the sensor's place, along inertial axes; what turns is only the view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ego {
    /// Velocity [m/s], inertial frame.
    pub velocity_mps: Vector3<f64>,
    /// Angular velocity [rad/s]: the same in both frames, because the sensor turns about it.
    pub spin_radps: Vector3<f64>,
}

impl Ego {
    /// What a sweep's header says at `time_s`.
    pub fn motion(&self, time_s: f64) -> EgoMotion {
        let attitude = self.to_sensor(time_s).inverse();
        EgoMotion {
            position_m: (self.velocity_mps * time_s).into(),
            attitude_wxyz: [attitude.w, attitude.i, attitude.j, attitude.k],
            velocity_mps: self.velocity_mps.into(),
            spin_radps: self.spin_radps.into(),
            known: 1,
        }
    }

    /// Whether the sensor's axes turn.
    pub(crate) fn turns(&self) -> bool {
        self.spin_radps != Vector3::zeros()
    }

    /// Rotation from inertial to sensor axes at `time_s`.
    pub(crate) fn to_sensor(self, time_s: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(-self.spin_radps * time_s)
    }

    /// A pose along inertial axes as the sensor sees it at `time_s`.
    pub(crate) fn seen(&self, pose: &Pose, time_s: f64) -> Pose {
        let turn = self.to_sensor(time_s);
        Pose { position_m: turn * pose.position_m, attitude: turn * pose.attitude }
    }
}
