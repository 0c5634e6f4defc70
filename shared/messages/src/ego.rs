use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The sensor's own motion at the sweep's first firing, in an inertial frame. Zero bytes: not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct EgoMotion {
    /// Place of the sensor [m], inertial frame.
    pub position_m: [f64; 3],
    /// Rotation from sensor to inertial frame, unit quaternion.
    pub attitude_wxyz: [f64; 4],
    /// Velocity of the sensor [m/s], inertial frame.
    pub velocity_mps: [f64; 3],
    /// Angular velocity of the sensor [rad/s], inertial frame.
    pub spin_radps: [f64; 3],
    /// 1 when the motion is known.
    pub known: u64,
}

impl EgoMotion {
    /// The motion, where it is known.
    pub fn get(&self) -> Option<&Self> {
        (self.known != 0).then_some(self)
    }
}
