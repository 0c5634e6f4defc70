use std::f32::consts::FRAC_PI_2;

use lidar::{MAX_COLUMNS, Return};

use crate::seen::Seen;

/// Columns round a member in which something may still change for its cluster, at least: two of cells and one for the
/// dropout test on the outer ones.
const LEAST_COLUMNS: usize = 3;

/// Whether a return's window touches the first or last column of its sweep.
///
/// The window of a return at horizontal range h is max(asin(d/h) / step + 1, 3) columns to both sides, where step is
/// the header's `column_step_rad` and 1 is for the head's turn while a column fires. For h ≤ d it is the whole turn.
pub(crate) struct Seam {
    range_d_m: f32,
    columns: usize,
    /// For each number of columns to the nearer end the least d/h whose window touches: the sine of the way there less
    /// one column. From a quarter of a turn on it is 1.
    touching_sine: Vec<f32>,
}

impl Seam {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self { range_d_m, columns: 0, touching_sine: Vec::with_capacity(MAX_COLUMNS) }
    }

    /// Takes the measure of a sweep seen whole. Without a column step every window touches.
    pub(crate) fn measure(&mut self, seen: &Seen) {
        let step_rad = seen.header.column_step_rad.max(0.0);
        self.columns = seen.columns.len();
        self.touching_sine.clear();
        for to_end in 0..self.columns.div_ceil(2) {
            let way_rad = to_end.saturating_sub(1) as f32 * step_rad;
            let is_least = to_end <= LEAST_COLUMNS;
            self.touching_sine.push(if is_least { 0.0 } else { way_rad.min(FRAC_PI_2).sin() });
            if !is_least && way_rad >= FRAC_PI_2 {
                break;
            }
        }
    }

    /// Whether the window of `r` touches; `r` is a return of the organised sweep that was measured.
    pub(crate) fn touches(&self, r: &Return) -> bool {
        // asin(d/h) ≥ (to_end − 1) · step, squared to spare the root.
        let to_end = usize::from(r.column).min(self.columns - 1 - usize::from(r.column));
        let least = self.touching_sine[to_end.min(self.touching_sine.len() - 1)];
        let h_m2 = r.x * r.x + r.y * r.y;
        // The first test is for h² beyond single precision, of which nothing times 0 is known.
        least == 0.0 || self.range_d_m * self.range_d_m >= h_m2 * (least * least)
    }
}
