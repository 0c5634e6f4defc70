use pulp::{Arch, Simd, WithSimd};

use crate::neighbours::{Found, MAX_OTHERS};

/// Points of a block, and queries that are answered side by side.
const LANES: usize = 16;
/// Blocks of a row.
const ROW: usize = 16;
/// Rings that a `u8` can name.
const RINGS: usize = 256;

/// One number for each point of a block, or each block of a row.
type Lanes = [f32; LANES];

/// Neighbours by exhaustive search over blocks of [`LANES`] points, leaving out those whose bounding box is too far.
///
/// A query is a whole block: every lane holds one point and its nearest so far. Exact for any order of the points; fast
/// where points that follow each other are near each other.
///
/// A candidate is one number, its squared distance in the upper half of its bits and its index in the lower: read as `f64`
/// (all are positive, none NaN, for an exponent of `f32` never fills that of `f64`), numbers are ordered by distance, then
/// by index, and a sorted list is kept by minima and maxima alone.
#[derive(Debug)]
pub(crate) struct Blocks {
    count: usize,
    blocks: Vec<Block>,
    /// Of the blocks, a row of them at a time.
    boxes: Vec<Boxes>,
    /// Of the rows of blocks, likewise.
    rows: Vec<Boxes>,
}

/// Points side by side: where they are [m], and their indices. Like all that is read as vectors, it begins where a cache
/// line does.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Block {
    at: [Lanes; 3],
    index: [u32; LANES],
}

/// Bounding boxes side by side, low and high corner.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Boxes {
    low: [Lanes; 3],
    high: [Lanes; 3],
}

/// Boxes that hold nothing.
const NOWHERE: Boxes = Boxes { low: [[f32::INFINITY; LANES]; 3], high: [[f32::NEG_INFINITY; LANES]; 3] };

/// No candidate: beyond every other.
const NONE: f64 = f64::from_bits(((f32::INFINITY.to_bits() as u64) << 32) | u32::MAX as u64);

impl Blocks {
    /// Room for clusters of up to `capacity` points.
    pub(crate) fn new(capacity: usize) -> Self {
        let blocks = capacity.div_ceil(LANES);
        let rows = blocks.div_ceil(ROW);
        Self {
            count: 0,
            blocks: vec![Block { at: [[0.0; LANES]; 3], index: [0; LANES] }; blocks],
            boxes: vec![NOWHERE; rows],
            rows: vec![NOWHERE; rows.div_ceil(ROW)],
        }
    }

    /// Takes the points as they come.
    pub(crate) fn lay_out(&mut self, points: &[[f32; 3]]) {
        self.count = points.len();
        for (place, &point) in points.iter().enumerate() {
            self.put(place, point, place as u32);
        }
        self.fill_up();
    }

    /// Takes the points ring after ring, those of a ring as they come.
    pub(crate) fn lay_out_by_ring(&mut self, points: &[[f32; 3]], rings: &[u8]) {
        self.count = points.len();
        let mut next = [0_u32; RINGS];
        for &ring in rings {
            next[usize::from(ring)] += 1;
        }
        let mut first = 0;
        for place in &mut next {
            first += std::mem::replace(place, first);
        }
        for (index, (&point, &ring)) in points.iter().zip(rings).enumerate() {
            let place = &mut next[usize::from(ring)];
            self.put(*place as usize, point, index as u32);
            *place += 1;
        }
        self.fill_up();
    }

    fn put(&mut self, place: usize, point: [f32; 3], index: u32) {
        let (block, lane) = (&mut self.blocks[place / LANES], place % LANES);
        for (values, value) in block.at.iter_mut().zip(point) {
            values[lane] = value;
        }
        block.index[lane] = index;
    }

    /// Fills the last block with copies of the last point: as queries they find what it finds; candidates they are not.
    fn fill_up(&mut self) {
        let Some(last) = self.count.checked_sub(1) else { return };
        let (block, lane) = (last / LANES, last % LANES);
        let Block { at, index } = self.blocks[block];
        for place in self.count..(block + 1) * LANES {
            self.put(place, at.map(|values| values[lane]), index[lane]);
        }
    }

