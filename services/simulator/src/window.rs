//! The angular window of an obstacle: which firings of a turn can meet its bounding ball at all.

#[cfg(test)]
mod tests;

use std::ops::Range;

use nalgebra::Vector3;

use crate::turn::Turn;

/// Slack for rounding [rad]: far above the error of a double's arc functions, far below a column's step.
const SLACK_RAD: f64 = 1e-9;

/// Columns (from `first_column` on, round the turn) × rings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Window {
    pub(crate) first_column: usize,
    pub(crate) columns: usize,
    pub(crate) rings: Range<usize>,
}

impl Window {
    /// Every firing of the turn.
    pub(crate) fn whole(turn: &Turn) -> Self {
        Self { first_column: 0, columns: turn.columns().len(), rings: 0..turn.rings().len() }
    }

    /// All firings that can meet a ball: centre [m] in the sensor frame, radius [m].
    ///
    /// A ball round the sensor is seen by all of them; one above or below it in all columns.
    /// Seen from the origin the ball spans asin(R/|c|) in elevation and asin(R/h) in azimuth, h its horizontal distance.
    pub(crate) fn around(turn: &Turn, centre: &Vector3<f64>, radius: f64) -> Self {
        let distance = centre.norm();
        if radius >= distance {
            return Self::whole(turn);
        }
        let elevation = (centre.z / distance).asin();
        let half_height = (radius / distance).asin() + SLACK_RAD;
        let from = turn.first_ring_from(elevation - half_height);
        let rings = from..turn.first_ring_from(elevation + half_height).max(from);

        let horizontal = centre.x.hypot(centre.y);
        if radius >= horizontal {
            return Self { rings, ..Self::whole(turn) };
        }
        let heading = -centre.y.atan2(centre.x);
        let half_width = (radius / horizontal).asin() + SLACK_RAD;
        let [least_lead, greatest_lead] = turn.lead_range_rad();
        let step = turn.step_rad();
        let first = ((heading - half_width - greatest_lead) / step).ceil() as i64;
        let last = ((heading + half_width - least_lead) / step).floor() as i64;
        let count = turn.columns().len();
        Self {
            first_column: first.rem_euclid(count as i64) as usize,
            columns: (last + 1 - first).clamp(0, count as i64) as usize,
            rings,
        }
    }

    /// The window's columns.
    pub(crate) fn columns(&self, turn: &Turn) -> impl Iterator<Item = usize> {
        let count = turn.columns().len();
        let first = self.first_column;
        (0..self.columns).map(move |place| (first + place) % count)
    }
}
