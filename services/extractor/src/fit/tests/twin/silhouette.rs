use nalgebra::Vector3;

/// How far one ray passes outside a body's outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Passing {
    /// Positive outside; within, less the shortest way out [m].
    pub(crate) distance_m: f64,
    /// Outward normal of the outline where it is nearest: a unit vector across the ray, body frame.
    pub(crate) normal: Vector3<f64>,
    /// The point of the body that is seen there [m], body frame.
    pub(crate) point_m: Vector3<f64>,
}

/// A view across the ray of a body that is round about z: x level, y as near upright as can be.
pub(crate) struct Upright {
    level: Vector3<f64>,
    upright: Vector3<f64>,
    /// Where the ray is; x is mirrored to the right.
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// How much a height along z, and the depth of a level circle, are foreshortened.
    pub(crate) height: f64,
    pub(crate) depth: f64,
}

impl Upright {
    pub(crate) fn new(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Self {
        let level = (direction.x * direction.x + direction.y * direction.y).sqrt();
        let right =
            if level > 1e-9 { Vector3::new(-direction.y / level, direction.x / level, 0.0) } else { Vector3::x() };
        let upright = direction.cross(&right);
        let x = origin.dot(&right);
        let level_axis = if x < 0.0 { -right } else { right };
        Self {
            level: level_axis,
            upright,
            x: x.abs(),
            y: origin.dot(&upright),
            height: level,
            depth: direction.z.abs().max(1e-4),
        }
    }

    /// A direction of the view in the body frame.
    pub(crate) fn lift(&self, x: f64, y: f64) -> Vector3<f64> {
        self.level * x + self.upright * y
    }

    /// The point of the circle of radius `radius_m` at height `z_m` that is farthest along `normal`; its middle for an
    /// upright normal.
    pub(crate) fn on_rim(normal: &Vector3<f64>, radius_m: f64, z_m: f64) -> Vector3<f64> {
        let length = (normal.x * normal.x + normal.y * normal.y).sqrt();
        if length < 1e-12 {
            return Vector3::new(0.0, 0.0, z_m);
        }
        Vector3::new(normal.x / length * radius_m, normal.y / length * radius_m, z_m)
    }
}

/// Signed distance of a point to the ellipse (x/a)² + (y/b)² = 1, to first order, and the outward normal there.
pub(crate) fn ellipse(x: f64, y: f64, a: f64, b: f64) -> (f64, [f64; 2]) {
    let (u, v) = (x / a, y / b);
    let level = (u * u + v * v).sqrt();
    let (gx, gy) = (u / a, v / b);
    let slope = (gx * gx + gy * gy).sqrt();
    if slope < 1e-12 {
        return if a < b { (-a, [1.0, 0.0]) } else { (-b, [0.0, 1.0]) };
    }
    (level * (level - 1.0) / slope, [gx / slope, gy / slope])
}
