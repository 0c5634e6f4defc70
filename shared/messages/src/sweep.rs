use lidar::{Column, MAX_COLUMNS, MAX_RETURNS, MAX_RINGS, Return, Ring};
use zerocopy::{FromZeros, Immutable, KnownLayout};

use crate::{Bounded, Message, SweepHeader};

/// One azimuth sector of a sweep, as the sensor or a recording gave it (the whole sweep where there is one sector).
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Sweep {
    /// What is known of the sweep as a whole.
    pub header: SweepHeader,
    /// Index in the sweep of this part's first column.
    pub first_column: u32,
    /// Index in the sweep of this part's first recorded return.
    pub first_return: u32,
    /// The sensor's beams by elevation; empty in an unorganised sweep.
    pub rings: Bounded<Ring, MAX_RINGS>,
    /// Columns of this part in firing order; empty in an unorganised sweep.
    pub columns: Bounded<Column, MAX_COLUMNS>,
    /// Accepted returns of this part in firing order (unorganised: in the recording's order).
    pub returns: Bounded<Return, MAX_RETURNS>,
    /// Index in the sweep of each of `returns`, counted over all recorded returns.
    /// Empty where none was refused: then a return's index is `first_return` plus its place.
    pub recorded_index: Bounded<u32, MAX_RETURNS>,
}

impl Sweep {
    /// Index in the sweep, counted over all recorded returns, of the return at `place` in `returns`.
    pub fn index_of(&self, place: usize) -> u32 {
        match self.recorded_index.get(place) {
            Some(&index) => index,
            None => self.first_return + place as u32,
        }
    }
}

impl Message for Sweep {
    const TYPE: &'static str = "encke.Sweep.3";

    fn clear(&mut self) {
        self.header = SweepHeader::default();
        self.first_column = 0;
        self.first_return = 0;
        self.rings.clear();
        self.columns.clear();
        self.returns.clear();
        self.recorded_index.clear();
    }
}
