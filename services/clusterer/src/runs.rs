//! Runs: returns known to be of one set because each is within d of the one before it on its ring.
//!
//! All joining is of runs, not of returns: a run has a box, and two runs whose boxes are farther apart than d have no two
//! returns within d. Runs are laid out block of columns after block of columns, and within a block in order of their
//! first return, so a stretch of columns is a stretch of runs, and a set's first run has its smallest return.

use std::ops::Range;

use lidar::{MAX_RETURNS, MAX_RINGS, Return};

use crate::boxes::{Bounds, Boxes, LANES, max, min};
use crate::distance::squared_m2;
use crate::seen::Seen;
use crate::sets::Sets;

/// Columns of a block: the most that a run covers.
pub(crate) const BLOCK_COLUMNS: usize = 16;
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
    bounds: Bounds,
}

/// The newest return of a ring.
#[derive(Clone, Copy)]
struct Newest {
    run: u32,
    position: [f32; 3],
}

/// Returns, run after run.
struct Returns {
    /// Place of the first return of each run in what follows, and the end of the last.
    first: Vec<u32>,
    x_m: Vec<f32>,
    y_m: Vec<f32>,
    z_m: Vec<f32>,
    /// Place in the sweep of each return.
    place: Vec<u32>,
}

/// The runs of a sweep and their returns.
pub(crate) struct Runs {
    boxes: Boxes,
    returns: Returns,
    /// The runs of the newest block.
    block: Vec<Run>,
    /// The run of each return of the newest block.
    run_of: Vec<u32>,
    newest: [Newest; MAX_RINGS],
}

#[inline(always)]
fn lanes(values: &[f32], from: usize) -> Option<&[f32; LANES]> {
    values.get(from..)?.first_chunk()
}

impl Runs {
    pub(crate) fn new() -> Self {
        Self {
            boxes: Boxes::new(),
            returns: Returns {
                first: Vec::with_capacity(MAX_RETURNS + 1),
                x_m: Vec::with_capacity(MAX_RETURNS + LANES),
                y_m: Vec::with_capacity(MAX_RETURNS + LANES),
                z_m: Vec::with_capacity(MAX_RETURNS + LANES),
                place: Vec::with_capacity(MAX_RETURNS),
            },
            block: Vec::with_capacity(MAX_RETURNS),
            run_of: Vec::with_capacity(MAX_RETURNS),
            newest: [Newest { run: 0, position: [0.0; 3] }; MAX_RINGS],
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self) {
        self.boxes.reset();
        self.returns.first.clear();
        self.returns.first.push(0);
        self.returns.place.clear();
        self.block.clear();
    }

    /// Number of runs.
    pub(crate) fn len(&self) -> usize {
        self.returns.first.len() - 1
    }

    /// Number of returns laid out.
    pub(crate) fn returns(&self) -> usize {
        self.returns.place.len()
    }

    /// Places in the sweep of a run's returns, rising.
    #[inline]
    pub(crate) fn places(&self, run: u32) -> &[u32] {
        &self.returns.place[self.returns.span(run)]
    }

    /// The runs of the block laid out last.
    pub(crate) fn block(&self) -> &[Run] {
        &self.block
    }

    /// Lays out `count` returns as runs of their own, without boxes.
    pub(crate) fn lay_alone(&mut self, count: usize) {
        self.reset();
        self.returns.first.extend(1..=count as u32);
        self.returns.place.extend(0..count as u32);
    }

    /// Lays out the returns at `places`, which follow those before; `travel_rad` has the travel of each column.
    pub(crate) fn lay(&mut self, seen: &Seen, places: Range<usize>, travel_rad: &[f32], within_m2: f32) {
        let first_run = self.len();
        self.block.clear();
        self.run_of.clear();
        for newest in &mut self.newest {
            newest.run = u32::MAX;
        }
        for r in &seen.returns[places.clone()] {
            let number = self.run_for(r, travel_rad[usize::from(r.column)], within_m2);
            self.run_of.push(number);
        }
        let Returns { first, x_m, y_m, z_m, place: places_laid } = &mut self.returns;
        let mut start = places_laid.len() as u32;
        for run in &self.block {
            self.boxes.push(&run.bounds);
            first.push(start);
            start += run.points;
        }
        places_laid.resize(places.end, 0);
        for axis in [&mut *x_m, &mut *y_m, &mut *z_m] {
            axis.resize(places.end + LANES, f32::INFINITY);
        }
        // The end of each run counts up from its start.
        let ends = &mut first[first_run + 1..];
        for ((place, r), &run) in places.clone().zip(&seen.returns[places]).zip(&self.run_of) {
            let end = &mut ends[run as usize];
            let at = *end as usize;
            (x_m[at], y_m[at], z_m[at], places_laid[at]) = (r.x, r.y, r.z, place as u32);
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
            run.bounds.include(position);
            return newest.run;
        }
        *newest = Newest { run: self.block.len() as u32, position };
        self.block.push(Run {
            points: 1,
            first_column: r.column,
            last_column: r.column,
            travel_rad: [travel_rad; 2],
            least_h_m2: h_m2,
            bounds: Bounds::of(position),
        });
        newest.run
    }

    /// Joins `run`, of the set of `root`, with all runs from `others.0` to before `others.1` that have a return within d of
    /// one of its own, and with some beside those. `reach_m` is d and its rounding. Gives the root of its set.
    #[inline(always)]
    pub(crate) fn join(
        &mut self,
        sets: &mut Sets,
        run: u32,
        others: (u32, u32),
        (reach_m, within_m2): (f32, f32),
        root: u32,
    ) -> u32 {
        let Self { boxes, returns, .. } = self;
        let bounds = boxes.around(run, reach_m);
        let root = boxes.visit(&bounds, others, root, |other, set, root| {
            let there = sets.root(set);
            if there != root && returns.touch(run, other, within_m2) {
                let joined = sets.join(root, there);
                return (joined, joined);
            }
            (root, there)
        });
        boxes.note(run, root);
        root
    }
}

impl Returns {
    #[inline]
    fn span(&self, run: u32) -> Range<usize> {
        self.first[run as usize] as usize..self.first[run as usize + 1] as usize
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
