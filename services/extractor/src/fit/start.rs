use nalgebra::{Matrix3, Vector3};

use super::frames::any_across;
use super::{Body, Ray};

/// Direction from the sensor to the mean of some hits (at least one); to the first where the sensor is their mean.
pub(crate) fn view(mean_m: &Vector3<f64>, hits: &[Ray]) -> Vector3<f64> {
    mean_m.try_normalize(1e-9).unwrap_or(hits[0].direction)
}

/// Points of a cluster as starts are made from them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cloud<'a> {
    hits: &'a [Ray],
    mean_m: Vector3<f64>,
    view: Vector3<f64>,
}

impl<'a> Cloud<'a> {
    pub(crate) fn new(hits: &'a [Ray]) -> Self {
        let mean_m: Vector3<f64> = hits.iter().map(Ray::end_m).sum::<Vector3<f64>>() / hits.len() as f64;
        Self { hits, mean_m, view: view(&mean_m, hits) }
    }

    /// A body with the given axes whose near faces lie at the points.
    pub(crate) fn body(&self, rotation: &Matrix3<f64>) -> Body {
        let (low, high) = self.extents(rotation);
        let half = self.half(&low, &high);
        self.place(rotation, &low, &high, half)
    }

    /// A round body about an axis; its x axis lies in the plane of axis and view.
    pub(crate) fn round_body(&self, axis: &Vector3<f64>) -> Body {
        let across = self.view - axis * axis.dot(&self.view);
        let length = across.norm();
        let first = if length > 0.1 { across / length } else { any_across(axis) };
        let rotation = Matrix3::from_columns(&[first, axis.cross(&first), *axis]);
        let (low, high) = self.extents(&rotation);
        let mut half = self.half(&low, &high);
        // The side away is not seen: what is seen across the view is a better radius than what is seen along it.
        half.x = if length > 0.5 { half.y.max(0.5 * half.x) } else { half.x.max(half.y) };
        half.y = half.x;
        self.place(&rotation, &low, &high, half)
    }

    fn extents(&self, rotation: &Matrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for hit in self.hits {
            let there = rotation.tr_mul(&(hit.end_m() - self.mean_m));
            low = low.inf(&there);
            high = high.sup(&there);
        }
        (low, high)
    }

    fn half(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> Vector3<f64> {
        let half = (high - low) * 0.5;
        let largest = half.max().max(0.15);
        half.map(|h| h.clamp(0.5 * largest, 3.5_f64.max(0.5 * largest)))
    }

    fn place(&self, rotation: &Matrix3<f64>, low: &Vector3<f64>, high: &Vector3<f64>, half: Vector3<f64>) -> Body {
        let view = rotation.tr_mul(&self.view);
        let middle = Vector3::from_fn(|axis, _| {
            if view[axis] > 0.1 {
                low[axis] + half[axis]
            } else if view[axis] < -0.1 {
                high[axis] - half[axis]
            } else {
                0.5 * (low[axis] + high[axis])
            }
        });
        Body { centre_m: self.mean_m + rotation * middle, rotation: *rotation, ln_half: half.map(f64::ln) }
    }
}
