//! Slow twins and callable invariants, for tests of this room and of the whole chain.

use messages::{Cell, CellKind, Clusters, Sweep};

use crate::distance::squared_m2;

/// For each return the place of the first return of its component, by comparing all pairs: O(n²).
///
/// The oracle of every method. Allocates.
pub fn brute_force_roots(sweep: &Sweep, range_d_m: f32) -> Vec<u32> {
    let returns = &sweep.returns[..];
    let mut root: Vec<u32> = (0..returns.len() as u32).collect();
    fn find(root: &[u32], mut place: u32) -> u32 {
        while root[place as usize] != place {
            place = root[place as usize];
        }
        place
    }
    for later in 0..returns.len() {
        for earlier in 0..later {
            if squared_m2(returns[later].position(), returns[earlier].position()) <= range_d_m * range_d_m {
                let (a, b) = (find(&root, later as u32), find(&root, earlier as u32));
                root[a.max(b) as usize] = a.min(b);
                root[later] = a.min(b);
            }
        }
    }
    (0..root.len() as u32).map(|place| find(&root, place)).collect()
}

/// For each return of the sweep the place of the first return of its cluster, read from the message.
///
/// # Errors
/// The first invariant that the message breaks: every return in exactly one cluster, clusters in order of keys, members
/// in order of index, `returns` parallel to `members`, counts and places that fit.
pub fn roots_of(sweep: &Sweep, clusters: &Clusters) -> Result<Vec<u32>, String> {
    let count = sweep.returns.len();
    if clusters.members.len() != count || clusters.returns.len() != count {
        return Err(format!("{} members, {} returns of {count}", clusters.members.len(), clusters.returns.len()));
    }
    let place_of: std::collections::BTreeMap<u32, u32> =
        (0..count).map(|place| (sweep.index_of(place), place as u32)).collect();
    let mut roots = vec![u32::MAX; count];
    let (mut next_member, mut next_cell, mut last_key) = (0, 0, None);
    for (number, cluster) in clusters.clusters.iter().enumerate() {
        let summary = cluster.summary;
        let fail = |what: &str| Err(format!("cluster {number}: {what}: {cluster:?}"));
        if summary.first_member != next_member || summary.points == 0 {
            return fail("members do not follow those before");
        }
        next_member += summary.points;
        if cluster.cells != 0 && cluster.first_cell != next_cell {
            return fail("cells do not follow those before");
        }
        next_cell += cluster.cells;
        let Some(members) = clusters.members.get(summary.member_places()) else { return fail("places out of range") };
        if members[0] != summary.key || last_key >= Some(summary.key) || !members.windows(2).all(|m| m[0] < m[1]) {
            return fail("keys or members out of order");
        }
        last_key = Some(summary.key);
        let key_place = place_of.get(&summary.key).copied();
        for (member, at) in members.iter().zip(summary.member_places()) {
            let Some(&place) = place_of.get(member) else { return fail("member that the sweep does not have") };
            if clusters.returns[at] != sweep.returns[place as usize] {
                return fail("return that is not its member's");
            }
            roots[place as usize] = key_place.unwrap_or(u32::MAX);
        }
    }
    if next_member as usize != count || next_cell as usize != clusters.cells.len() {
        return Err(format!("{next_member} members and {next_cell} cells in clusters"));
    }
    Ok(roots)
}

/// The cells round cluster `number` by their definition: O(rings × columns × members). Azimuths are left at 0.
pub fn brute_force_cells(sweep: &Sweep, clusters: &Clusters, number: usize) -> Vec<Cell> {
    let members = &clusters.returns[clusters.clusters[number].summary.member_places()];
    let columns = sweep.columns.len() as i32;
    let complete = sweep.header.is_complete();
    let (from, to) = if complete { (0, columns) } else { (-2, columns + 2) };
    let mut cells = Vec::new();
    for column in from..to {
        for ring in 0..sweep.rings.len() as i32 {
            let away = |r: &lidar::Return| {
                let straight = (i32::from(r.column) - column).abs();
                let columns = if complete { straight.min(columns - straight) } else { straight };
                (columns, (i32::from(r.ring) - ring).abs())
            };
            let near = |&(columns, rings): &(i32, i32)| columns <= 2 && rings <= 2;
            let close: Vec<_> = members.iter().map(|r| (away(r), r)).filter(|(away, _)| near(away)).collect();
            if close.is_empty() || close.iter().any(|&(away, _)| away == (0, 0)) {
                continue;
            }
            // The first of several minima: members are in order of index.
            let nearest = close.iter().min_by_key(|((columns, rings), _)| columns * columns + rings * rings);
            let received =
                usize::try_from(column).ok().and_then(|c| sweep.columns.get(c)).is_some_and(|c| c.valid != 0);
            let there = sweep.returns.iter().filter(|r| i32::from(r.column) == column && i32::from(r.ring) == ring);
            let range_m = there.map(|r| r.range_m()).min_by(f32::total_cmp);
            let kind = match (received, range_m, nearest) {
                (false, ..) => CellKind::Unknown,
                (true, Some(range_m), Some((_, member))) if range_m < member.range_m() => CellKind::Nearer,
                (true, Some(_), _) => CellKind::Farther,
                (true, None, _) => CellKind::Miss,
            };
            let column = column as u16; // two's complement before the first
            let range_m = range_m.unwrap_or(0.0);
            cells.push(Cell { azimuth_rad: 0.0, range_m, column, ring: ring as u8, kind });
        }
    }
    cells
}
