use crate::blocks::{Blocks, Boxes, LANES, Lanes, ROW};
use crate::neighbours::Found;

/// No candidate: beyond every other.
const NONE: f64 = f64::from_bits(((f32::INFINITY.to_bits() as u64) << 32) | u32::MAX as u64);

/// A block of points and the nearest of each so far.
///
/// A candidate is one number, its squared distance in the upper half of its bits and its index in the lower: read as `f64`
/// (all are positive, none NaN, for an exponent of `f32` never fills that of `f64`), numbers are ordered by distance, then
/// by index, and a sorted list is kept by minima and maxima alone.
#[repr(C, align(64))]
pub(crate) struct Query<const K: usize> {
    best: [[f64; LANES]; K],
    at: [Lanes; 3],
    index: [u32; LANES],
    /// Squared distance beyond which a lane needs nothing more.
    enough: Lanes,
    low: [f32; 3],
    high: [f32; 3],
}

impl<const K: usize> Query<K> {
    #[inline(always)]
    pub(crate) fn new(blocks: &Blocks, block: usize) -> Self {
        let boxes = &blocks.boxes[block / ROW];
        Self {
            at: blocks.blocks[block].at,
            index: blocks.blocks[block].index,
            low: std::array::from_fn(|axis| boxes.low[axis][block % ROW]),
            high: std::array::from_fn(|axis| boxes.high[axis][block % ROW]),
            best: [[NONE; LANES]; K],
            enough: [f32::INFINITY; LANES],
        }
    }

    /// Offers the block's own points to each other.
    #[inline(always)]
    pub(crate) fn visit_own(&mut self, blocks: &Blocks, block: usize) {
        for place in 0..blocks.held(block) {
            let other = blocks.blocks[block].index[place];
            let distance2 = self.distances2(blocks, block, place);
            let mut candidate = [NONE; LANES];
            for lane in 0..LANES {
                candidate[lane] = if self.index[lane] == other { NONE } else { joined(distance2[lane], other) };
            }
            self.insert(candidate);
        }
    }

    /// Offers another block's points.
    #[inline(always)]
    pub(crate) fn visit(&mut self, blocks: &Blocks, block: usize) {
        for place in 0..blocks.held(block) {
            let other = blocks.blocks[block].index[place];
            let distance2 = self.distances2(blocks, block, place);
            let mut near = false;
            for (distance2, enough) in distance2.iter().zip(&self.enough) {
                near |= distance2 <= enough;
            }
            if near {
                self.insert(distance2.map(|distance2| joined(distance2, other)));
            }
        }
    }

    /// Offers all blocks that are near enough, but for these.
    #[inline(always)]
    pub(crate) fn visit_near(&mut self, blocks: &Blocks, seen: std::ops::RangeInclusive<usize>) {
        let count = blocks.count.div_ceil(LANES);
        let mut worst2 = self.worst2();
        for (group, of_rows) in blocks.rows[..count.div_ceil(ROW * ROW)].iter().enumerate() {
            let bounds = self.bounds2(of_rows);
            for (row, &bound) in (group * ROW..count.div_ceil(ROW)).zip(&bounds) {
                if bound > worst2 {
                    continue;
                }
                let bounds = self.bounds2(&blocks.boxes[row]);
                for (block, &bound) in (row * ROW..count).zip(&bounds) {
                    if bound <= worst2 && !seen.contains(&block) && self.reaches(&blocks.boxes[row], block % ROW) {
                        self.visit(blocks, block);
                        worst2 = self.worst2();
                    }
                }
            }
        }
    }

    /// Squared distances of the block's points from one candidate.
    #[inline(always)]
    fn distances2(&self, blocks: &Blocks, block: usize, place: usize) -> Lanes {
        let [x, y, z] = std::array::from_fn(|axis| blocks.blocks[block].at[axis][place]);
        std::array::from_fn(|lane| {
            let (dx, dy, dz) = (self.at[0][lane] - x, self.at[1][lane] - y, self.at[2][lane] - z);
            (dx * dx + dy * dy) + dz * dz
        })
    }

    /// Lower bounds of the squared distance between any point of this block and any in each of the boxes.
    ///
    /// Rounding is monotone and sums go in the same order as in `distances2`, so no nearer point can hide behind a bound;
    /// equality must be looked into, for a smaller index may lie there.
    #[inline(always)]
    fn bounds2(&self, boxes: &Boxes) -> Lanes {
        std::array::from_fn(|lane| {
            let [dx, dy, dz] = std::array::from_fn(|axis| {
                let (above, below) = (boxes.low[axis][lane] - self.high[axis], self.low[axis] - boxes.high[axis][lane]);
                let gap = if above > below { above } else { below };
                if gap > 0.0 { gap } else { 0.0 }
            });
            (dx * dx + dy * dy) + dz * dz
        })
    }

    /// Whether any lane's point is near enough to one of the boxes: as `bounds2`, point by point.
    #[inline(always)]
    fn reaches(&self, boxes: &Boxes, place: usize) -> bool {
        let mut reaches = false;
        for lane in 0..LANES {
            let [dx, dy, dz] = std::array::from_fn(|axis| {
                let at = self.at[axis][lane];
                let (above, below) = (boxes.low[axis][place] - at, at - boxes.high[axis][place]);
                let gap = if above > below { above } else { below };
                if gap > 0.0 { gap } else { 0.0 }
            });
            reaches |= (dx * dx + dy * dy) + dz * dz <= self.enough[lane];
        }
        reaches
    }

    #[inline(always)]
    fn worst2(&self) -> f32 {
        let mut most = self.enough;
        for half in [LANES / 2, LANES / 4, LANES / 8, LANES / 16] {
            for lane in 0..half {
                most[lane] = if most[lane] > most[lane + half] { most[lane] } else { most[lane + half] };
            }
        }
        most[0]
    }

    /// Keeps the nearest `K` of each lane in order.
    #[inline(always)]
    fn insert(&mut self, mut candidate: [f64; LANES]) {
        for level in &mut self.best {
            for lane in 0..LANES {
                let (held, new) = (level[lane], candidate[lane]);
                level[lane] = if new < held { new } else { held };
                candidate[lane] = if held > new { held } else { new };
            }
        }
        for lane in 0..LANES {
            self.enough[lane] = f32::from_bits((self.best[K - 1][lane].to_bits() >> 32) as u32);
        }
    }

    /// Writes what was found, distances still squared: all roots are taken at once, which is faster.
    #[inline(always)]
    pub(crate) fn write(&self, blocks: &Blocks, block: usize, found: &mut Found) {
        for lane in 0..blocks.held(block) {
            let from = self.index[lane] as usize * found.each;
            for (rank, level) in self.best.iter().enumerate().take(found.each) {
                let bits = level[lane].to_bits();
                found.near[from + rank] = bits as u32;
                found.distance_m[from + rank] = f32::from_bits((bits >> 32) as u32);
            }
        }
    }
}

/// A candidate as one number that orders by distance, then by index.
#[inline(always)]
fn joined(distance2: f32, index: u32) -> f64 {
    f64::from_bits((u64::from(distance2.to_bits()) << 32) | u64::from(index))
}
