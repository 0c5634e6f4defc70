use messages::Clusters;

/// Drops clusters of more returns than `most_points`, with their returns and cells.
pub(crate) fn leave_out_larger(clusters: &mut Clusters, most_points: u32) {
    let (mut kept, mut members, mut cells) = (0, 0, 0);
    for place in 0..clusters.clusters.len() {
        let mut cluster = clusters.clusters[place];
        if cluster.summary.points > most_points {
            continue;
        }
        let (places, cell_places) = (cluster.summary.member_places(), cluster.cell_places());
        cluster.summary.first_member = members as u32;
        if cluster.cells > 0 {
            cluster.first_cell = cells as u32;
        }
        let counts = (places.len(), cell_places.len());
        clusters.returns.copy_within(places.clone(), members);
        clusters.members.copy_within(places, members);
        clusters.cells.copy_within(cell_places, cells);
        clusters.clusters[kept] = cluster;
        (members, cells) = (members + counts.0, cells + counts.1);
        kept += 1;
    }
    clusters.clusters.truncate(kept);
    clusters.returns.truncate(members);
    clusters.members.truncate(members);
    clusters.cells.truncate(cells);
}

#[cfg(test)]
mod tests {
    use lidar::Return;
    use messages::{Cell, Cluster, ClusterSummary};
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn larger_clusters_go_with_their_returns_and_cells_and_the_others_keep_theirs() {
        let mut sut = Clusters::new_box_zeroed().unwrap();
        for points in [4, 1, 3, 2] {
            let (first_member, first_cell) = (sut.members.len() as u32, sut.cells.len() as u32);
            let summary = ClusterSummary { first_member, points, ..ClusterSummary::default() };
            sut.clusters.push(Cluster { summary, first_cell, cells: 2 * points }).unwrap();
            for member in first_member..first_member + points {
                sut.members.push(member).unwrap();
                sut.returns.push(Return { x: member as f32, ..Return::default() }).unwrap();
            }
            for cell in first_cell..first_cell + 2 * points {
                sut.cells.push(Cell { column: cell as u16, ..Cell::default() }).unwrap();
            }
        }
        leave_out_larger(&mut sut, 2);
        let places: Vec<_> = sut.clusters.iter().map(|c| (c.summary.member_places(), c.cell_places())).collect();
        assert_eq!(places, [(0..1, 0..2), (1..3, 2..6)]);
        assert_eq!(&sut.members[..], &[4, 8, 9]);
        assert!(sut.returns.iter().zip(&sut.members).all(|(r, &member)| r.x == member as f32));
        let columns: Vec<u16> = sut.cells.iter().map(|cell| cell.column).collect();
        assert_eq!(columns, [8, 9, 16, 17, 18, 19]);
    }
}
