use nalgebra::{Matrix3, Vector3};
use pulp::Simd;

use super::silhouette::Passing;
use super::wide::{Which, Wide, WideVector};

/// The four solids of the paper (Sec. III-A), in the order of [`lidar::ObstacleClass::SOLIDS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Rectangular.
    Cuboid = 0,
    /// Ellipsoidal.
    Ellipsoid = 1,
    /// Cylindrical.
    Cylinder = 2,
    /// Conical.
    Cone = 3,
}

impl Kind {
    /// The four, in order.
    pub(crate) const ALL: [Self; 4] = [Self::Cuboid, Self::Ellipsoid, Self::Cylinder, Self::Cone];

    /// Whether it looks the same turned about z.
    pub(crate) const fn is_round(self) -> bool {
        matches!(self, Self::Cylinder | Self::Cone)
    }
}

/// Where rays meet a surface first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting<S: Simd> {
    /// The rays that meet it; of the others what follows says nothing.
    pub(crate) found: Which<S>,
    /// Multiple of the ray's direction.
    pub(crate) distance: Wide<S>,
    /// Outward normal there, of any length.
    pub(crate) normal: WideVector<S>,
}

/// A convex solid scaled to unit half extents. A body of half extents (a, b, c) is this one with its axes stretched by
/// them, so all derivatives follow from two functions: a point x of the surface with normal n moves outwards by n·δ when
/// the body moves by δ, by n·(ω × x) when it turns by ω, and by `n_k x_k` when ln of half extent k grows by one.
pub(crate) trait UnitSolid {
    /// Whether it looks the same turned about z: then a = b, and that turn is no parameter.
    const ROUND: bool;

    /// The nearest point of the surface ahead of rays whose origin lies outside.
    fn meet<S: Simd>(origin: WideVector<S>, direction: WideVector<S>) -> Meeting<S>;

    /// How rays pass the body of these half extents; all in the body's frame, in metres.
    fn pass<S: Simd>(half_m: WideVector<S>, origin: WideVector<S>, direction: WideVector<S>) -> Passing<S>;

    /// Radius of the ball round the body's middle that holds it [m].
    fn bounding_radius(half_m: &Vector3<f64>) -> f64;
}

/// Runs `$work` with `$S` standing for the solid of a [`Kind`].
macro_rules! for_kind {
    ($kind:expr, $S:ident => $work:expr) => {
        match $kind {
            $crate::fit::Kind::Cuboid => {
                type $S = $crate::fit::cuboid::Cuboid;
                $work
            }
            $crate::fit::Kind::Ellipsoid => {
                type $S = $crate::fit::ellipsoid::Ellipsoid;
                $work
            }
            $crate::fit::Kind::Cylinder => {
                type $S = $crate::fit::cylinder::Cylinder;
                $work
            }
            $crate::fit::Kind::Cone => {
                type $S = $crate::fit::cone::Cone;
                $work
            }
        }
    };
}
pub(crate) use for_kind;

/// Pose and size of a body: what the fit estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    /// Middle of its box [m], sensor frame.
    pub(crate) centre_m: Vector3<f64>,
    /// From the body's axes to the sensor frame.
    pub(crate) rotation: Matrix3<f64>,
    /// ln of the half extents along the body's axes, ln m; the first two equal for cylinder and cone.
    pub(crate) ln_half: Vector3<f64>,
}
