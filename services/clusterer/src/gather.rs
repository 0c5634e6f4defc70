use lidar::MAX_RETURNS;
use messages::{Cluster, ClusterSummary, Clusters, Sweep};

use crate::seam::Seam;

/// Lays a partition out as clusters: in order of keys, members in order of index.
pub(crate) struct Gather {
    seam: Seam,
    /// Number of each return's cluster.
    cluster: Vec<u32>,
    /// Next free place in the message of each cluster.
    next: Vec<u32>,
    /// Places of the returns in the sweep, cluster after cluster.
    order: Vec<u32>,
}

impl Gather {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self {
            seam: Seam::new(range_d_m),
            cluster: Vec::with_capacity(MAX_RETURNS),
            next: Vec::with_capacity(MAX_RETURNS),
            order: Vec::with_capacity(MAX_RETURNS),
        }
    }

    /// Fills everything but the cells of an empty message. `roots` has the place of its component's first return for
    /// each return.
    pub(crate) fn fill(&mut self, sweep: &Sweep, roots: &[u32], output: &mut Clusters) {
        self.sort(roots);
        if sweep.header.is_organised() {
            self.seam.measure(sweep);
        }
        // Nothing below can be full: there are at most as many clusters and members as returns.
        for &place in &self.order {
            let _ = output.returns.push(sweep.returns[place as usize]);
            let _ = output.members.push(sweep.index_of(place as usize));
        }
        let mut first = 0_u32;
        for &end in &self.next {
            let cluster = Cluster { summary: self.summary(sweep, first, end, output), ..Cluster::default() };
            let _ = output.clusters.push(cluster);
            first = end;
        }
    }

    /// Number of the cluster of each return of the sweep filled in last.
    pub(crate) fn cluster_of(&self) -> &[u32] {
        &self.cluster
    }

    /// Counting sort. A component's root is its first return, so numbering roots as they come orders clusters by key.
    fn sort(&mut self, roots: &[u32]) {
        self.cluster.clear();
        self.next.clear();
        for (place, &root) in roots.iter().enumerate() {
            if root as usize == place {
                self.cluster.push(self.next.len() as u32);
                self.next.push(0);
            } else {
                self.cluster.push(self.cluster[root as usize]);
            }
            self.next[self.cluster[place] as usize] += 1;
        }
        let mut first = 0;
        for next in &mut self.next {
            first += std::mem::replace(next, first);
        }
        self.order.clear();
        self.order.resize(roots.len(), 0);
        for (place, &cluster) in self.cluster.iter().enumerate() {
            let next = &mut self.next[cluster as usize];
            self.order[*next as usize] = place as u32;
            *next += 1; // in the end the end of its cluster
        }
    }

    fn summary(&self, sweep: &Sweep, first: u32, end: u32, output: &Clusters) -> ClusterSummary {
        let places = first as usize..end as usize;
        let organised = sweep.header.is_organised();
        let (mut rings, mut last_offset_ns, mut seam) = (0_u64, 0, false);
        let mut sum = [0.0_f64; 3];
        for r in &output.returns[places.clone()] {
            sum = [sum[0] + f64::from(r.x), sum[1] + f64::from(r.y), sum[2] + f64::from(r.z)];
            if organised {
                rings |= 1 << r.ring;
                let (column, ring) = (sweep.columns[usize::from(r.column)], sweep.rings[usize::from(r.ring)]);
                last_offset_ns = last_offset_ns.max(column.offset_ns.saturating_add(ring.offset_ns));
                seam |= self.seam.touches(r);
            }
        }
        ClusterSummary {
            key: output.members[places.start],
            first_member: first,
            points: end - first,
            rings: rings.count_ones(),
            // A cloud without firing times is complete with its period.
            last_offset_ns: if organised { last_offset_ns } else { sweep.header.period_ns.min(u32::MAX.into()) as u32 },
            seam: u32::from(seam || !organised),
            centroid_m: sum.map(|sum| (sum / f64::from(end - first)) as f32),
        }
    }
}