    /// Finds `found.each` neighbours of every point.
    pub(crate) fn find(&mut self, arch: Arch, found: &mut Found) {
        match found.each {
            0 => {}
            1..=4 => arch.dispatch(Search::<4> { blocks: self, found }),
            _ => arch.dispatch(Search::<MAX_OTHERS> { blocks: self, found }),
        }
    }

    /// Points of a block.
    #[inline(always)]
    fn held(&self, block: usize) -> usize {
        LANES.min(self.count - block * LANES)
    }

    /// Makes the boxes.
    #[inline(always)]
    fn bound(&mut self) {
        let blocks = self.count.div_ceil(LANES);
        let rows = blocks.div_ceil(ROW);
        for row in 0..rows {
            let mut boxes = NOWHERE;
            for block in row * ROW..blocks.min((row + 1) * ROW) {
                for (axis, values) in self.blocks[block].at.iter().enumerate() {
                    (boxes.low[axis][block % ROW], boxes.high[axis][block % ROW]) = extremes(values, values);
                }
            }
            self.boxes[row] = boxes;
            if row % ROW == 0 {
                self.rows[row / ROW] = NOWHERE;
            }
            let of_rows = &mut self.rows[row / ROW];
            for axis in 0..3 {
                (of_rows.low[axis][row % ROW], of_rows.high[axis][row % ROW]) =
                    extremes(&boxes.low[axis], &boxes.high[axis]);
            }
        }
    }
}

/// The search for all points, each block keeping `K` neighbours.
struct Search<'a, const K: usize> {
    blocks: &'a mut Blocks,
    found: &'a mut Found,
}

impl<const K: usize> WithSimd for Search<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { blocks, found } = self;
        let count = blocks.count.div_ceil(LANES);
        if count > 3 {
            blocks.bound();
        }
        for block in 0..count {
            let mut query = Query::<K>::new(blocks, block);
            query.visit_own(blocks, block);
            let seen = if count > 3 { block.saturating_sub(1)..=(block + 1).min(count - 1) } else { 0..=count - 1 };
            for other in seen.clone().filter(|&other| other != block) {
                query.visit(blocks, other);
            }
            if count > 3 {
                query.visit_near(blocks, seen);
            }
            query.write(blocks, block, found);
        }
    }
}

/// A block of points and the nearest of each so far.
#[repr(C, align(64))]
struct Query<const K: usize> {
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
    fn new(blocks: &Blocks, block: usize) -> Self {
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
    fn visit_own(&mut self, blocks: &Blocks, block: usize) {
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
    fn visit(&mut self, blocks: &Blocks, block: usize) {
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
    fn visit_near(&mut self, blocks: &Blocks, seen: std::ops::RangeInclusive<usize>) {
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
                    if bound <= worst2 && !seen.contains(&block) && self.reaches(&blocks.boxes[row], block % ROW)
                    {
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

    #[inline(always)]
    fn write(&self, blocks: &Blocks, block: usize, found: &mut Found) {
        for lane in 0..blocks.held(block) {
            let from = self.index[lane] as usize * found.each;
            for (rank, level) in self.best.iter().enumerate().take(found.each) {
                let bits = level[lane].to_bits();
                found.near[from + rank] = bits as u32;
                found.distance_m[from + rank] = f32::from_bits((bits >> 32) as u32).sqrt();
            }
        }
    }
}

/// A candidate as one number that orders by distance, then by index.
#[inline(always)]
fn joined(distance2: f32, index: u32) -> f64 {
    f64::from_bits((u64::from(distance2.to_bits()) << 32) | u64::from(index))
}

#[inline(always)]
fn extremes(low: &Lanes, high: &Lanes) -> (f32, f32) {
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    for lane in 0..LANES {
        least = if low[lane] < least { low[lane] } else { least };
        most = if high[lane] > most { high[lane] } else { most };
    }
    (least, most)
}
