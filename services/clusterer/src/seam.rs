use std::f32::consts::FRAC_PI_2;

use lidar::{MAX_COLUMNS, Return};
use messages::Sweep;

/// Columns round a member in which something may still change for its cluster, at least: two of cells and one for the
/// dropout test on the outer ones.
const LEAST_COLUMNS: usize = 3;

/// Whether a return's window touches the first or last column of its sweep.
///
/// The window of a return at horizontal range h is max(asin(d/h) / step + 1, 3) columns to both sides, where step is
/// the header's `column_step_rad` and 1 is for the head's turn while a column fires. For h ≤ d it is the whole turn.
pub(crate) struct Seam {
    range_d_m: f32,
    /// For each column the least d/h whose window touches: the sine of the way to the nearer end less one column.
    touching_sine: Vec<f32>,
}

impl Seam {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self { range_d_m, touching_sine: Vec::with_capacity(MAX_COLUMNS) }
    }

    /// Takes the measure of a sweep. Without a column step every window touches.
    pub(crate) fn measure(&mut self, sweep: &Sweep) {
        let step_rad = sweep.header.column_step_rad.max(0.0);
        let columns = sweep.columns.len();
        self.touching_sine.clear();
        self.touching_sine.extend((0..columns).map(|column| {
            let to_end = column.min(columns - 1 - column);
            if to_end <= LEAST_COLUMNS {
                return 0.0;
            }
            ((to_end - 1) as f32 * step_rad).min(FRAC_PI_2).sin()
        }));
    }

    /// Whether the window of `r` touches; `r` is a return of the organised sweep that was measured.
    pub(crate) fn touches(&self, r: &Return) -> bool {
        // asin(d/h) ≥ (to_end − 1) · step, squared to spare the root.
        let least = self.touching_sine[usize::from(r.column)];
        let h_m2 = r.x * r.x + r.y * r.y;
        // The first test is for h² beyond single precision, of which nothing times 0 is known.
        least == 0.0 || self.range_d_m * self.range_d_m >= h_m2 * (least * least)
    }
}
