use lidar::{Column, MAX_COLUMNS, MAX_RETURNS, Return, Ring};
use messages::{Sweep, SweepHeader};

/// What has been seen of a sweep so far; all of it once its last sector is there.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    /// Of the last part.
    pub(crate) header: &'a SweepHeader,
    pub(crate) rings: &'a [Ring],
    pub(crate) columns: &'a [Column],
    pub(crate) returns: &'a [Return],
    /// Index in the sweep of each return; empty where that is its place.
    indices: &'a [u32],
}

impl<'a> Seen<'a> {
    /// A sweep that travels whole.
    pub(crate) fn whole(sweep: &'a Sweep) -> Self {
        Self {
            header: &sweep.header,
            rings: &sweep.rings,
            columns: &sweep.columns,
            returns: &sweep.returns,
            indices: &sweep.recorded_index,
        }
    }

    /// Index in the sweep of the return at `place`.
    #[inline]
    pub(crate) fn index_of(&self, place: usize) -> u32 {
        self.indices.get(place).copied().unwrap_or(place as u32)
    }
}

/// The sectors of a sweep, one after the other.
pub(crate) struct Store {
    columns: Vec<Column>,
    returns: Vec<Return>,
    indices: Vec<u32>,
}

impl Store {
    pub(crate) fn new() -> Self {
        Self {
            columns: Vec::with_capacity(MAX_COLUMNS),
            returns: Vec::with_capacity(MAX_RETURNS),
            indices: Vec::with_capacity(MAX_RETURNS),
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self) {
        self.columns.clear();
        self.returns.clear();
        self.indices.clear();
    }

    /// Adds the next sector. False, and nothing is added, where it is more than a sweep may have.
    pub(crate) fn add(&mut self, sector: &Sweep) -> bool {
        let (columns, returns) = (self.columns.len() + sector.columns.len(), self.returns.len() + sector.returns.len());
        if columns > MAX_COLUMNS || returns > MAX_RETURNS {
            return false;
        }
        self.columns.extend_from_slice(&sector.columns);
        self.returns.extend_from_slice(&sector.returns);
        match sector.recorded_index.is_empty() {
            true => self.indices.extend((0..sector.returns.len()).map(|place| sector.index_of(place))),
            false => self.indices.extend_from_slice(&sector.recorded_index),
        }
        true
    }

    /// All sectors up to `last`, which was added.
    pub(crate) fn seen<'a>(&'a self, last: &'a Sweep) -> Seen<'a> {
        Seen {
            header: &last.header,
            rings: &last.rings,
            columns: &self.columns,
            returns: &self.returns,
            indices: &self.indices,
        }
    }
}
