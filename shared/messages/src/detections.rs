use lidar::{MAX_RETURNS, ObstacleClass};
use zerocopy::{FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, ClusterSummary, MAX_CLUSTERS, MAX_FITS, Message, Solid, SweepHeader};

/// A cluster with its class.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Detection {
    /// The cluster.
    pub summary: ClusterSummary,
    /// Probability of each of [`ObstacleClass::SOLIDS`]; sums to 1, or all 0 for `Unclassified`.
    pub posterior: [f32; 4],
    /// Place of its solid in `solids`.
    pub first_solid: u32,
    /// 1 where a solid of its class was fitted, else 0.
    pub solids: u32,
    /// The verdict.
    pub class: ObstacleClass,
    /// Fills the struct to a multiple of its alignment.
    pub reserved: [u8; 3],
}

impl Detection {
    /// Place of its solid in the message's `solids`, if it has one.
    pub fn solid_place(&self) -> Option<usize> {
        (self.solids > 0).then_some(self.first_solid as usize)
    }
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
    /// Pose and size of those that have one, in the order of their detections.
    pub solids: Bounded<Solid, MAX_FITS>,
}

impl Detections {
    /// Makes these detections the same as others.
    pub fn copy_from(&mut self, other: &Self) {
        self.clear();
        self.header = other.header;
        // As large as the others: all fit.
        let _ = self.detections.extend_from_slice(&other.detections);
        let _ = self.members.extend_from_slice(&other.members);
        let _ = self.solids.extend_from_slice(&other.solids);
    }
}

impl Message for Detections {
    const TYPE: &'static str = "encke.Detections.4";

    fn clear(&mut self) {
        self.header = SweepHeader::default();
        self.detections.clear();
        self.members.clear();
        self.solids.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solid_has_a_place_only_where_there_is_one() {
        let none = Detection { first_solid: 7, ..Detection::default() };
        assert_eq!(none.solid_place(), None);
        assert_eq!(Detection { solids: 1, ..none }.solid_place(), Some(7));
    }
}
