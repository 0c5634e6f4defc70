use lidar::{MAX_RETURNS, ObstacleClass};
use zerocopy::{FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, ClusterSummary, MAX_CLUSTERS, Message, SweepHeader};

/// A cluster with its class.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Detection {
    /// The cluster.
    pub summary: ClusterSummary,
    /// Probability of each of [`ObstacleClass::SOLIDS`]; sums to 1, or all 0 for `Unclassified`.
    pub posterior: [f32; 4],
    /// The verdict.
    pub class: ObstacleClass,
    /// Fills the struct to a multiple of its alignment.
    pub reserved: [u8; 3],
}

/// Classified obstacles of a sweep, in order of the clusters' keys.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Detections {
    /// As in the sweep.
    pub header: SweepHeader,
    /// One for each cluster.
    pub detections: Bounded<Detection, MAX_CLUSTERS>,
    /// As in the clusters.
    pub members: Bounded<u32, MAX_RETURNS>,
}

impl Message for Detections {
    const TYPE: &'static str = "encke.Detections.1";

    fn clear(&mut self) {
        self.header = SweepHeader::default();
        self.detections.clear();
        self.members.clear();
    }
}
