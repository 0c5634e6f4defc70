//! The four solids of the paper (Sec. III-A), each in a frame in which it has unit size, met by a ray in closed form.
//!
//! An obstacle's pose and size are folded into one matrix, so that a ray reaches these functions as `origin` and
//! `direction` in the unit frame. `direction` is not of unit length there: distances along it stay metres.

mod cone;
mod cuboid;
mod cylinder;
mod ellipsoid;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;

pub(crate) use cone::UnitCone;
pub(crate) use cuboid::UnitBox;
pub(crate) use cylinder::UnitCylinder;
pub(crate) use ellipsoid::UnitBall;

/// Where a ray meets a surface first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// Multiple of the ray's direction.
    pub(crate) distance: f64,
    /// Outward normal there, of any length; zero where there is none (a cone's apex).
    pub(crate) normal: Vector3<f64>,
}

impl Meeting {
    /// The meeting of a ray that starts inside a solid: at once, head-on.
    fn at_origin(direction: &Vector3<f64>) -> Self {
        Self { distance: 0.0, normal: -direction }
    }
}

/// Something that a ray can meet, in its own frame.
pub(crate) trait Surface {
    /// Nearest point of the surface ahead of `origin`, or none.
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting>;
}

/// Both real roots of `a t² + 2 b t + c`, in order, without cancellation; none where there are none.
///
/// For `a = 0` one of them is infinite; for `a = b = 0` both are NaN or infinite, and pass no comparison of bounds.
fn roots(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return None;
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    let (one, other) = (q / a, c / q);
    Some(if one < other { (one, other) } else { (other, one) })
}

/// Distances at which a ray is between the planes −1 and 1 of one axis. Empty (`near > far`) for a ray beside them.
fn slab(origin: f64, direction: f64) -> (f64, f64) {
    let inverse = 1.0 / direction;
    let (one, other) = ((-1.0 - origin) * inverse, (1.0 - origin) * inverse);
    // For direction = 0 these are infinite: of opposite sign between the planes, of one sign beside them.
    (one.min(other), one.max(other))
}
