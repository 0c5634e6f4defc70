use lidar::{MAX_COLUMNS, MAX_RETURNS, MAX_RINGS};

use crate::distance::squared_m2;
use crate::sets::Sets;

/// Returns looked at together. Two cache lines; a multiple of every vector width in use.
pub(crate) const LANES: usize = 8;
const LANES_U16: u16 = LANES as u16;

/// Where nothing was returned.
pub(crate) const NOBODY: u32 = u32::MAX;

/// Neighbouring pixels of a row.
#[derive(Clone, Copy)]
pub(crate) struct Block {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
    /// A member of the set of each return, as last seen; [`NOBODY`] where there is none.
    set: [u32; LANES],
}

/// Nothing is within any distance of an infinite x.
const EMPTY: Block = Block { x: [f32::INFINITY; LANES], y: [0.0; LANES], z: [0.0; LANES], set: [NOBODY; LANES] };

/// Blocks that are passed over together.
const STRETCH_BLOCKS: usize = 2;

/// Neighbouring blocks of a row, as far as a seeker need know to pass them over.
#[derive(Clone, Copy)]
struct Stretch {
    /// The root of all returns in it, once a seeker has found them all in its own set; until then [`NOBODY`].
    ///
    /// It may be a root no longer, but whoever has it for a root is still in one set with all of them: sets only grow.
    set: u32,
    /// Its smallest and its largest range [m]; no range lies between them where nothing was returned.
    near_m: f32,
    far_m: f32,
}

const NO_RETURN: Stretch = Stretch { set: NOBODY, near_m: f32::INFINITY, far_m: f32::NEG_INFINITY };

/// The sweep as rows of blocks: one row a ring, one pixel a column; and one more row of close returns, without order.
pub(crate) struct Image {
    blocks: Vec<Block>,
    row_blocks: usize,
    stretches: Vec<Stretch>,
    close: Vec<Block>,
    close_count: usize,
}

impl Image {
    pub(crate) fn new() -> Self {
        let most = MAX_RINGS * MAX_COLUMNS.div_ceil(LANES * STRETCH_BLOCKS) * STRETCH_BLOCKS;
        Self {
            blocks: Vec::with_capacity(most),
            row_blocks: 0,
            stretches: Vec::with_capacity(most.div_ceil(STRETCH_BLOCKS)),
            close: Vec::with_capacity(MAX_RETURNS.div_ceil(LANES)),
            close_count: 0,
        }
    }

    /// Empties it and gives it its size.
    pub(crate) fn reset(&mut self, rings: usize, columns: usize) {
        // Whole stretches, so that none belongs to two rings.
        self.row_blocks = columns.div_ceil(LANES * STRETCH_BLOCKS) * STRETCH_BLOCKS;
        self.stretches.clear();
        self.stretches.resize(rings * self.row_blocks / STRETCH_BLOCKS, NO_RETURN);
        self.blocks.clear();
        self.blocks.resize(rings * self.row_blocks, EMPTY);
        self.close.clear();
        self.close_count = 0;
    }

    fn pixel(&mut self, ring: u8, column: u16) -> (&mut Block, usize) {
        let block = usize::from(ring) * self.row_blocks + usize::from(column / LANES_U16);
        (&mut self.blocks[block], usize::from(column % LANES_U16))
    }

    /// Puts a return of range `range_m` into its pixel; false when another one is there.
    #[inline]
    pub(crate) fn put(&mut self, ring: u8, column: u16, position: [f32; 3], range_m: f32, place: u32) -> bool {
        let block = usize::from(ring) * self.row_blocks + usize::from(column / LANES_U16);
        let stretch = &mut self.stretches[block / STRETCH_BLOCKS];
        stretch.near_m = stretch.near_m.min(range_m);
        stretch.far_m = stretch.far_m.max(range_m);
        let (block, lane) = self.pixel(ring, column);
        if block.set[lane] != NOBODY {
            return false;
        }
        [block.x[lane], block.y[lane], block.z[lane]] = position;
        block.set[lane] = place;
        true
    }

