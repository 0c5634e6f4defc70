use std::cmp::Reverse;

use lidar::{MAX_RETURNS, MAX_RINGS, Return};
use messages::RELIEF;
use nalgebra::{SMatrix, SVector, Vector3};

/// Rings described: the one with most returns, and two to either side.
const RINGS: [isize; 5] = [0, 1, -1, 2, -2];
/// Numbers for each.
const PER_RING: usize = 9;
/// Smallest scale of a cluster [m].
const LEAST_SCALE_M: f64 = 0.05;
/// Weight of the curvatures of the quadric's ridge, per return.
const RIDGE: [f64; 6] = [0.0, 2e-5, 2e-5, 2e-3, 2e-3, 2e-3];

/// The surface of a cluster as the sensor sees it: depth over a plane across the view.
///
/// Across: u level, w upright; depth away from the sensor; all about the mean [m]. Mirrored so that depth rises with u and
/// most returns lie on the main ring and on the `upper` side of it, for a mirrored obstacle is of the same class.
#[derive(Debug)]
pub struct Relief {
    points: Vec<Point>,
    ring: Vec<Point>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Point {
    u: f64,
    w: f64,
    depth: f64,
    ring: usize,
}

impl Relief {
    /// Takes the memory for clusters of up to [`MAX_RETURNS`] returns.
    pub fn new() -> Self {
        Self { points: Vec::with_capacity(MAX_RETURNS), ring: Vec::with_capacity(MAX_RETURNS) }
    }

    /// Describes a cluster; all 0 for one without returns or round the sensor itself.
    ///
    /// For the main ring, then those 1 above, 1 below, 2 above, 2 below: number of returns; means of u, w and depth (from
    /// the main ring on: less the main ring's); width; slope and curvature of depth along u; largest and smallest second
    /// difference of depth. Then of all returns: scale (root mean square of u and w); slopes, curvatures and residual of the
    /// quadric over u and w in units of the scale; spread of u, covariance of u and w, spread of w; number of rings; skew
    /// of w; mean of u² w. What is not defined (a ring that is not there, a curvature of two returns) is 0.
    pub fn describe(&mut self, returns: &[Return]) -> [f32; RELIEF] {
        let mut relief = [0.0; RELIEF];
        if returns.is_empty() || !self.lay_out(returns) {
            return relief;
        }
        let mut counts = [0_u32; MAX_RINGS];
        for point in &self.points {
            counts[point.ring] += 1;
        }
        let main = (0..MAX_RINGS).max_by_key(|&ring| (counts[ring], Reverse(ring))).unwrap_or(0);
        let (below, above): (u32, u32) = (counts[..main].iter().sum(), counts[main + 1..].iter().sum());
        let upper = if above >= below { 1 } else { -1 };

        let mut numbers = relief.iter_mut();
        let mut put = |value: f64| {
            if let Some(number) = numbers.next() {
                *number = if value.is_finite() { value as f32 } else { 0.0 };
            }
        };
        let mut first = [0.0; PER_RING];
        for step in RINGS {
            let ring = main.checked_add_signed(step * upper).filter(|&ring| ring < MAX_RINGS);
            let mut along = ring.map_or([0.0; PER_RING], |ring| self.along_ring(ring, upper as f64));
            if step == 0 {
                first = along;
            } else if along[0] > 0.0 {
                for place in 1..4 {
                    along[place] -= first[place];
                }
            }
            along.into_iter().for_each(&mut put);
        }
        let rings = counts.iter().filter(|&&count| count > 0).count();
        self.over_all(upper as f64, rings).into_iter().for_each(&mut put);
        relief
    }

