use std::ops::Range;

use pulp::Arch;

use crate::blocks::Blocks;
use crate::kd_tree::KdTree;

/// Most neighbours of a point, itself not counted: what [`messages::MAX_BINS`] leaves room for.
pub const MAX_OTHERS: usize = 5;

/// Up to this many points no order is asked for: all blocks of them are looked at.
const FEW: usize = 128;

/// The nearest neighbours of every point of a cluster, exact.
///
/// Neighbours are ordered by squared distance as `f32` computes it, `(dx² + dy²) + dz²`, then by index; so the result
/// depends on the points alone and equals a brute-force search to the bit, by whichever way it is found: small clusters and
/// those with rings by blocks of points side by side, large ones without rings in a k-d tree. Memory is taken once, in
/// [`Neighbours::new`].
#[derive(Debug)]
pub struct Neighbours {
    arch: Arch,
    capacity: usize,
    wanted: usize,
    blocks: Blocks,
    tree: KdTree,
    found: Found,
}

/// Neighbours of each point, as many as `each`, nearest first.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) each: usize,
    pub(crate) near: Vec<u32>,
    pub(crate) distance_m: Vec<f32>,
}

impl Neighbours {
    /// Room for clusters of up to `capacity` points, each with `others` neighbours (1 to [`MAX_OTHERS`]; more are cut).
    pub fn new(capacity: usize, others: usize) -> Self {
        let wanted = others.clamp(1, MAX_OTHERS);
        let found = Found { each: 0, near: vec![0; capacity * wanted], distance_m: vec![0.0; capacity * wanted] };
        Self { arch: Arch::new(), capacity, wanted, blocks: Blocks::new(capacity), tree: KdTree::new(capacity), found }
    }

    /// Finds the neighbours of every point [m], in any order; each has as many as were asked for, or all others where there
    /// are fewer.
    ///
    /// Points must be finite, and no more than the capacity: what is over is left out.
    pub fn find(&mut self, points: &[[f32; 3]]) {
        let points = self.begin(points);
        if points.len() <= FEW {
            self.blocks.lay_out(points);
            self.blocks.find(self.arch, &mut self.found);
            return;
        }
        let found = &mut self.found;
        self.tree.find(points, found.each, |index, best| {
            let from = index * found.each;
            for (rank, &(distance2, other)) in best.iter().enumerate() {
                found.near[from + rank] = other;
                found.distance_m[from + rank] = distance2.sqrt();
            }
        });
    }

    /// Finds the same, faster, given each point's ring, points of a ring being in order of azimuth: whatever they are, the
    /// neighbours are those of [`Neighbours::find`]. `rings` must be as many as the points, else they are not used.
    pub fn find_in_rings(&mut self, points: &[[f32; 3]], rings: &[u8]) {
        if points.len() <= FEW || points.len() != rings.len() {
            return self.find(points);
        }
        let points = self.begin(points);
        self.blocks.lay_out_by_ring(points, &rings[..points.len()]);
        self.blocks.find(self.arch, &mut self.found);
    }

    /// Neighbours of the point at `index`, nearest first: places in the slice given to [`Neighbours::find`].
    pub fn of(&self, index: usize) -> &[u32] {
        &self.found.near[index * self.found.each..(index + 1) * self.found.each]
    }

    /// Distances of [`Neighbours::of`] [m].
    pub fn distances_m(&self, index: usize) -> &[f32] {
        &self.found.distance_m[index * self.found.each..(index + 1) * self.found.each]
    }

    /// Neighbours and their distances [m] of several points, one after the other.
    pub(crate) fn of_range(&self, points: Range<usize>) -> (&[u32], &[f32]) {
        let places = points.start * self.found.each..points.end * self.found.each;
        (&self.found.near[places.clone()], &self.found.distance_m[places])
    }

    /// Neighbours that each point has.
    pub(crate) fn each(&self) -> usize {
        self.found.each
    }

    /// How this machine computes.
    pub(crate) fn arch(&self) -> Arch {
        self.arch
    }

    fn begin<'a>(&mut self, points: &'a [[f32; 3]]) -> &'a [[f32; 3]] {
        let points = &points[..points.len().min(self.capacity)];
        self.found.each = self.wanted.min(points.len().saturating_sub(1));
        points
    }
}
