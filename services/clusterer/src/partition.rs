use lidar::MAX_RETURNS;

use crate::params::{Checked, Method};
use crate::runs::Runs;
use crate::scan::{CLOSE, Scan};
use crate::seen::Seen;
use crate::sets::Sets;
use crate::stray;
use crate::tree::Tree;
use crate::turn::{self, Turn};

/// Largest angle between returns and their columns at which the window is quick [rad].
const REGULAR_RAD: f32 = 0.1;

/// Partitions returns into the connected components of "at most d apart", by whichever method serves, and says which of
/// those are closed: nothing still to come can belong to them.
pub(crate) struct Partition {
    range_d_m: f32,
    method: Method,
    scan: Scan,
    tree: Tree,
    turn: Turn,
    sets: Sets,
    sense: f32,
    /// Roots of the sets that are not closed, rising; and how many runs were looked at for them.
    open: Vec<u32>,
    opened: usize,
    /// Roots of the sets that closed last, rising.
    closed: Vec<u32>,
}

impl Partition {
    pub(crate) fn new(params: &Checked) -> Self {
        Self {
            range_d_m: params.range_d_m,
            method: params.method,
            scan: Scan::new(params.range_d_m),
            tree: Tree::new(params.range_d_m),
            turn: Turn::new(),
            sets: Sets::with_capacity(MAX_RETURNS),
            sense: 1.0,
            open: Vec::with_capacity(MAX_RETURNS),
            opened: 0,
            closed: Vec::with_capacity(MAX_RETURNS),
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn begin(&mut self) {
        self.sets.reset();
        self.turn.reset();
        self.scan.begin(0.0, 0.0);
        self.open.clear();
        self.opened = 0;
        self.closed.clear();
    }

    /// Takes in the last `columns` and `returns` of a sweep that promises to be regular, and finds what closes with them;
    /// all does where they are the `last`. False where they break the promise.
    pub(crate) fn go_on(&mut self, seen: &Seen, columns: usize, returns: usize, last: bool) -> bool {
        let (columns, returns) = (seen.columns.len() - columns, seen.returns.len() - returns);
        let (stray_rad, step_rad) = (seen.header.stray_rad, seen.header.column_step_rad);
        if !self.turn.go_on(&seen.columns[columns..])
            || !stray::is_kept(seen.columns, &seen.returns[returns..], stray_rad)
        {
            return false;
        }
        self.sense = self.turn.sense();
        if columns == 0 {
            self.scan.begin(stray_rad, step_rad);
        }
        match (self.method == Method::Kdtree, last) {
            (true, false) => {}
            (true, true) => self.tree.partition(seen, self.scan.runs_mut(), &mut self.sets),
            (false, false) => self.scan.go_on(seen, &self.turn, &mut self.sets),
            (false, true) => self.scan.finish(seen, &self.turn, &mut self.sets),
        }
        self.close(last);
        true
    }

    /// Partitions a whole sweep that promises nothing; all of it closes.
    pub(crate) fn whole(&mut self, seen: &Seen) {
        self.sense = turn::sense(seen.columns);
        match self.stray_rad(seen) {
            Some(stray_rad) => {
                self.scan.begin(stray_rad, seen.header.column_step_rad);
                self.scan.finish(seen, &self.turn, &mut self.sets);
            }
            None => self.tree.partition(seen, self.scan.runs_mut(), &mut self.sets),
        }
        self.close(true);
    }

    /// How far returns stray where the scan window is exact, and quick enough for the method.
    fn stray_rad(&mut self, seen: &Seen) -> Option<f32> {
        if self.method == Method::Kdtree || !seen.header.is_organised() || !self.turn.measure(seen.columns) {
            return None;
        }
        let close_m2 = (CLOSE * self.range_d_m) * (CLOSE * self.range_d_m);
        let stray_rad = stray::measure(seen.columns, seen.returns, close_m2)?;
        (self.method == Method::Scan || stray_rad <= REGULAR_RAD).then_some(stray_rad)
    }

    /// Finds the sets that nothing still to come can join.
    ///
    /// Later columns have travelled at least as far as the last one joined, and later returns stray from them as little as
    /// all others.
    fn close(&mut self, all: bool) {
        self.open.extend((self.opened as u32..self.sets.runs() as u32).filter(|&run| self.sets.is_root(run)));
        self.opened = self.sets.runs();
        let columns = self.scan.joined_columns();
        let reached_rad = self.scan.reached_rad() - self.scan.widening_rad();
        let Self { sets, open, closed, .. } = self;
        closed.clear();
        open.retain(|&run| {
            if !sets.is_root(run) {
                return false;
            }
            let extent = sets.extent(run);
            let is_passed = (extent.column as usize) < columns && extent.travel_rad < reached_rad;
            let closes = all || (is_passed && !extent.held);
            if closes {
                closed.push(run);
            }
            !closes
        });
    }

    /// Roots of the sets that closed with the last part, in order of their first returns.
    pub(crate) fn closed(&self) -> &[u32] {
        &self.closed
    }

    pub(crate) fn sets(&self) -> &Sets {
        &self.sets
    }

    pub(crate) fn runs(&self) -> &Runs {
        self.scan.runs()
    }

    /// +1 where azimuth rises with the column, −1 where it falls.
    pub(crate) fn sense(&self) -> f32 {
        self.sense
    }
}
