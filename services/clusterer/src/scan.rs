//! The scan-window method: exact, for sweeps in firing order.
//!
//! If |p − q| ≤ d and p has horizontal range h, then the azimuths of p and q differ by at most asin(d/h), whatever the
//! range of q. So of each pair the one whose column comes later, looking back over its own window, finds the other;
//! across the seam it is the one just after the seam.

use std::f32::consts::TAU;

use lidar::MAX_COLUMNS;

use crate::arcsine::arcsine_above;
use crate::distance::ROUNDING;
use crate::runs::{BLOCK_COLUMNS, Run, Runs};
use crate::seen::Seen;
use crate::sets::{Extent, Sets};
use crate::turn::Turn;

/// Horizontal range below which azimuth bounds nothing, as a factor of d. Short of 1/0.98 the arcsine is too steep
/// for single precision, so a little above d counts as close too.
pub(crate) const CLOSE: f32 = 1.02;
/// Horizontal range within which all neighbours of close returns lie: CLOSE + 1, and a margin.
const NEAR: f32 = 2.03;
/// Margin on every window for single-precision rounding [rad]: ten times what it can come to.
const MARGIN_RAD: f32 = 2e-5;
/// Columns round a member in which something may still change for its cluster, at least: two of cells and one for the
/// dropout test on the outer ones; and one more, for the last column itself must not be among them.
const LEAST_COLUMNS: f32 = 4.0;

/// A block of columns.
#[derive(Clone, Copy)]
struct Block {
    /// Its first run.
    first_run: u32,
    /// Farthest travel of its columns and all before [rad].
    reached_rad: f32,
    /// Lowest travel from which on its runs have neighbours [rad].
    earliest_rad: f32,
}

/// The scan-window method and its memory.
pub(crate) struct Scan {
    range_d_m: f32,
    stray_rad: f32,
    step_rad: f32,
    runs: Runs,
    /// Travel from which on each run has neighbours [rad].
    earliest_rad: Vec<f32>,
    blocks: Vec<Block>,
    /// Blocks that have runs with h ≤ CLOSE · d, and with h ≤ NEAR · d.
    close_blocks: Vec<u32>,
    near_blocks: Vec<u32>,
}

impl Scan {
    pub(crate) fn new(range_d_m: f32) -> Self {
        let most_blocks = MAX_COLUMNS.div_ceil(BLOCK_COLUMNS);
        Self {
            range_d_m,
            stray_rad: 0.0,
            step_rad: 0.0,
            runs: Runs::new(),
            earliest_rad: Vec::with_capacity(lidar::MAX_RETURNS),
            blocks: Vec::with_capacity(most_blocks),
            close_blocks: Vec::with_capacity(most_blocks),
            near_blocks: Vec::with_capacity(most_blocks),
        }
    }

    /// Begins a sweep whose returns lie within `stray_rad` of their columns; `step_rad` is its columns' usual step.
    pub(crate) fn begin(&mut self, stray_rad: f32, step_rad: f32) {
        self.stray_rad = stray_rad;
        self.step_rad = step_rad;
        self.runs.reset();
        self.earliest_rad.clear();
        self.blocks.clear();
        self.close_blocks.clear();
        self.near_blocks.clear();
    }

    pub(crate) fn runs(&self) -> &Runs {
        &self.runs
    }

    pub(crate) fn runs_mut(&mut self) -> &mut Runs {
        &mut self.runs
    }

    /// Number of columns whose returns are joined.
    pub(crate) fn joined_columns(&self) -> usize {
        self.blocks.len() * BLOCK_COLUMNS
    }

    /// Farthest travel of the columns whose returns are joined [rad].
    pub(crate) fn reached_rad(&self) -> f32 {
        self.blocks.last().map_or(f32::NEG_INFINITY, |block| block.reached_rad)
    }

    /// What a window is widened by: both returns stray.
    pub(crate) fn widening_rad(&self) -> f32 {
        2.0 * self.stray_rad + MARGIN_RAD
    }

    /// Joins the returns of all blocks that have been seen whole with all before them.
    pub(crate) fn go_on(&mut self, seen: &Seen, turn: &Turn, sets: &mut Sets) {
        while self.joined_columns() + BLOCK_COLUMNS <= seen.columns.len() {
            self.join_block(seen, turn, sets);
        }
    }

    /// Joins the rest of the sweep, and across the seam.
    pub(crate) fn finish(&mut self, seen: &Seen, turn: &Turn, sets: &mut Sets) {
        while self.joined_columns() < seen.columns.len() {
            self.join_block(seen, turn, sets);
        }
        self.join_seam(sets);
    }

