use lidar::Ring;
use messages::{Part, Sweep, SweepHeader};

use crate::stray::MOST_STRAY_RAD;

/// What is known of a sweep from the sectors before.
pub(crate) struct Before {
    header: SweepHeader,
    rings: Vec<Ring>,
    columns: u32,
    recorded: u64,
    /// Lowest index that the next return may have.
    next_index: u32,
}

impl Before {
    pub(crate) fn new() -> Self {
        let rings = Vec::with_capacity(lidar::MAX_RINGS);
        Self { header: SweepHeader::default(), rings, columns: 0, recorded: 0, next_index: 0 }
    }

    /// Begins a sweep with its first sector.
    pub(crate) fn begin(&mut self, first: &Sweep) {
        self.header = first.header;
        self.rings.clear();
        self.rings.extend_from_slice(&first.rings);
        (self.columns, self.recorded, self.next_index) = (0, 0, 0);
    }

    /// Whether the next sector says nothing that contradicts itself or those before; then it is one of those before.
    ///
    /// Lengths match the header's counts; columns and indices follow those before; positions are finite; header and rings
    /// are the sweep's; organised: each return lies on a ring and in a received column of finite azimuth; unorganised: no
    /// ring, no column. What a return of an unorganised sweep says of ring and column is not looked at. A sweep that may
    /// not be cut is all in its last sector, one that may is organised.
    pub(crate) fn add(&mut self, part: &Part, sector: &Sweep) -> bool {
        let consistent = self.is_same_sweep(sector)
            && can_promise(&sector.header)
            && self.counts_match(part, sector)
            && self.indices_rise(part, sector)
            && positions_are_finite(sector)
            && places_exist(sector);
        self.columns += sector.columns.len() as u32;
        self.recorded += u64::from(sector.header.recorded);
        if let Some(last) = sector.returns.len().checked_sub(1) {
            self.next_index = sector.index_of(last).saturating_add(1);
        }
        consistent
    }

    fn is_same_sweep(&self, sector: &Sweep) -> bool {
        let (first, this) = (&self.header, &sector.header);
        let same_numbers = [
            (first.column_step_rad, this.column_step_rad),
            (first.range_sigma_m, this.range_sigma_m),
            (first.reach_m, this.reach_m),
            (first.stray_rad, this.stray_rad),
        ];
        same_numbers.iter().all(|(first, this)| first.to_bits() == this.to_bits())
            && (first.sensor_time_ns, first.period_ns, first.organised)
                == (this.sensor_time_ns, this.period_ns, this.organised)
            && self.rings[..] == sector.rings[..]
    }

    fn counts_match(&self, part: &Part, sector: &Sweep) -> bool {
        let returns = sector.returns.len();
        let refused: u64 = sector.header.refused.iter().map(|&count| u64::from(count)).sum();
        let indexed = sector.recorded_index.len() == returns || (sector.recorded_index.is_empty() && refused == 0);
        let may_hold = sector.header.stray_rad > 0.0 || part.is_last() || (returns == 0 && sector.columns.is_empty());
        may_hold
            && indexed
            && sector.first_column == self.columns
            && u64::from(sector.header.recorded) == returns as u64 + refused
    }

    fn indices_rise(&self, part: &Part, sector: &Sweep) -> bool {
        let indices = &sector.recorded_index[..];
        let first = indices.first().copied().unwrap_or(sector.first_return);
        let last = sector.returns.len().checked_sub(1).map(|last| u64::from(first).max(last_index(sector, last)));
        let recorded = self.recorded + u64::from(sector.header.recorded);
        sector.first_return <= first
            && (sector.first_return >= self.next_index || sector.returns.is_empty())
            && indices.windows(2).all(|pair| pair[0] < pair[1])
            && (!part.is_last() || last.is_none_or(|last| last < recorded))
    }
}

/// Whether a sweep that promises to be regular is one that can.
fn can_promise(header: &SweepHeader) -> bool {
    let SweepHeader { stray_rad, column_step_rad, .. } = *header;
    let is_able = header.is_organised() && column_step_rad > 0.0 && column_step_rad.is_finite();
    stray_rad == 0.0 || (is_able && (0.0..=MOST_STRAY_RAD).contains(&stray_rad))
}

/// Index of the return at the place `last`, which may be beyond what an index can say.
fn last_index(sector: &Sweep, last: usize) -> u64 {
    match sector.recorded_index.get(last) {
        Some(&index) => u64::from(index),
        None => u64::from(sector.first_return) + last as u64,
    }
}

fn positions_are_finite(sector: &Sweep) -> bool {
    // Infinities and NaN are the floats whose exponent is all ones. No early exit: the loop stays in vector registers.
    const EXPONENT: u32 = 0x7F80_0000;
    let is_odd = |value: f32| u32::from(value.to_bits() & EXPONENT == EXPONENT);
    sector.returns.iter().fold(0, |odd, r| odd | is_odd(r.x) | is_odd(r.y) | is_odd(r.z)) == 0
}

fn places_exist(sector: &Sweep) -> bool {
    let (rings, columns) = (sector.rings.len(), sector.columns.len());
    if !sector.header.is_organised() {
        return rings == 0 && columns == 0;
    }
    let received = |column: u16| {
        let place = u32::from(column).checked_sub(sector.first_column);
        place.and_then(|place| sector.columns.get(place as usize)).is_some_and(|column| column.valid != 0)
    };
    sector.rings.iter().all(|ring| ring.elevation_rad.is_finite())
        && sector.columns.iter().all(|column| column.valid == 0 || column.azimuth_rad.is_finite())
        && sector.returns.iter().all(|r| usize::from(r.ring) < rings && received(r.column))
}
