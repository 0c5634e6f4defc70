use lidar::{MAX_RETURNS, ObstacleClass};
use zerocopy::{FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, Message};

/// Most obstacles of a scene.
pub const MAX_TRUTH_OBJECTS: usize = 1_024;

/// The owner of a return that belongs to no obstacle.
pub const NO_OBJECT: u16 = u16::MAX;

/// What a true obstacle is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(u8)]
pub enum SolidKind {
    /// Box; size is its three edges.
    #[default]
    Box = 0,
    /// Ellipsoid; size is its three diameters.
    Ellipsoid = 1,
    /// Cylinder along z; size is diameter, diameter, height.
    Cylinder = 2,
    /// Cone along z, apex up; size is diameter, diameter, height; the centre is half-way up.
    Cone = 3,
    /// Triangle mesh; size is its box in the body frame.
    Mesh = 4,
}

/// One obstacle as it truly is, at the sweep's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct TruthObject {
    /// Centre [m], sensor frame.
    pub centre_m: [f32; 3],
    /// Rotation from body to sensor frame, unit quaternion.
    pub attitude_wxyz: [f32; 4],
    /// Full extents along the body's axes [m].
    pub size_m: [f32; 3],
    /// Velocity of the centre [m/s], sensor frame.
    pub velocity_mps: [f32; 3],
    /// Angular velocity [rad/s], sensor frame.
    pub spin_radps: [f32; 3],
    /// Returns of this sweep that lie on it.
    pub returns: u32,
    /// Identity through the sweeps of a run.
    pub id: u16,
    /// Its shape.
    pub kind: SolidKind,
    /// The class it should be given; `Unclassified` for meshes.
    pub class: ObstacleClass,
}

/// What the simulator knows of a sweep. No stage may read it.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Truth {
    /// Sensor time of the poses: the sweep's first firing [ns].
    pub sensor_time_ns: u64,
    /// The obstacles, in order of `id`.
    pub objects: Bounded<TruthObject, MAX_TRUTH_OBJECTS>,
    /// `id` of the obstacle that each return of the sweep lies on, or [`NO_OBJECT`].
    pub owners: Bounded<u16, MAX_RETURNS>,
}

impl Truth {
    /// Makes this truth the same as another.
    pub fn copy_from(&mut self, other: &Self) {
        self.clear();
        self.sensor_time_ns = other.sensor_time_ns;
        // As large as the other: both fit.
        let _ = self.objects.extend_from_slice(&other.objects);
        let _ = self.owners.extend_from_slice(&other.owners);
    }
}

impl Message for Truth {
    const TYPE: &'static str = "encke.Truth.1";

    fn clear(&mut self) {
        self.sensor_time_ns = 0;
        self.objects.clear();
        self.owners.clear();
    }
}
