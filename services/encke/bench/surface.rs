//! The extractor's `process` in two halves: neighbours and normals, then the histogram.

use std::hash::Hasher;

use extractor::{CheckedParams, Histogram, Neighbours, Phases, column_stride, estimate_normals};
use lidar::MAX_RETURNS;
use messages::{Bin, Clusters, MIN_FEATURE_POINTS};
use zerocopy::IntoBytes;

/// Points that the extractor looks at together: one phase of a cluster.
struct Patch {
    points: Vec<[f32; 3]>,
    rings: Vec<u8>,
    normals: Vec<[f32; 3]>,
    /// Kept for the histogram, which is timed without the search.
    neighbours: Neighbours,
}

/// A sweep's clusters with features, and the memory to describe them.
pub(super) struct Surface {
    others: usize,
    spacing_rad: f32,
    neighbours: Neighbours,
    histogram: Histogram,
    /// The patches of each cluster.
    clusters: Vec<Vec<Patch>>,
    bins: Vec<Bin>,
}

impl Surface {
    pub(super) fn new(params: &CheckedParams) -> Self {
        Self {
            others: params.others,
            spacing_rad: params.spacing_rad,
            neighbours: Neighbours::new(MAX_RETURNS, params.others),
            histogram: Histogram::new(MAX_RETURNS),
            clusters: Vec::new(),
            bins: Vec::new(),
        }
    }

    /// Takes another sweep's clusters and finds their neighbours.
    pub(super) fn load(&mut self, clusters: &Clusters) {
        let stride = column_stride(&clusters.header, self.spacing_rad);
        let large = clusters.clusters.iter().filter(|cluster| cluster.summary.points as usize >= MIN_FEATURE_POINTS);
        let others = self.others;
        let patch = |(points, rings): (&[[f32; 3]], &[u8])| {
            let mut neighbours = Neighbours::new(points.len(), others);
            neighbours.find_in_rings(points, rings);
            let normals = vec![[0.0; 3]; points.len()];
            Patch { points: points.to_vec(), rings: rings.to_vec(), normals, neighbours }
        };
        let mut phases = Phases::new(MAX_RETURNS);
        self.clusters = large
            .map(|cluster| &clusters.returns[cluster.summary.member_places()])
            .map(|returns| {
                phases.part(returns, stride);
                phases.usable().map(patch).collect()
            })
            .collect();
    }

    /// Clusters with features.
    pub(super) fn described(&self) -> usize {
        self.clusters.len()
    }

    /// Neighbours anew, in the one memory that all clusters share, as in the extractor; and normals.
    pub(super) fn normals(&mut self) {
        for patch in self.clusters.iter_mut().flatten() {
            self.neighbours.find_in_rings(&patch.points, &patch.rings);
            estimate_normals(&patch.points, &self.neighbours, &mut patch.normals);
        }
    }

    /// The histogram of every cluster.
    pub(super) fn histogram(&mut self) {
        self.bins.clear();
        for cluster in &self.clusters {
            self.histogram.clear();
            for patch in cluster {
                self.histogram.add(&patch.points, &patch.normals, &patch.neighbours);
            }
            self.bins.extend(self.histogram.bins());
        }
    }

    /// What [`Surface::histogram`] left, cluster after cluster.
    pub(super) fn bins(&self) -> &[Bin] {
        &self.bins
    }

    pub(super) fn write_normals(&self, hash: &mut dyn Hasher) {
        for patch in self.clusters.iter().flatten() {
            hash.write(patch.normals.as_bytes());
        }
    }
}
