use std::io::Write;

use crate::page::{self, About};
use crate::{Recording, Selection, ViewError};

/// What a page may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most returns of a sweep; beyond, every k-th is kept.
    pub points: usize,
    /// Most bytes of sweeps in a written page, as they stand in it; beyond, sweeps are left out evenly.
    pub bytes: usize,
}

impl Default for Limits {
    /// All returns of any sweep; 40 MB.
    fn default() -> Self {
        Self { points: lidar::MAX_RETURNS, bytes: 40_000_000 }
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Sweeps selected.
    pub selected: usize,
    /// Sweeps in the page: all of them, or every second, fourth…
    pub kept: usize,
    /// Bytes that the sweeps take in the page.
    pub sweep_bytes: usize,
}

/// Writes a recording's sweeps as one page that needs nothing else.
///
/// Where the sweeps would take more than `limits.bytes`, every second of those selected is left out, then every second of
/// what is left, until they do not; one always stays.
///
/// # Errors
/// Nothing is selected; the recording changed under us; the page cannot be written.
pub fn write_page(
    recording: &mut Recording,
    selection: Selection,
    limits: Limits,
    out: &mut impl Write,
) -> Result<Written, ViewError> {
    let selected = recording.select(selection)?;
    let (mut kept, mut sweeps) = (Vec::new(), Vec::new());
    let (mut stride, mut sum) = (1, 0);
    for (turn, &place) in selected.iter().enumerate() {
        if turn % stride != 0 {
            continue;
        }
        let sweep = recording.encoded(place, limits.points)?;
        sum += in_page(&sweep);
        kept.push(place);
        sweeps.push(sweep);
        while sum > limits.bytes && kept.len() > 1 {
            stride *= 2;
            kept = every_second(kept);
            sweeps = every_second(sweeps);
            sum = sweeps.iter().map(|sweep: &Vec<u8>| in_page(sweep)).sum();
        }
    }
    let about = About { selected: selected.len(), ..About::of(recording, &kept, limits.points, false) };
    page::write(out, &about, &sweeps).and_then(|()| out.flush()).map_err(ViewError::Write)?;
    Ok(Written { selected: selected.len(), kept: kept.len(), sweep_bytes: sum })
}

/// Bytes of a deflated sweep as base64.
fn in_page(sweep: &[u8]) -> usize {
    sweep.len().div_ceil(3) * 4
}

fn every_second<T>(items: Vec<T>) -> Vec<T> {
    items.into_iter().step_by(2).collect()
}
