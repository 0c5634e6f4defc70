//! Runs: returns known to be of one set because each is within d of the one before it on its ring.
//!
//! All joining is of runs, not of returns: a run has a box, and two runs whose boxes are farther apart than d have no two
//! returns within d. Runs are laid out block of columns after block of columns, and within a block in order of their
//! first return, so a stretch of columns is a stretch of runs, and a set's first run has its smallest return.

use std::ops::Range;

use lidar::{MAX_RETURNS, MAX_RINGS, Return};

use crate::distance::squared_m2;
use crate::seen::Seen;
use crate::sets::Sets;

/// Columns of a block: the most that a run covers.
pub(crate) const BLOCK_COLUMNS: usize = 16;
/// Boxes and returns looked at together: a multiple of every vector width in use.
pub(crate) const LANES: usize = 8;

/// Neighbouring boxes [m] and their sets: of runs, or of chunks of runs.
#[derive(Clone, Copy)]
struct Chunk {
    low_m: [[f32; LANES]; 3],
    high_m: [[f32; LANES]; 3],
    /// A run of the set that all of each is in, as last seen; [`MIXED`] where not all is known to be in one.
    set: [u32; LANES],
}

/// More than one set, or none.
const MIXED: u32 = u32::MAX;
/// Nothing overlaps an empty box.
const EMPTY: Chunk =
    Chunk { low_m: [[f32::INFINITY; LANES]; 3], high_m: [[f32::NEG_INFINITY; LANES]; 3], set: [MIXED; LANES] };

/// A run as far as its returns say.
#[derive(Clone, Copy)]
pub(crate) struct Run {
    pub(crate) points: u32,
    pub(crate) first_column: u16,
    pub(crate) last_column: u16,
    /// Lowest and highest travel of its columns [rad].
    pub(crate) travel_rad: [f32; 2],
    /// Smallest squared horizontal range [m²].
    pub(crate) least_h_m2: f32,
    low_m: [f32; 3],
    high_m: [f32; 3],
}

/// The newest return of a ring.
#[derive(Clone, Copy)]
struct Newest {
    run: u32,
    position: [f32; 3],
}

/// A run that looks for others: its box, widened by d [m].
#[derive(Clone, Copy)]
pub(crate) struct Seeker {
    low_m: [f32; 3],
    high_m: [f32; 3],
}

/// The runs of a sweep and their returns.
pub(crate) struct Runs {
    chunks: Vec<Chunk>,
    /// The boxes of the chunks.
    groups: Vec<Chunk>,
    /// Place of the first return of each run in what follows, and the end of the last.
    first: Vec<u32>,
    x_m: Vec<f32>,
    y_m: Vec<f32>,
    z_m: Vec<f32>,
    /// Place in the sweep of each return.
    place: Vec<u32>,
    /// The runs of the newest block.
    block: Vec<Run>,
    /// The run of each return of the newest block.
    run_of: Vec<u32>,
    newest: [Newest; MAX_RINGS],
}