    /// Fills `points`; false where there is no view.
    fn lay_out(&mut self, returns: &[Return]) -> bool {
        let position = |r: &Return| Vector3::new(f64::from(r.x), f64::from(r.y), f64::from(r.z));
        let mean = returns.iter().map(position).sum::<Vector3<f64>>() / returns.len() as f64;
        let Some(view) = mean.try_normalize(1e-6) else { return false };
        let level = view.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let upright = level.cross(&view);
        self.points.clear();
        self.points.extend(returns.iter().take(MAX_RETURNS).map(|r| {
            let offset = position(r) - mean;
            let ring = usize::from(r.ring).min(MAX_RINGS - 1);
            Point { u: level.dot(&offset), w: upright.dot(&offset), depth: view.dot(&offset), ring }
        }));
        if self.points.iter().map(|p| p.u * p.depth).sum::<f64>() < 0.0 {
            self.points.iter_mut().for_each(|p| p.u = -p.u);
        }
        true
    }

    fn along_ring(&mut self, ring: usize, upper: f64) -> [f64; PER_RING] {
        let row = &mut self.ring;
        row.clear();
        row.extend(self.points.iter().filter(|p| p.ring == ring));
        if row.is_empty() {
            return [0.0; PER_RING];
        }
        row.sort_unstable_by(|a, b| a.u.total_cmp(&b.u).then(a.depth.total_cmp(&b.depth)));
        let count = row.len() as f64;
        let mean = |of: fn(&Point) -> f64| row.iter().map(of).sum::<f64>() / count;
        let (u, w, depth) = (mean(|p| p.u), mean(|p| p.w), mean(|p| p.depth));
        let moment = |power: i32, with: fn(f64) -> f64| {
            row.iter().map(|p| (p.u - u).powi(power) * with(p.depth - depth)).sum::<f64>()
        };
        let (s2, s3, s4) = (moment(2, |_| 1.0), moment(3, |_| 1.0), moment(4, |_| 1.0));
        let (d1, d2) = (moment(1, |d| d), moment(2, |d| d));
        let slope = if s2 > 1e-9 { d1 / s2 } else { 0.0 };
        // depth = c (u² − s2/n) + b u: the two normal equations, by Cramer's rule.
        let determinant = s2 * (s4 - s2 * s2 / count) - s3 * s3;
        let curvature = if row.len() > 2 && determinant > 1e-12 { (s2 * d2 - s3 * d1) / determinant } else { 0.0 };
        let bend = |by: fn(f64, f64) -> f64| {
            row.windows(3).map(|p| p[0].depth - 2.0 * p[1].depth + p[2].depth).reduce(by).unwrap_or(0.0)
        };
        let width = row[row.len() - 1].u - row[0].u;
        [count, u, w * upper, depth, width, slope, curvature, bend(f64::max), bend(f64::min)]
    }

    fn over_all(&self, upper: f64, rings: usize) -> [f64; 13] {
        let count = self.points.len() as f64;
        let mean = |of: fn(&Point) -> f64| self.points.iter().map(of).sum::<f64>() / count;
        let (uu, uw, ww) = (mean(|p| p.u * p.u), mean(|p| p.u * p.w), mean(|p| p.w * p.w));
        let scale = (uu + ww).sqrt().max(LEAST_SCALE_M);
        let row = |p: &Point| {
            let (u, w) = (p.u / scale, p.w / scale);
            SVector::from([1.0, u, w, u * u, u * w, w * w])
        };
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut right = SVector::<f64, 6>::zeros();
        for point in &self.points {
            let row = row(point);
            normal += row * row.transpose();
            right += row * point.depth;
        }
        for (axis, ridge) in RIDGE.into_iter().enumerate() {
            normal[(axis, axis)] += ridge * count;
        }
        let quadric = normal.cholesky().map_or_else(SVector::zeros, |factor| factor.solve(&right));
        let residual = self.points.iter().map(|p| (row(p).dot(&quadric) - p.depth).powi(2)).sum::<f64>() / count;
        let skew = mean(|p| p.w.powi(3)).abs() / ww.powf(1.5).max(1e-6);
        let lean = mean(|p| p.u * p.u * p.w) * upper;
        [
            scale,
            quadric[1],
            quadric[2] * upper,
            quadric[3],
            quadric[4] * upper,
            quadric[5],
            residual.sqrt(),
            uu.sqrt(),
            uw * upper,
            ww.sqrt(),
            rings as f64,
            skew,
            lean,
        ]
    }
}

impl Default for Relief {
    fn default() -> Self {
        Self::new()
    }
}
