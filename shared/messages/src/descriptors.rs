use lidar::MAX_RETURNS;
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, ClusterSummary, Fit, MAX_CLUSTERS, MAX_FITS, Message, SweepHeader};

/// Fewest points of a cluster from which features are extracted (paper, Sec. III-B.3).
pub const MIN_FEATURE_POINTS: usize = 5;

/// Most histogram bins of a sweep: five neighbour pairs a return, each in a bin of its own. Cannot overflow.
pub const MAX_BINS: usize = 5 * MAX_RETURNS;

/// One non-zero bin of a cluster's joint histogram.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Bin {
    /// Joint index of the three angles, 0 to 1727.
    pub index: u32,
    /// Weight; those of a cluster sum to 1.
    pub weight: f32,
}

/// What the extractor says of one cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Descriptor {
    /// The cluster.
    pub summary: ClusterSummary,
    /// Place of its first bin in `bins`.
    pub first_bin: u32,
    /// Number of its bins, in order of index; 0 where no histogram was made.
    pub bins: u32,
    /// Place of its fit in `fits`.
    pub first_fit: u32,
    /// 1 where solids were fitted, else 0.
    pub fits: u32,
}

impl Descriptor {
    /// Places of its bins in the message's `bins`.
    pub fn bin_places(&self) -> std::ops::Range<usize> {
        self.first_bin as usize..(self.first_bin + self.bins) as usize
    }

    /// Place of its fit in the message's `fits`, if it has one.
    pub fn fit_place(&self) -> Option<usize> {
        (self.fits > 0).then_some(self.first_fit as usize)
    }
}

/// Features of each cluster of a sweep, in order of the clusters' keys.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Descriptors {
    /// As in the sweep.
    pub header: SweepHeader,
    /// One for each cluster.
    pub descriptors: Bounded<Descriptor, MAX_CLUSTERS>,
    /// As in the clusters.
    pub members: Bounded<u32, MAX_RETURNS>,
    /// Bins: descriptor after descriptor.
    pub bins: Bounded<Bin, MAX_BINS>,
    /// Fitted solids, in the order of their descriptors.
    pub fits: Bounded<Fit, MAX_FITS>,
}

impl Message for Descriptors {
    const TYPE: &'static str = "encke.Descriptors.4";

    fn clear(&mut self) {
        self.header = SweepHeader::default();
        self.descriptors.clear();
        self.members.clear();
        self.bins.clear();
        self.fits.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_and_fit_have_places_only_where_there_are_some() {
        let none = Descriptor { first_bin: 5, first_fit: 7, ..Descriptor::default() };
        assert_eq!((none.bin_places(), none.fit_place()), (5..5, None));
        let both = Descriptor { bins: 2, fits: 1, ..none };
        assert_eq!((both.bin_places(), both.fit_place()), (5..7, Some(7)));
    }
}
