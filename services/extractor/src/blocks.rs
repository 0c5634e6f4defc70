use pulp::{Arch, Simd, WithSimd};

use crate::block_query::Query;
use crate::neighbours::{Found, MAX_OTHERS};

/// Points of a block, and queries that are answered side by side.
pub(crate) const LANES: usize = 16;
/// Blocks of a row.
pub(crate) const ROW: usize = 16;
/// Rings that a `u8` can name.
const RINGS: usize = 256;

/// One number for each point of a block, or each block of a row.
pub(crate) type Lanes = [f32; LANES];

/// Neighbours by exhaustive search over blocks of [`LANES`] points, leaving out those whose bounding box is too far.
///
/// A query is a whole block: every lane holds one point and its nearest so far. Exact for any order of the points; fast
/// where points that follow each other are near each other.
#[derive(Debug)]
pub(crate) struct Blocks {
    pub(crate) count: usize,
    pub(crate) blocks: Vec<Block>,
    /// Of the blocks, a row of them at a time.
    pub(crate) boxes: Vec<Boxes>,
    /// Of the rows of blocks, likewise.
    pub(crate) rows: Vec<Boxes>,
}

/// Points side by side: where they are [m], and their indices. Like all that is read as vectors, it begins where a cache
/// line does.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Block {
    pub(crate) at: [Lanes; 3],
    pub(crate) index: [u32; LANES],
}

/// Bounding boxes side by side, low and high corner.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Boxes {
    pub(crate) low: [Lanes; 3],
    pub(crate) high: [Lanes; 3],
}

/// Boxes that hold nothing.
const NOWHERE: Boxes = Boxes { low: [[f32::INFINITY; LANES]; 3], high: [[f32::NEG_INFINITY; LANES]; 3] };

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
    pub(crate) fn held(&self, block: usize) -> usize {
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
        for distance in &mut found.distance_m[..blocks.count * found.each] {
            *distance = distance.sqrt();
        }
    }
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
