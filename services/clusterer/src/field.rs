use std::f32::consts::{PI, TAU};

use lidar::MAX_RINGS;

use crate::cells::REACH;
use crate::seen::Seen;

/// The sweep as a field of cells.
pub(crate) struct Field<'a> {
    pub(crate) seen: &'a Seen<'a>,
    /// Whether the first column follows the last.
    wraps: bool,
    /// Key of each return's cluster.
    pub(crate) cluster_of: &'a [u32],
    /// Key of the cluster whose cells are sought.
    pub(crate) cluster: u32,
    pub(crate) rings: usize,
    columns: usize,
    pub(crate) ring_bits: u64,
    /// +1 where azimuth rises with the column, −1 where it falls.
    sense: f32,
    /// The head's turn [rad/ns]; 0 where it is not known.
    turn_rad_per_ns: f32,
}

impl<'a> Field<'a> {
    pub(crate) fn new(seen: &'a Seen<'a>, cluster_of: &'a [u32], sense: f32, last: bool) -> Self {
        let (rings, columns) = (seen.rings.len(), seen.columns.len());
        let period_ns = seen.header.period_ns;
        Self {
            seen,
            wraps: last && seen.header.is_complete(),
            cluster_of,
            cluster: 0,
            rings,
            columns,
            ring_bits: u64::MAX >> (MAX_RINGS - rings),
            sense,
            turn_rad_per_ns: if period_ns == 0 { 0.0 } else { TAU / period_ns as f32 },
        }
    }

    /// The spot some columns away: round the turn where the sweep is complete, on past its ends where it is not.
    pub(crate) fn spot(&self, spot: usize, columns: isize) -> usize {
        let there = spot.saturating_add_signed(columns);
        if !self.wraps {
            return there;
        }
        // Turns are added so that two columns before the first one still count upwards.
        (there + REACH * self.columns - REACH) % self.columns + REACH
    }

    /// As [`Field::spot`]; none where no spot is so far out.
    pub(crate) fn spot_if_any(&self, spot: usize, columns: isize) -> Option<usize> {
        let there = spot.checked_add_signed(columns).map(|_| self.spot(spot, columns))?;
        (there < self.columns + 2 * REACH).then_some(there)
    }

    /// The column of a spot if it was received.
    pub(crate) fn received(&self, spot: usize) -> Option<usize> {
        let column = spot.checked_sub(REACH)?;
        self.seen.columns.get(column).filter(|column| column.valid != 0).map(|_| column)
    }

    /// The firings of a spot.
    pub(crate) fn axis(&self, spot: usize) -> Axis {
        let column = spot.saturating_sub(REACH).min(self.columns - 1);
        let beyond = spot as f32 - (column + REACH) as f32;
        let azimuth_rad = self.seen.columns[column].azimuth_rad;
        Axis { azimuth_rad, beyond_rad: beyond * self.seen.header.column_step_rad }
    }
}

/// Where a column's firings point.
pub(crate) struct Axis {
    /// Of the sweep's column nearest to it.
    azimuth_rad: f32,
    /// From there on to the column.
    beyond_rad: f32,
}

impl Axis {
    /// Azimuth of a firing [rad] in [−π, π): its column's and the head's turn since the column's first firing. Past the
    /// sweep's ends it goes on by the header's step. In an invalid column it is as good as the sweep's; 0 for none.
    pub(crate) fn azimuth_rad(&self, field: &Field, ring: usize) -> f32 {
        let turned_rad = field.turn_rad_per_ns * field.seen.rings[ring].offset_ns as f32;
        let on_rad = field.sense * (self.beyond_rad + turned_rad);
        let azimuth_rad = match self.azimuth_rad + on_rad + PI {
            // The remainder is slow, and seldom needed.
            within if (0.0..TAU).contains(&within) => within,
            beyond => beyond.rem_euclid(TAU),
        } - PI;
        match azimuth_rad {
            finite if finite < PI => finite,
            rounded_up if rounded_up.is_finite() => -PI,
            _ => 0.0,
        }
    }
}
