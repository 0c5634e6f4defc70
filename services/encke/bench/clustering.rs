//! The clusterer that is timed, and what every later stage starts from.

use std::hash::Hasher;

use clusterer::Clusterer;
use messages::{Clusters, MIN_FEATURE_POINTS, Message, Sweep};
use runtime::Plan;
use stage::Stage;

use super::stages::{PART, Rejected, zeroed};
use crate::cli::BenchArgs;
use crate::{Failure, dispatch};

/// The clusterer, and what it made last.
pub(super) struct Clustering {
    clusterer: Clusterer,
    /// Smaller clusters are left out before features are extracted; 0 where the extractor's own minimum is enough.
    min_points: u32,
    /// Clusters of the sweep, before smaller ones are left out.
    pub(super) found: usize,
    pub(super) clusters: Box<Clusters>,
}

impl Clustering {
    /// Builds the clusterer as its file and the command line say.
    pub(super) fn new(args: &BenchArgs, plan: &Plan) -> Result<Self, Failure> {
        Ok(Self {
            clusterer: clusterer(args, plan)?,
            min_points: args.min_points.filter(|&points| points as usize > MIN_FEATURE_POINTS).unwrap_or(0),
            found: 0,
            clusters: zeroed()?,
        })
    }

    pub(super) fn process(&mut self, sweep: &Sweep) -> Result<(), Rejected> {
        self.clusters.clear();
        let verdict = self.clusterer.process(PART, sweep, &mut self.clusters);
        self.found = self.clusters.clusters.len();
        if self.min_points > 0 {
            leave_out_smaller(&mut self.clusters, self.min_points);
        }
        Rejected::unless_taken(Clusterer::NAME, verdict)
    }

    pub(super) fn write(&self, hash: &mut dyn Hasher) {
        Self::write_clusters(&self.clusters, hash);
    }

    pub(super) fn write_clusters(clusters: &Clusters, hash: &mut dyn Hasher) {
        hash.write(clusters.clusters.item_bytes());
        hash.write(clusters.members.item_bytes());
        hash.write(clusters.cells.item_bytes());
    }
}

/// The clusterer, with what the command line says of it.
pub(super) fn clusterer(args: &BenchArgs, plan: &Plan) -> Result<Clusterer, Failure> {
    let flags = [args.range.map(|_| "--range"), args.min_points.map(|_| "--min-points")];
    let given: Vec<_> = flags.into_iter().flatten().collect();
    if given.is_empty() {
        return dispatch::init(plan, |_| Ok(()));
    }
    let mut params = dispatch::params::<Clusterer>(plan)?;
    params.range_d_m = args.range.unwrap_or(params.range_d_m);
    params.min_points = args.min_points.unwrap_or(params.min_points);
    Clusterer::init(params).map_err(|cause| Failure::start(format!("{}: {cause}", given.join(", "))))
}

/// Drops clusters of fewer points, with their returns. They have no cells: the clusterer has the same minimum.
fn leave_out_smaller(clusters: &mut Clusters, min_points: u32) {
    let (mut kept, mut members) = (0, 0);
    for place in 0..clusters.clusters.len() {
        let mut cluster = clusters.clusters[place];
        if cluster.summary.points < min_points {
            continue;
        }
        let places = cluster.summary.member_places();
        cluster.summary.first_member = members as u32;
        let count = places.len();
        clusters.returns.copy_within(places.clone(), members);
        clusters.members.copy_within(places, members);
        clusters.clusters[kept] = cluster;
        members += count;
        kept += 1;
    }
    clusters.clusters.truncate(kept);
    clusters.returns.truncate(members);
    clusters.members.truncate(members);
}

#[cfg(test)]
mod tests {
    use lidar::Return;
    use messages::{Cluster, ClusterSummary};

    use super::*;

    #[test]
    fn smaller_clusters_go_with_their_returns_and_the_others_keep_theirs() {
        let mut sut = zeroed::<Clusters>().unwrap();
        for points in [1, 3, 2, 4] {
            let first_member = sut.members.len() as u32;
            let summary = ClusterSummary { first_member, points, ..ClusterSummary::default() };
            sut.clusters.push(Cluster { summary, ..Cluster::default() }).unwrap();
            for member in first_member..first_member + points {
                sut.members.push(member).unwrap();
                sut.returns.push(Return { x: member as f32, ..Return::default() }).unwrap();
            }
        }
        leave_out_smaller(&mut sut, 3);
        let places: Vec<_> = sut.clusters.iter().map(|cluster| cluster.summary.member_places()).collect();
        assert_eq!(places, [0..3, 3..7]);
        assert_eq!(&sut.members[..], &[1, 2, 3, 6, 7, 8, 9]);
        assert!(sut.returns.iter().zip(&sut.members).all(|(r, &member)| r.x == member as f32));
        assert_eq!(sut.returns.len(), 7);
    }
}