#[inline]
fn min(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline]
fn max(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[inline(always)]
fn lanes(values: &[f32], from: usize) -> Option<&[f32; LANES]> {
    values.get(from..)?.first_chunk()
}

impl Runs {
    pub(crate) fn new() -> Self {
        Self {
            chunks: Vec::with_capacity(MAX_RETURNS.div_ceil(LANES)),
            groups: Vec::with_capacity(MAX_RETURNS.div_ceil(LANES * LANES)),
            first: Vec::with_capacity(MAX_RETURNS + 1),
            x_m: Vec::with_capacity(MAX_RETURNS + LANES),
            y_m: Vec::with_capacity(MAX_RETURNS + LANES),
            z_m: Vec::with_capacity(MAX_RETURNS + LANES),
            place: Vec::with_capacity(MAX_RETURNS),
            block: Vec::with_capacity(MAX_RETURNS),
            run_of: Vec::with_capacity(MAX_RETURNS),
            newest: [Newest { run: 0, position: [0.0; 3] }; MAX_RINGS],
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self) {
        self.chunks.clear();
        self.groups.clear();
        self.first.clear();
        self.first.push(0);
        self.place.clear();
        self.block.clear();
    }

    /// Number of runs.
    pub(crate) fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// Number of returns laid out.
    pub(crate) fn returns(&self) -> usize {
        self.place.len()
    }

    /// Places in the sweep of a run's returns, rising.
    #[inline]
    pub(crate) fn places(&self, run: u32) -> &[u32] {
        &self.place[self.span(run)]
    }

    #[inline]
    fn span(&self, run: u32) -> Range<usize> {
        self.first[run as usize] as usize..self.first[run as usize + 1] as usize
    }

    /// The runs of the block laid out last.
    pub(crate) fn block(&self) -> &[Run] {
        &self.block
    }

    /// Lays out `count` returns as runs of their own, without boxes.
    pub(crate) fn lay_alone(&mut self, count: usize) {
        self.reset();
        self.first.extend(1..=count as u32);
        self.place.extend(0..count as u32);
    }

    /// Lays out the returns at `places`, which follow those before; `travel_rad` has the travel of each column.
    pub(crate) fn lay(&mut self, seen: &Seen, places: Range<usize>, travel_rad: &[f32], within_m2: f32) {
        let first_run = self.len() as u32;
        self.block.clear();
        self.run_of.clear();
        for newest in &mut self.newest {
            newest.run = u32::MAX;
        }
        for r in &seen.returns[places.clone()] {
            let number = self.run_for(r, travel_rad[usize::from(r.column)], within_m2);
            self.run_of.push(number);
        }
        self.push_boxes(first_run);
        self.place.resize(places.end, 0);
        for axis in [&mut self.x_m, &mut self.y_m, &mut self.z_m] {
            axis.resize(places.end + LANES, f32::INFINITY);
        }
        // The end of each run counts up from its start.
        let ends = &mut self.first[first_run as usize + 1..];
        for ((place, r), &run) in places.clone().zip(&seen.returns[places]).zip(&self.run_of) {
            let end = &mut ends[run as usize];
            let at = *end as usize;
            (self.x_m[at], self.y_m[at], self.z_m[at], self.place[at]) = (r.x, r.y, r.z, place as u32);
            *end += 1;
        }
    }

    /// The number in its block of the run that a return belongs to: that of the return before it on its ring if it is
    /// within d of that, else a new one.
    #[inline]
    fn run_for(&mut self, r: &Return, travel_rad: f32, within_m2: f32) -> u32 {
        let position = r.position();
        let h_m2 = r.x * r.x + r.y * r.y;
        let newest = &mut self.newest[usize::from(r.ring) % MAX_RINGS];
        if newest.run != u32::MAX && squared_m2(newest.position, position) <= within_m2 {
            newest.position = position;
            let run = &mut self.block[newest.run as usize];
            run.points += 1;
            run.last_column = r.column;
            run.travel_rad = [min(run.travel_rad[0], travel_rad), max(run.travel_rad[1], travel_rad)];
            run.least_h_m2 = min(run.least_h_m2, h_m2);
            let ([low_x, low_y, low_z], [high_x, high_y, high_z]) = (run.low_m, run.high_m);
            run.low_m = [min(low_x, r.x), min(low_y, r.y), min(low_z, r.z)];
            run.high_m = [max(high_x, r.x), max(high_y, r.y), max(high_z, r.z)];
            return newest.run;
        }
        *newest = Newest { run: self.block.len() as u32, position };
        self.block.push(Run {
            points: 1,
            first_column: r.column,
            last_column: r.column,
            travel_rad: [travel_rad; 2],
            least_h_m2: h_m2,
            low_m: position,
            high_m: position,
        });
        newest.run
    }

    fn push_boxes(&mut self, first_run: u32) {
        let mut start = self.place.len() as u32;
        for (number, run) in (first_run as usize..).zip(&self.block) {
            let (chunk, lane) = (number / LANES, number % LANES);
            if lane == 0 {
                self.chunks.push(EMPTY);
            }
            if number % (LANES * LANES) == 0 {
                self.groups.push(EMPTY);
            }
            self.chunks[chunk].widen(lane, run, number as u32);
            self.groups[chunk / LANES].widen(chunk % LANES, run, MIXED);
            self.first.push(start);
            start += run.points;
        }
    }

    /// What a run looks for: `reach_m` is d and its rounding.
    #[inline]
    pub(crate) fn seeker(&self, run: u32, reach_m: f32) -> Seeker {
        let (chunk, lane) = (&self.chunks[run as usize / LANES], run as usize % LANES);
        Seeker {
            low_m: chunk.low_m.map(|low| low[lane] - reach_m),
            high_m: chunk.high_m.map(|high| high[lane] + reach_m),
        }
    }

    /// Joins `run`, of the set with `root`, with all of `others` that it has a return within d of, newest first; and with
    /// some runs beside those. Gives the root of its set.
    #[inline(always)]
    pub(crate) fn join(
        &mut self,
        sets: &mut Sets,
        run: u32,
        seeker: Seeker,
        others: Range<u32>,
        within_m2: f32,
        mut root: u32,
    ) -> u32 {
        let groups = others.start as usize / (LANES * LANES)..(others.end as usize).div_ceil(LANES * LANES);
        for number in groups.rev() {
            let candidates = seeker.candidates(&self.groups[number], root);
            if candidates != 0 {
                root = self.join_group(sets, run, seeker, number, candidates, within_m2, root);
            }
        }
        self.chunks[run as usize / LANES].set[run as usize % LANES] = root;
        root
    }

    #[inline(always)]
    fn join_group(
        &mut self,
        sets: &mut Sets,
        run: u32,
        seeker: Seeker,
        number: usize,
        mut candidates: u32,
        within_m2: f32,
        mut root: u32,
    ) -> u32 {
        while candidates != 0 {
            let lane = candidates.ilog2() as usize;
            candidates &= !(1 << lane);
            let chunk = number * LANES + lane;
            let in_chunk = seeker.candidates(&self.chunks[chunk], root);
            if in_chunk != 0 {
                root = self.join_chunk(sets, run, chunk, in_chunk, within_m2, root);
            }
            let set = self.chunks[chunk].set;
            if set.iter().all(|&set| set == root) {
                self.groups[number].set[lane] = root;
            }
        }
        root
    }

    #[inline(never)]
    fn join_chunk(
        &mut self,
        sets: &mut Sets,
        run: u32,
        number: usize,
        mut candidates: u32,
        within_m2: f32,
        mut root: u32,
    ) -> u32 {
        while candidates != 0 {
            let lane = candidates.ilog2() as usize;
            candidates &= !(1 << lane);
            let other = (number * LANES + lane) as u32;
            let mut there = sets.root(self.chunks[number].set[lane]);
            if there != root && self.touch(run, other, within_m2) {
                root = sets.join(root, there);
                there = root;
            }
            self.chunks[number].set[lane] = there;
        }
        root
    }

    /// Whether two runs have returns within d of each other.
    fn touch(&self, a: u32, b: u32, within_m2: f32) -> bool {
        let (a, b) = (self.span(a), self.span(b));
        let (few, many) = if a.len() < b.len() { (a, b) } else { (b, a) };
        few.into_iter().any(|at| {
            let position = [self.x_m[at], self.y_m[at], self.z_m[at]];
            many.clone().step_by(LANES).any(|from| self.any_within(position, from, many.end, within_m2))
        })
    }

    /// Whether one of the returns laid out from `from` on, but before `end`, is within d: the next LANES are looked at.
    #[inline(always)]
    fn any_within(&self, position: [f32; 3], from: usize, end: usize, within_m2: f32) -> bool {
        let (Some(x_m), Some(y_m), Some(z_m)) =
            (lanes(&self.x_m, from), lanes(&self.y_m, from), lanes(&self.z_m, from))
        else {
            return false;
        };
        let left = (end - from) as u32;
        (0..LANES).fold(false, |any, lane| {
            let is_within = squared_m2([x_m[lane], y_m[lane], z_m[lane]], position) <= within_m2;
            any | (is_within & ((lane as u32) < left))
        })
    }
}

impl Chunk {
    /// Widens the box of a lane by that of a run.
    fn widen(&mut self, lane: usize, run: &Run, set: u32) {
        for axis in 0..3 {
            let (low_m, high_m) = (&mut self.low_m[axis][lane], &mut self.high_m[axis][lane]);
            (*low_m, *high_m) = (min(*low_m, run.low_m[axis]), max(*high_m, run.high_m[axis]));
        }
        self.set[lane] = set;
    }
}

impl Seeker {
    /// The lanes of a chunk whose boxes it overlaps and that are not known to be of its set, a bit each.
    #[inline(always)]
    fn candidates(&self, chunk: &Chunk, root: u32) -> u32 {
        if chunk.set.iter().all(|&set| set == root) {
            return 0;
        }
        // Arrays lane by lane without branches, so that each line is an instruction or two on vectors.
        let mut apart_m = [f32::NEG_INFINITY; LANES];
        for axis in 0..3 {
            let (low_m, high_m) = (&chunk.low_m[axis], &chunk.high_m[axis]);
            for lane in 0..LANES {
                apart_m[lane] = max(apart_m[lane], low_m[lane] - self.high_m[axis]);
            }
            for lane in 0..LANES {
                apart_m[lane] = max(apart_m[lane], self.low_m[axis] - high_m[lane]);
            }
        }
        let mut candidates = 0;
        for lane in 0..LANES {
            candidates |= u32::from((apart_m[lane] <= 0.0) & (chunk.set[lane] != root)) << lane;
        }
        candidates
    }
}
