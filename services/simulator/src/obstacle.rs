//! An obstacle: what it is, where it is at any time, how bright it is.

use std::sync::Arc;

use lidar::ObstacleClass;
use messages::SolidKind;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::mesh::Mesh;

/// The four solids (paper, Sec. III-A).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Box; size is its three edges.
    Box,
    /// Ellipsoid; size is its three diameters.
    Ellipsoid,
    /// Circular cylinder along z; size is diameter, diameter, height.
    Cylinder,
    /// Circular cone along z, apex up; size is diameter, diameter, height; its centre is half-way up.
    Cone,
}

impl Shape {
    /// The four, in the paper's order.
    pub const ALL: [Self; 4] = [Self::Box, Self::Ellipsoid, Self::Cylinder, Self::Cone];

    /// The shape's name in the truth.
    pub const fn kind(self) -> SolidKind {
        match self {
            Self::Box => SolidKind::Box,
            Self::Ellipsoid => SolidKind::Ellipsoid,
            Self::Cylinder => SolidKind::Cylinder,
            Self::Cone => SolidKind::Cone,
        }
    }

    /// The class that a classifier should give it.
    pub const fn class(self) -> ObstacleClass {
        match self {
            Self::Box => ObstacleClass::Rectangular,
            Self::Ellipsoid => ObstacleClass::Ellipsoidal,
            Self::Cylinder => ObstacleClass::Cylindrical,
            Self::Cone => ObstacleClass::Conical,
        }
    }

    /// Whether its first two sizes are one diameter.
    pub const fn is_round(self) -> bool {
        matches!(self, Self::Cylinder | Self::Cone)
    }

    /// Radius of the smallest ball round its centre [m], for its full extents [m].
    pub fn bounding_radius_m(self, size_m: &Vector3<f64>) -> f64 {
        match self {
            Self::Box => 0.5 * size_m.norm(),
            Self::Ellipsoid => 0.5 * size_m.max(),
            Self::Cylinder | Self::Cone => 0.5 * size_m.x.hypot(size_m.z),
        }
    }
}

/// What an obstacle is made of.
#[derive(Clone, Debug)]
pub enum Body {
    /// A solid with its full extents along its axes [m].
    Solid {
        /// Which.
        shape: Shape,
        /// Full extents along the body's axes [m], positive; x = y for cylinder and cone.
        size_m: Vector3<f64>,
    },
    /// A triangle mesh; its frame's origin is the middle of its box.
    Mesh(Arc<Mesh>),
}

impl Body {
    /// Full extents along the body's axes [m].
    pub fn size_m(&self) -> Vector3<f64> {
        match self {
            Self::Solid { size_m, .. } => *size_m,
            Self::Mesh(mesh) => mesh.size_m(),
        }
    }

    /// Radius of a ball round the body's centre that holds all of it [m].
    pub fn bounding_radius_m(&self) -> f64 {
        match self {
            Self::Solid { shape, size_m } => shape.bounding_radius_m(size_m),
            Self::Mesh(mesh) => mesh.bounding_radius_m(),
        }
    }

    /// The body's name in the truth.
    pub fn kind(&self) -> SolidKind {
        match self {
            Self::Solid { shape, .. } => shape.kind(),
            Self::Mesh(_) => SolidKind::Mesh,
        }
    }

    /// The class that a classifier should give it; `Unclassified` for meshes.
    pub fn class(&self) -> ObstacleClass {
        match self {
            Self::Solid { shape, .. } => shape.class(),
            Self::Mesh(_) => ObstacleClass::Unclassified,
        }
    }
}

/// One obstacle of a scene.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// What it is made of.
    pub body: Body,
    /// Where it is when.
    pub motion: Motion,
    /// Share of light that it sends back, in (0, 1].
    pub albedo: f64,
}

/// Constant velocity and constant spin: a closed function of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Centre at time 0 [m], sensor frame.
    pub position_m: Vector3<f64>,
    /// Rotation from body to sensor frame at time 0.
    pub attitude: UnitQuaternion<f64>,
    /// Velocity of the centre [m/s], sensor frame.
    pub velocity_mps: Vector3<f64>,
    /// Angular velocity [rad/s], sensor frame.
    pub spin_radps: Vector3<f64>,
}

/// Place and attitude at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Centre [m], sensor frame.
    pub position_m: Vector3<f64>,
    /// Rotation from body to sensor frame.
    pub attitude: UnitQuaternion<f64>,
}

impl Motion {
    /// At rest for ever.
    pub fn at_rest(position_m: Vector3<f64>, attitude: UnitQuaternion<f64>) -> Self {
        Self { position_m, attitude, velocity_mps: Vector3::zeros(), spin_radps: Vector3::zeros() }
    }

    /// The pose at `time_s` ≥ 0. An obstacle that leaves the ball of `horizon_m` round the sensor comes in again where
    /// its straight path entered that ball: a scene with drift never empties. `position_m` must lie inside the ball.
    pub fn pose(&self, time_s: f64, horizon_m: f64) -> Pose {
        let along_s = match self.crossing_s(horizon_m) {
            Some([enters, leaves]) if time_s >= leaves => enters + (time_s - enters).rem_euclid(leaves - enters),
            _ => time_s,
        };
        Pose {
            position_m: self.position_m + self.velocity_mps * along_s,
            attitude: self.turned(&self.attitude, time_s),
        }
    }

    /// `attitude` after `duration_s` of this spin.
    pub(crate) fn turned(&self, attitude: &UnitQuaternion<f64>, duration_s: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.spin_radps * duration_s) * attitude
    }

    /// When the straight path enters (≤ 0) and leaves (≥ 0) the ball of `horizon_m` [s]; none at rest.
    fn crossing_s(&self, horizon_m: f64) -> Option<[f64; 2]> {
        let a = self.velocity_mps.norm_squared();
        if a == 0.0 {
            return None;
        }
        // |p + t v| = horizon.
        let b = self.position_m.dot(&self.velocity_mps);
        let c = self.position_m.norm_squared() - horizon_m * horizon_m;
        let root = (b * b - a * c).sqrt();
        (root > 0.0).then(|| [(-b - root) / a, (-b + root) / a])
    }

    /// Least distance of the whole straight path from the sensor [m], before and after time 0.
    pub fn closest_approach_m(&self) -> f64 {
        let speed_squared = self.velocity_mps.norm_squared();
        if speed_squared == 0.0 {
            return self.position_m.norm();
        }
        let along = self.position_m.dot(&self.velocity_mps) / speed_squared;
        (self.position_m - self.velocity_mps * along).norm()
    }
}
