//! The cells round each cluster: what the firings beside its returns saw.

use lidar::{MAX_COLUMNS, MAX_RETURNS, MAX_RINGS};
use messages::{Cell, CellKind, Cluster, Clusters, Verdict};

use crate::field::Field;
use crate::seen::Seen;

/// Where nothing was returned.
const NOBODY: u32 = u32::MAX;

/// How far from a member a cell lies at most, in rings and in columns.
pub(crate) const REACH: usize = 2;
/// Columns within reach, the cell's own included.
const COLUMNS: usize = 2 * REACH + 1;
/// Beyond all spots.
const NO_SPOT: usize = usize::MAX;
/// Columns from two before the sweep to two past it.
const MOST_SPOTS: usize = MAX_COLUMNS + 2 * REACH;

/// The other cells of the square round one, those equally near together, nearest first: a bit a cell, ring by ring and
/// column after column.
const NEAREST_FIRST: [u32; 5] = [at_distance(1), at_distance(2), at_distance(4), at_distance(5), at_distance(8)];

/// The cells of the square at a sum of squares of rings and columns.
const fn at_distance(sum: isize) -> u32 {
    let (mut cells, mut bit) = (0, 0);
    while bit < COLUMNS * COLUMNS {
        let columns = (bit / COLUMNS) as isize - REACH as isize;
        let rings = (bit % COLUMNS) as isize - REACH as isize;
        if columns * columns + rings * rings == sum {
            cells |= 1 << bit;
        }
        bit += 1;
    }
    cells
}

/// Finds the cells. Columns are numbered by *spot*: two before the sweep's first, so that those exist too.
///
/// A complete sweep wraps round: its first column follows its last. Cells past the ends of an incomplete one are
/// `Unknown`; those past its end are numbered on, those before its start count down from `u16::MAX` and come first.
///
/// Where a firing gave several returns, the nearest is the cell's. It is judged against the member nearest in cells (by
/// the sum of squares of rings and columns between; among equals the one with the smallest index): `Nearer` when its
/// range is smaller, else `Farther`.
pub(crate) struct Cells {
    min_points: usize,
    /// First return of each pixel, by column and ring.
    pixel: Vec<u32>,
    /// Next return of the same pixel.
    next: Vec<u32>,
    /// The cluster's members of each spot, a bit a ring; all zero between clusters.
    members: Vec<u64>,
    /// The spots with cells, a bit a spot; all zero between clusters.
    spots: Vec<u64>,
}

