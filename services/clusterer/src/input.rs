use messages::{Part, Sweep};

/// Whether a whole sweep says nothing that contradicts itself.
///
/// Lengths match the header's counts; a whole sweep begins with its first column and return; indices rise; positions
/// are finite; organised: each return lies on a ring and in a received column of finite azimuth;
/// unorganised: no ring, no column. What a return of an unorganised sweep says of ring and column is not looked at.
pub(crate) fn is_consistent(part: &Part, sweep: &Sweep) -> bool {
    counts_match(part, sweep) && indices_rise(sweep) && positions_are_finite(sweep) && places_exist(sweep)
}

fn counts_match(part: &Part, sweep: &Sweep) -> bool {
    let returns = sweep.returns.len();
    let refused: u64 = sweep.header.refused.iter().map(|&count| u64::from(count)).sum();
    let first = part.sector == 0 && sweep.first_column == 0 && sweep.first_return == 0;
    let indexed = sweep.recorded_index.len() == returns || (sweep.recorded_index.is_empty() && refused == 0);
    first && indexed && u64::from(sweep.header.recorded) == returns as u64 + refused
}

fn indices_rise(sweep: &Sweep) -> bool {
    let indices = &sweep.recorded_index[..];
    indices.windows(2).all(|pair| pair[0] < pair[1]) && indices.last().is_none_or(|&last| last < sweep.header.recorded)
}

fn positions_are_finite(sweep: &Sweep) -> bool {
    // Infinities and NaN are the floats whose exponent is all ones. No early exit: the loop stays in vector registers.
    const EXPONENT: u32 = 0x7F80_0000;
    let is_odd = |value: f32| u32::from(value.to_bits() & EXPONENT == EXPONENT);
    sweep.returns.iter().fold(0, |odd, r| odd | is_odd(r.x) | is_odd(r.y) | is_odd(r.z)) == 0
}

fn places_exist(sweep: &Sweep) -> bool {
    let (rings, columns) = (sweep.rings.len(), sweep.columns.len());
    if !sweep.header.is_organised() {
        return rings == 0 && columns == 0;
    }
    let received = |column: u16| sweep.columns.get(usize::from(column)).is_some_and(|column| column.valid != 0);
    sweep.rings.iter().all(|ring| ring.elevation_rad.is_finite())
        && sweep.columns.iter().all(|column| column.valid == 0 || column.azimuth_rad.is_finite())
        && sweep.returns.iter().all(|r| usize::from(r.ring) < rings && received(r.column))
}
