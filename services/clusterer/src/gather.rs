use lidar::MAX_RETURNS;
use messages::{Cluster, ClusterSummary, Clusters};

use crate::partition::Partition;
use crate::seam::Seam;
use crate::seen::Seen;

/// No cluster yet.
pub(crate) const OPEN: u32 = u32::MAX;

/// Lays closed sets out as clusters: in order of keys, members in order of index.
pub(crate) struct Gather {
    seam: Seam,
    /// Key of each return's cluster; [`OPEN`] where that has not closed.
    cluster_of: Vec<u32>,
    /// A cluster's returns, a bit a place in the sweep; all zero between clusters.
    members: Vec<u64>,
}

impl Gather {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self {
            seam: Seam::new(range_d_m),
            cluster_of: Vec::with_capacity(MAX_RETURNS),
            members: vec![0; MAX_RETURNS.div_ceil(64)],
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn begin(&mut self) {
        self.cluster_of.clear();
    }

    /// Fills everything but the cells of what closed into an empty message. What closes before the `last` part lies off the
    /// seam.
    pub(crate) fn fill(&mut self, seen: &Seen, partition: &Partition, last: bool, output: &mut Clusters) {
        self.cluster_of.resize(seen.returns.len(), OPEN);
        if last && seen.header.is_organised() {
            self.seam.measure(seen);
        }
        for &root in partition.closed() {
            let first = output.returns.len();
            self.push_members(seen, partition, root, output);
            let cluster = Cluster { summary: self.summary(seen, first, last, output), ..Cluster::default() };
            // Nothing can be full: there are at most as many clusters and members as returns.
            let _ = output.clusters.push(cluster);
        }
    }

    /// Key of the cluster of each return seen; [`OPEN`] where that has not closed.
    pub(crate) fn cluster_of(&self) -> &[u32] {
        &self.cluster_of
    }

    /// Runs come in no order and overlap, so their returns are put in order as bits.
    fn push_members(&mut self, seen: &Seen, partition: &Partition, root: u32, output: &mut Clusters) {
        let runs = partition.runs();
        let key = seen.index_of(runs.places(root)[0] as usize);
        if runs.places(root).len() == partition.sets().extent(root).points as usize {
            for &place in runs.places(root) {
                self.push_member(seen, place, key, output);
            }
            return;
        }
        let (mut low, mut high) = (usize::MAX, 0);
        for run in partition.sets().members(root) {
            let places = runs.places(run);
            for &place in places {
                self.members[place as usize / 64] |= 1 << (place % 64);
            }
            let (Some(first), Some(last)) = (places.first(), places.last()) else { continue };
            (low, high) = (low.min(*first as usize / 64), high.max(*last as usize / 64));
        }
        for word in low..=high {
            let mut bits = std::mem::take(&mut self.members[word]);
            while bits != 0 {
                self.push_member(seen, (word * 64) as u32 + bits.trailing_zeros(), key, output);
                bits &= bits - 1;
            }
        }
    }

    #[inline]
    fn push_member(&mut self, seen: &Seen, place: u32, key: u32, output: &mut Clusters) {
        self.cluster_of[place as usize] = key;
        let _ = output.returns.push(seen.returns[place as usize]);
        let _ = output.members.push(seen.index_of(place as usize));
    }

    /// Of the cluster whose returns are those from `first` on.
    fn summary(&self, seen: &Seen, first: usize, last: bool, output: &Clusters) -> ClusterSummary {
        let organised = seen.header.is_organised();
        let returns = &output.returns[first..];
        let (mut rings, mut last_offset_ns, mut seam) = (0_u64, 0, false);
        let mut sum = [0.0_f64; 3];
        for r in returns {
            sum = [sum[0] + f64::from(r.x), sum[1] + f64::from(r.y), sum[2] + f64::from(r.z)];
            if organised {
                rings |= 1 << r.ring;
                let (column, ring) = (seen.columns[usize::from(r.column)], seen.rings[usize::from(r.ring)]);
                last_offset_ns = last_offset_ns.max(column.offset_ns.saturating_add(ring.offset_ns));
                seam |= last && self.seam.touches(r);
            }
        }
        ClusterSummary {
            key: output.members[first],
            first_member: first as u32,
            points: returns.len() as u32,
            rings: rings.count_ones(),
            // A cloud without firing times is complete with its period.
            last_offset_ns: if organised { last_offset_ns } else { seen.header.period_ns.min(u32::MAX.into()) as u32 },
            seam: u32::from(seam || !organised),
            centroid_m: sum.map(|sum| (sum / returns.len() as f64) as f32),
        }
    }
}
