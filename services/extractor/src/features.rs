use lidar::{MAX_RETURNS, Return};
use messages::MIN_FEATURE_POINTS;

use crate::{CheckedParams, Histogram, Neighbours, Phases, estimate_normals};

/// The paper's feature extraction (Sec. III-B) on one cluster at a time, with the memory it needs.
#[derive(Debug)]
pub struct Features {
    neighbours: Neighbours,
    histogram: Histogram,
    phases: Phases,
    normals: Vec<[f32; 3]>,
}

impl Features {
    /// Takes the memory for clusters of up to [`MAX_RETURNS`] points.
    pub fn new(params: &CheckedParams) -> Self {
        Self {
            neighbours: Neighbours::new(MAX_RETURNS, params.others),
            histogram: Histogram::new(MAX_RETURNS),
            phases: Phases::new(MAX_RETURNS),
            normals: vec![[0.0; 3]; MAX_RETURNS],
        }
    }

    /// Histogram of one cluster's returns (finite, no more than [`MAX_RETURNS`]), read in strides of `stride` columns;
    /// empty for fewer than [`MIN_FEATURE_POINTS`].
    ///
    /// Each phase of enough points adds its histogram: see [`Phases`].
    pub fn describe(&mut self, returns: &[Return], stride: usize) -> &Histogram {
        self.histogram.clear();
        if returns.len() < MIN_FEATURE_POINTS || returns.len() > MAX_RETURNS {
            return &self.histogram;
        }
        self.phases.part(returns, stride);
        for (points, rings) in self.phases.usable() {
            let normals = &mut self.normals[..points.len()];
            self.neighbours.find_in_rings(points, rings);
            estimate_normals(points, &self.neighbours, normals);
            self.histogram.add(points, normals, &self.neighbours);
        }
        &self.histogram
    }
}
