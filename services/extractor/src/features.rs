use lidar::{MAX_RETURNS, Return};
use messages::MIN_FEATURE_POINTS;

use crate::stride::served_stride;
use crate::{CheckedParams, Histogram, Neighbours, estimate_normals};

/// The paper's feature extraction (Sec. III-B) on one cluster at a time, with the memory it needs.
#[derive(Debug)]
pub struct Features {
    neighbours: Neighbours,
    histogram: Histogram,
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Features {
    /// Takes the memory for clusters of up to [`MAX_RETURNS`] points.
    pub fn new(params: &CheckedParams) -> Self {
        Self {
            neighbours: Neighbours::new(MAX_RETURNS, params.others),
            histogram: Histogram::new(MAX_RETURNS),
            points: Vec::with_capacity(MAX_RETURNS),
            normals: vec![[0.0; 3]; MAX_RETURNS],
        }
    }

    /// Histogram of one cluster's returns (finite, no more than [`MAX_RETURNS`]), read in strides of `stride` columns;
    /// empty for fewer than [`MIN_FEATURE_POINTS`].
    ///
    /// Returns whose columns are equal modulo the stride make one phase: a cluster as a sensor with `stride` times fewer
    /// columns would see it. Each phase of enough points adds its histogram. Where none has enough, the stride is lessened
    /// until one has.
    pub fn describe(&mut self, returns: &[Return], stride: usize) -> &Histogram {
        self.histogram.clear();
        if returns.len() < MIN_FEATURE_POINTS || returns.len() > MAX_RETURNS {
            return &self.histogram;
        }
        let stride = served_stride(returns, stride);
        for phase in 0..stride {
            let on_phase = |r: &&Return| usize::from(r.column) % stride == phase;
            self.points.clear();
            self.points.extend(returns.iter().filter(on_phase).map(Return::position));
            if self.points.len() >= MIN_FEATURE_POINTS {
                self.add_points();
            }
        }
        &self.histogram
    }

    fn add_points(&mut self) {
        let normals = &mut self.normals[..self.points.len()];
        self.neighbours.find(&self.points);
        estimate_normals(&self.points, &self.neighbours, normals);
        self.histogram.add(&self.points, normals, &self.neighbours);
    }
}