impl Cells {
    pub(crate) fn new(min_points: usize) -> Self {
        Self {
            min_points,
            pixel: Vec::with_capacity(MAX_RINGS * MAX_COLUMNS),
            next: Vec::with_capacity(MAX_RETURNS),
            members: vec![0; MOST_SPOTS],
            spots: vec![0; MOST_SPOTS.div_ceil(64)],
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn begin(&mut self) {
        self.pixel.clear();
        self.next.clear();
    }

    /// Adds the cells of all clusters of at least the minimum of points. Once those of a cluster do not fit, neither
    /// it nor a later one gets any.
    ///
    /// `cluster_of` has the key of each return's cluster. Of the columns within two of a cluster's
    /// nothing may be missing but what lies beyond the ends of the sweep, which may wrap round only where it is `last`.
    pub(crate) fn fill(
        &mut self,
        seen: &Seen,
        cluster_of: &[u32],
        sense: f32,
        last: bool,
        output: &mut Clusters,
    ) -> Verdict {
        if !seen.header.is_organised() || seen.returns.is_empty() {
            return Verdict::Complete;
        }
        self.index(seen);
        let mut field = Field::new(seen, cluster_of, sense, last);
        for number in 0..output.clusters.len() {
            let cluster = output.clusters[number];
            if (cluster.summary.points as usize) < self.min_points {
                continue;
            }
            let first = output.cells.len();
            let fits = self.fill_cluster(&mut field, &cluster, output);
            if !fits {
                output.cells.truncate(first);
                return Verdict::PartialCells;
            }
            output.clusters[number].first_cell = first as u32;
            output.clusters[number].cells = (output.cells.len() - first) as u32;
        }
        Verdict::Complete
    }

    /// Adds the returns that were not seen before.
    fn index(&mut self, seen: &Seen) {
        let (rings, known) = (seen.rings.len(), self.next.len());
        self.pixel.resize(rings * seen.columns.len(), NOBODY);
        self.next.resize(seen.returns.len(), NOBODY);
        // From the back, so that each pixel's list runs in order of index.
        for (place, r) in seen.returns.iter().enumerate().skip(known).rev() {
            let pixel = &mut self.pixel[usize::from(r.column) * rings + usize::from(r.ring)];
            self.next[place] = std::mem::replace(pixel, place as u32);
        }
    }

    /// False when the message is full; then some of the cells are in it.
    fn fill_cluster(&mut self, field: &mut Field, cluster: &Cluster, output: &mut Clusters) -> bool {
        let places = cluster.summary.member_places();
        let (mut low, mut high) = (usize::MAX, 0);
        field.cluster = cluster.summary.key;
        let mut newest = NO_SPOT;
        for r in &output.returns[places.clone()] {
            let spot = usize::from(r.column) + REACH;
            self.members[spot] |= 1 << r.ring;
            if spot == newest {
                continue;
            }
            newest = spot;
            for near in -(REACH as isize)..=REACH as isize {
                let near = field.spot(spot, near);
                self.spots[near / 64] |= 1 << (near % 64);
                (low, high) = (low.min(near / 64), high.max(near / 64));
            }
        }
        let mut fits = true;
        for word in low..=high {
            let mut bits = std::mem::take(&mut self.spots[word]);
            while bits != 0 && fits {
                fits = self.fill_spot(field, word * 64 + bits.trailing_zeros() as usize, output);
                bits &= bits - 1;
            }
        }
        newest = NO_SPOT;
        for r in &output.returns[places] {
            let spot = usize::from(r.column) + REACH;
            if spot != newest {
                self.members[spot] = 0;
            }
            newest = spot;
        }
        fits
    }

    /// The cells of one column, by ring.
    fn fill_spot(&self, field: &Field, spot: usize, output: &mut Clusters) -> bool {
        let around = self.around(field, spot);
        let near = around.members.iter().fold(0, |near, members| near | members);
        let mut cells = (near | near << 1 | near << 2 | near >> 1 | near >> 2) & field.ring_bits & !self.members[spot];
        let axis = field.axis(spot);
        while cells != 0 {
            let ring = cells.trailing_zeros() as usize;
            let cell = Cell {
                azimuth_rad: axis.azimuth_rad(field, ring),
                range_m: 0.0,
                column: (spot as u16).wrapping_sub(REACH as u16),
                ring: ring as u8,
                kind: CellKind::Unknown,
            };
            if output.cells.push(self.seen(field, &around, ring, cell)).is_err() {
                return false;
            }
            cells &= cells - 1;
        }
        true
    }

    /// The columns round a spot.
    fn around(&self, field: &Field, spot: usize) -> Around {
        let mut around = Around { received: [None; COLUMNS], members: [0; COLUMNS] };
        for (place, columns) in (-(REACH as isize)..=REACH as isize).enumerate() {
            if let Some(there) = field.spot_if_any(spot, columns) {
                around.received[place] = field.received(there);
                around.members[place] = self.members[there];
            }
        }
        around
    }

    /// A cell with what its firing saw.
    fn seen(&self, field: &Field, around: &Around, ring: usize, cell: Cell) -> Cell {
        let Some(column) = around.received[REACH] else { return cell };
        let there = self.returns_at(field, ring, column).map(|place| field.seen.returns[place].range_m());
        let Some(range_m) = there.min_by(f32::total_cmp) else { return Cell { kind: CellKind::Miss, ..cell } };
        let member = self.nearest_member(field, around, ring);
        let nearer = member.is_some_and(|place| range_m < field.seen.returns[place].range_m());
        Cell { range_m, kind: if nearer { CellKind::Nearer } else { CellKind::Farther }, ..cell }
    }

    /// Place of the member nearest to a cell; of those equally near the smallest.
    fn nearest_member(&self, field: &Field, around: &Around, ring: usize) -> Option<usize> {
        let mut square = 0_u32;
        for (place, &members) in around.members.iter().enumerate() {
            // Two rings below the first, so that those exist too.
            let rings = (u128::from(members) << REACH >> ring) as u32 & ((1 << COLUMNS) - 1);
            square |= rings << (COLUMNS * place);
        }
        let mut nearest = NEAREST_FIRST.iter().map(|cells| cells & square).find(|&cells| cells != 0)?;
        let mut best = None;
        while nearest != 0 {
            let bit = nearest.trailing_zeros() as usize;
            let (columns, rings) = (bit / COLUMNS, bit % COLUMNS);
            let column = around.received[columns]?;
            let mut there = self.returns_at(field, ring + rings - REACH, column);
            let place = there.find(|&place| field.cluster_of[place] == field.cluster);
            best = best.into_iter().chain(place).min();
            nearest &= nearest - 1;
        }
        best
    }

    /// Places of the returns of a firing, in order.
    fn returns_at(&self, field: &Field, ring: usize, column: usize) -> impl Iterator<Item = usize> {
        let first = self.pixel[column * field.rings + ring];
        std::iter::successors(Some(first), |&place| self.next.get(place as usize).copied())
            .take_while(|&place| place != NOBODY)
            .map(|place| place as usize)
    }
}

/// The columns within two of a spot.
struct Around {
    /// Those that were received.
    received: [Option<usize>; COLUMNS],
    /// The cluster's members, a bit a ring.
    members: [u64; COLUMNS],
}