    fn join_block(&mut self, seen: &Seen, turn: &Turn, sets: &mut Sets) {
        let columns = self.joined_columns()..(self.joined_columns() + BLOCK_COLUMNS).min(seen.columns.len());
        let first_return = self.runs.returns();
        let returns = seen.returns[first_return..].iter().take_while(|r| usize::from(r.column) < columns.end).count();
        let within_m2 = self.range_d_m * self.range_d_m;
        let first_run = self.runs.len() as u32;
        self.runs.lay(seen, first_return..first_return + returns, turn.travels_rad(), within_m2);
        let reached_rad = turn.travels_rad()[columns].iter().copied().fold(self.reached_rad(), f32::max);
        let number = self.blocks.len() as u32;
        self.blocks.push(Block { first_run, reached_rad, earliest_rad: f32::INFINITY });
        let (close_m2, near_m2) = (self.least_m2(CLOSE), self.least_m2(NEAR));
        let least_m2 = self.runs.block().iter().map(|run| run.least_h_m2).fold(f32::INFINITY, f32::min);
        if least_m2 <= close_m2 {
            self.close_blocks.push(number);
        }
        if least_m2 <= near_m2 {
            self.near_blocks.push(number);
        }
        for place in 0..self.runs.block().len() {
            let run = self.runs.block()[place];
            let window_rad = self.window_rad(&run);
            sets.push(self.extent(&run, window_rad));
            self.earliest_rad.push(run.travel_rad[0] - window_rad - self.widening_rad());
        }
        for place in 0..self.runs.block().len() as u32 {
            let least_m2 = self.runs.block()[place as usize].least_h_m2;
            self.look_back(sets, first_run + place, least_m2);
        }
    }

    /// d and its rounding [m], and d² [m²].
    fn within(&self) -> (f32, f32) {
        (self.range_d_m * ROUNDING, self.range_d_m * self.range_d_m)
    }

    fn least_m2(&self, factor: f32) -> f32 {
        (factor * self.range_d_m) * (factor * self.range_d_m)
    }

    /// asin(d/h), rounded up, for the nearest return of a run that is not close [rad].
    fn window_rad(&self, run: &Run) -> f32 {
        let h_m = run.least_h_m2.sqrt().max(CLOSE * self.range_d_m);
        arcsine_above(self.range_d_m * ROUNDING / h_m)
    }

    fn extent(&self, run: &Run, window_rad: f32) -> Extent {
        // One column for the head's turn, one for the last column itself, one for rounding.
        let columns = (window_rad / self.step_rad + 3.0).max(LEAST_COLUMNS) as u32;
        let is_close = run.least_h_m2 <= self.least_m2(CLOSE);
        Extent {
            points: run.points,
            column: u32::from(run.last_column).saturating_add(columns),
            travel_rad: run.travel_rad[1] + window_rad,
            held: is_close
                || u32::from(run.first_column) <= columns
                || run.travel_rad[0] - window_rad - self.widening_rad() <= 0.0,
        }
    }

    /// Joins a run of the newest block with all before it that it has a return within d of.
    fn look_back(&mut self, sets: &mut Sets, run: u32, least_h_m2: f32) {
        let within = self.within();
        let earliest_rad = self.earliest_rad[run as usize];
        let newest = self.blocks.len() - 1;
        self.blocks[newest].earliest_rad = self.blocks[newest].earliest_rad.min(earliest_rad);
        let mut block = newest;
        while block > 0 && self.blocks[block - 1].reached_rad >= earliest_rad {
            block -= 1;
        }
        let mut root = sets.root(run);
        root = self.runs.join(sets, run, (self.blocks[block].first_run, run), within, root);
        // Close returns are anywhere in the sweep, and so are their neighbours.
        let elsewhere = match least_h_m2 {
            h_m2 if h_m2 <= self.least_m2(CLOSE) => &self.near_blocks,
            h_m2 if h_m2 <= self.least_m2(NEAR) => &self.close_blocks,
            _ => return,
        };
        for &other in elsewhere.iter().take_while(|&&other| (other as usize) < block) {
            let runs = (self.blocks[other as usize].first_run, self.blocks[other as usize + 1].first_run);
            root = self.runs.join(sets, run, runs, within, root);
        }
    }

    /// Joins the runs just after the seam with those just before it.
    fn join_seam(&mut self, sets: &mut Sets) {
        let (within, end_rad) = (self.within(), self.reached_rad());
        for number in 0..self.blocks.len() {
            if self.blocks[number].earliest_rad + TAU > end_rad {
                continue;
            }
            let end = self.blocks.get(number + 1).map_or(self.runs.len() as u32, |next| next.first_run);
            for run in self.blocks[number].first_run..end {
                let earliest_rad = self.earliest_rad[run as usize] + TAU;
                if earliest_rad > end_rad {
                    continue;
                }
                let mut block = self.blocks.len();
                while block > number && self.blocks[block - 1].reached_rad >= earliest_rad {
                    block -= 1;
                }
                let root = sets.root(run);
                let others = (self.blocks[block].first_run, self.runs.len() as u32);
                self.runs.join(sets, run, others, within, root);
            }
        }
    }
}