    /// Adds a return to the row of close ones.
    pub(crate) fn put_close(&mut self, position: [f32; 3], place: u32) {
        let lane = self.close_count % LANES;
        if lane == 0 {
            self.close.push(EMPTY);
        }
        if let Some(block) = self.close.last_mut() {
            [block.x[lane], block.y[lane], block.z[lane]] = position;
            block.set[lane] = place;
        }
        self.close_count += 1;
    }

    /// Notes the set of a pixel's return.
    #[inline]
    pub(crate) fn note(&mut self, ring: u8, column: u16, root: u32) {
        let (block, lane) = self.pixel(ring, column);
        block.set[lane] = root;
    }

    /// Joins a return with all those within d of it in the pixels of `ring` from column `from` to column `to`, newest
    /// first, and some pixels beside them. Gives the root of its set.
    #[inline]
    pub(crate) fn join_row(
        &mut self,
        sets: &mut Sets,
        seeker: Seeker,
        ring: usize,
        from: usize,
        to: usize,
        root: u32,
    ) -> u32 {
        let row = ring * self.row_blocks;
        let (from, to) = (row + from / LANES, row + to / LANES);
        let mut root = root;
        for number in (from / STRETCH_BLOCKS..to / STRETCH_BLOCKS + 1).rev() {
            let stretch = self.stretches[number];
            if stretch.set == root || stretch.near_m > seeker.far_m || stretch.far_m < seeker.near_m {
                continue;
            }
            let first = number * STRETCH_BLOCKS;
            let span = first.max(from)..(first + STRETCH_BLOCKS).min(to + 1);
            let whole = span.len() == STRETCH_BLOCKS;
            let mut one_set = true;
            for block in self.blocks.get_mut(span).unwrap_or_default().iter_mut().rev() {
                if block.has_others(root) {
                    one_set = false;
                    root = seeker.join_block(sets, block, root);
                }
            }
            if whole && one_set {
                self.stretches[number].set = root;
            }
        }
        root
    }

    /// Number of returns in the row of close ones.
    pub(crate) fn close_count(&self) -> usize {
        self.close_count
    }

    /// Joins a return with all close ones within d of it and gives the root of its set.
    pub(crate) fn join_close(&mut self, sets: &mut Sets, seeker: Seeker, root: u32) -> u32 {
        self.close
            .iter_mut()
            .fold(root, |root, block| if block.has_others(root) { seeker.join_block(sets, block, root) } else { root })
    }
}

/// A return that looks for others within d.
#[derive(Clone, Copy)]
pub(crate) struct Seeker {
    /// Its position [m].
    pub(crate) position: [f32; 3],
    /// d² [m²].
    pub(crate) within_m2: f32,
    /// Bounds of the range of all within d of it [m].
    pub(crate) near_m: f32,
    pub(crate) far_m: f32,
}

impl Block {
    /// Whether it has returns that are not known to be of a set. Labels before distances: most blocks are done here.
    #[inline(always)]
    fn has_others(&self, root: u32) -> bool {
        self.set.iter().fold(false, |any, &set| any | ((set != root) & (set != NOBODY)))
    }
}

impl Seeker {
    /// Distances of all lanes at once: most blocks have nothing within d.
    #[inline(always)]
    fn join_block(self, sets: &mut Sets, block: &mut Block, root: u32) -> u32 {
        let hit = |block: &Block, lane: usize, root: u32| {
            let position = [block.x[lane], block.y[lane], block.z[lane]];
            (squared_m2(position, self.position) <= self.within_m2) & (block.set[lane] != root)
        };
        if !(0..LANES).fold(false, |any, lane| any | hit(block, lane, root)) {
            return root;
        }
        self.join_lanes(sets, block, root)
    }

    #[inline(never)]
    fn join_lanes(self, sets: &mut Sets, block: &mut Block, mut root: u32) -> u32 {
        for lane in 0..LANES {
            let position = [block.x[lane], block.y[lane], block.z[lane]];
            if block.set[lane] != root && squared_m2(position, self.position) <= self.within_m2 {
                root = sets.join(root, block.set[lane]);
                block.set[lane] = root;
            }
        }
        root
    }
}
