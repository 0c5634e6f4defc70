use lidar::{MAX_RETURNS, Return};
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, Message, SweepHeader};

/// Most clusters of a sweep: every return alone. Cannot overflow.
pub const MAX_CLUSTERS: usize = MAX_RETURNS;

/// Most cells round the clusters of a sweep.
pub const MAX_CELLS: usize = 262_144;

/// What every later message says of a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct ClusterSummary {
    /// The cluster's key: the smallest index in the sweep among its returns. The order of clusters is the order of keys.
    pub key: u32,
    /// Place of its first member in the message's `members`.
    pub first_member: u32,
    /// Number of returns; at least 1.
    pub points: u32,
    /// Number of different rings among them; 0 in an unorganised sweep.
    pub rings: u32,
    /// Time of its last return after the start of the sweep [ns].
    pub last_offset_ns: u32,
    /// 1 when the window of one of its returns touches the first or last column: it could close only with the sweep.
    pub seam: u32,
    /// Mean of its returns [m].
    pub centroid_m: [f32; 3],
}

impl ClusterSummary {
    /// Places of its members in the message's `members` (and `returns`).
    pub fn member_places(&self) -> std::ops::Range<usize> {
        self.first_member as usize..(self.first_member + self.points) as usize
    }

    /// Distance of the centroid [m].
    pub fn range_m(&self) -> f32 {
        let [x, y, z] = self.centroid_m;
        (x * x + y * y + z * z).sqrt()
    }
}

/// One cluster and the cells round it.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Cluster {
    /// What later messages repeat.
    pub summary: ClusterSummary,
    /// Place of its first cell in `cells`.
    pub first_cell: u32,
    /// Number of its cells; 0 for clusters under the minimum of points and in unorganised sweeps.
    pub cells: u32,
}

impl Cluster {
    /// Places of its cells in the message's `cells`.
    pub fn cell_places(&self) -> std::ops::Range<usize> {
        self.first_cell as usize..(self.first_cell + self.cells) as usize
    }
}

/// What a cell near a cluster holds, seen from the nearest member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(u8)]
pub enum CellKind {
    /// Not known: the column was not received, or lies beyond the sweep's ends.
    #[default]
    Unknown = 0,
    /// The firing returned nothing.
    Miss = 1,
    /// A return nearer than the nearest member: it may hide the cluster.
    Nearer = 2,
    /// A return farther than the nearest member: the ray passed the cluster by.
    Farther = 3,
}

/// A firing within two cells (ring and column) of a member that is no member itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Cell {
    /// Azimuth of the firing [rad], counter-clockwise from +x.
    pub azimuth_rad: f32,
    /// Range of its return [m]; 0 for `Miss` and `Unknown`.
    pub range_m: f32,
    /// Column in the sweep.
    pub column: u16,
    /// Ring.
    pub ring: u8,
    /// What it holds.
    pub kind: CellKind,
}

/// Obstacles of a sweep (or those that closed with one of its sectors), in order of their keys.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Clusters {
    /// As in the sweep.
    pub header: SweepHeader,
    /// Columns of a complete sweep, whose first follows its last; 0 where the sweep is incomplete or has none.
    pub turn_columns: u64,
    /// Elevation of each ring [rad], as in the sweep; empty in an unorganised sweep.
    pub ring_elevation_rad: Bounded<f32, { lidar::MAX_RINGS }>,
    /// The clusters.
    pub clusters: Bounded<Cluster, MAX_CLUSTERS>,
    /// Their returns: cluster after cluster, within a cluster in order of index.
    pub returns: Bounded<Return, MAX_RETURNS>,
    /// Index in the sweep of each of `returns`.
    pub members: Bounded<u32, MAX_RETURNS>,
    /// Cells round the clusters: cluster after cluster, within a cluster by column, then ring.
    pub cells: Bounded<Cell, MAX_CELLS>,
}

impl Message for Clusters {
    const TYPE: &'static str = "encke.Clusters.4";

    fn clear(&mut self) {
        self.header = SweepHeader::default();
        self.turn_columns = 0;
        self.ring_elevation_rad.clear();
        self.clusters.clear();
        self.returns.clear();
        self.members.clear();
        self.cells.clear();
    }
}
