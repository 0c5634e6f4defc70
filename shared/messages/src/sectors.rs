//! Cutting a sweep into the azimuth sectors that it travels as.
//!
//! A cluster may be closed, and sent on, only when nothing that is still to come can belong to it. That needs a promise
//! about the rest of the sweep, which whoever has the whole sweep (or knows the sensor) makes in the header.

use std::f64::consts::{FRAC_PI_2, TAU};

use lidar::Column;

use crate::Sweep;

/// Largest sine of the angle between a return and its column with which a sweep is still cut: 0.1 rad. Velodyne's
/// lasers look sideways by at most 0.08 rad (VLP-32C).
const MOST_STRAY_SINE: f32 = 0.0998;
/// Sine of the elevation above which single precision is too coarse to measure it.
const STEEP_SINE: f32 = 0.999;
/// Squared range above which nothing is measured any more [m²].
const FAR_M2: f32 = 1e12;
/// Widens the measured bound for rounding: 1e-5 rad is some hundred roundings of a single-precision angle.
const MARGIN_RAD: f32 = 1e-5;

/// Cuts sweeps into a fixed number of sectors of equally many columns.
///
/// A sweep may be cut when it is organised, has at least a column a sector, its columns never go back, leave no gap of a
/// right angle and cover less than a turn, its returns come in order of their columns, no firing gave two, and each lies
/// within 0.1 rad of its column, below 87.4° and 1,000 km. One that may not (clouds, dual returns, torn recordings) is
/// empty in every sector but the last, which has all of it.
#[derive(Clone, Copy, Debug)]
pub struct Cutter {
    sectors: u32,
}

impl Cutter {
    /// Cuts into `sectors`, at least 1.
    pub fn new(sectors: u32) -> Self {
        Self { sectors: sectors.max(1) }
    }

    /// Finds out whether a whole sweep may be cut and says so in its header.
    pub fn measure(&self, whole: &mut Sweep) {
        let enough = whole.columns.len() >= self.sectors as usize;
        let measured = if enough { stray_rad(whole) } else { None };
        whole.header.stray_rad = measured.unwrap_or(0.0);
    }

    /// Fills an empty `piece` with one sector of a whole, measured sweep.
    ///
    /// Only the last sector is marked complete, where the sweep is; it alone counts the refused returns.
    pub fn fill(&self, whole: &Sweep, sector: u32, piece: &mut Sweep) {
        let last = sector + 1 >= self.sectors;
        let (columns, returns) = match (whole.header.stray_rad > 0.0, last) {
            (true, _) => {
                let columns = self.columns(whole, sector);
                let place = |column| whole.returns.partition_point(|r| usize::from(r.column) < column);
                (columns.clone(), place(columns.start)..place(columns.end))
            }
            (false, false) => (0..0, 0..0),
            (false, true) => (0..whole.columns.len(), 0..whole.returns.len()),
        };
        piece.header = whole.header;
        piece.header.recorded = returns.len() as u32;
        if last {
            piece.header.recorded += whole.header.refused.iter().sum::<u32>();
        } else {
            piece.header.complete = 0;
            piece.header.refused = Default::default();
        }
        piece.first_column = columns.start as u32;
        piece.first_return = whole.index_of(returns.start);
        // A piece is never larger than the whole.
        let _ = piece.rings.extend_from_slice(&whole.rings);
        let _ = piece.columns.extend_from_slice(&whole.columns[columns]);
        if !whole.recorded_index.is_empty() {
            let _ = piece.recorded_index.extend_from_slice(&whole.recorded_index[returns.clone()]);
        }
        let _ = piece.returns.extend_from_slice(&whole.returns[returns]);
    }

    /// Time after the start of the sweep at which a sector's last firing is done [ns].
    pub fn end_offset_ns(&self, whole: &Sweep, sector: u32) -> u64 {
        let period_ns = whole.header.period_ns;
        if sector + 1 >= self.sectors {
            return period_ns;
        }
        let next = self.columns(whole, sector).end;
        match whole.columns.get(next).filter(|column| column.valid != 0) {
            Some(column) => u64::from(column.offset_ns).min(period_ns),
            None => period_ns / u64::from(self.sectors) * u64::from(sector + 1),
        }
    }

    fn columns(&self, whole: &Sweep, sector: u32) -> std::ops::Range<usize> {
        let (columns, sectors) = (whole.columns.len() as u64, u64::from(self.sectors));
        let begin = |sector: u64| (columns * sector.min(sectors) / sectors) as usize;
        begin(u64::from(sector))..begin(u64::from(sector) + 1)
    }
}

/// A bound on the angle between returns and their columns [rad]; none where the sweep may not be cut.
fn stray_rad(sweep: &Sweep) -> Option<f32> {
    let header = &sweep.header;
    if !header.is_organised() || header.column_step_rad.is_nan() || header.column_step_rad <= 0.0 {
        return None;
    }
    if !goes_round_once(&sweep.columns) {
        return None;
    }
    let rings = sweep.rings.len();
    let (mut most_sine, mut column, mut fired) = (0.0_f32, 0, 0_u64);
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (place, r) in sweep.returns.iter().enumerate() {
        if place == 0 || r.column != column {
            let here = sweep.columns.get(usize::from(r.column)).filter(|here| here.valid != 0)?;
            if place > 0 && r.column < column {
                return None;
            }
            (column, fired) = (r.column, 0);
            (sine, cosine) = here.azimuth_rad.sin_cos();
        }
        let h_m2 = r.x * r.x + r.y * r.y;
        let range_m2 = h_m2 + r.z * r.z;
        let (along_m, across_m) = (r.x * cosine + r.y * sine, (r.y * cosine - r.x * sine).abs());
        let steep = r.z * r.z > STEEP_SINE * STEEP_SINE * range_m2;
        let bit = 1_u64.checked_shl(u32::from(r.ring)).filter(|_| usize::from(r.ring) < rings)?;
        // Not finite fails the first test.
        if !(range_m2 < FAR_M2 && along_m > 0.0) || steep || fired & bit != 0 {
            return None;
        }
        fired |= bit;
        most_sine = most_sine.max(across_m / h_m2.sqrt());
    }
    (most_sine <= MOST_STRAY_SINE).then(|| most_sine.asin() + MARGIN_RAD)
}

/// Whether received columns turn in one sense, by less than a right angle from one to the next, and less than a turn in
/// all.
fn goes_round_once(columns: &[Column]) -> bool {
    let mut received = columns.iter().filter(|column| column.valid != 0).map(|column| f64::from(column.azimuth_rad));
    let Some(mut before) = received.next() else { return true };
    let (mut sense, mut turned) = (0.0_f64, 0.0);
    for azimuth in received {
        let step = (azimuth - before + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        if step != 0.0 && sense == 0.0 {
            sense = step.signum();
        }
        // Not finite fails; far out, single precision no longer knows the angle.
        if !(step * sense >= 0.0 && step.abs() < FRAC_PI_2 && azimuth.abs() <= TAU) {
            return false;
        }
        turned += step.abs();
        before = azimuth;
    }
    turned < TAU && before.abs() <= TAU
}

#[cfg(test)]
mod tests {
    use lidar::{Return, Ring};
    use zerocopy::FromZeros;

    use super::*;

    const COLUMNS: u32 = 100;

    /// A full turn of two rings with returns 5 m off, of which every seventh firing has none and one was refused.
    fn turn() -> Box<Sweep> {
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        let step = TAU as f32 / COLUMNS as f32;
        (sweep.header.organised, sweep.header.complete, sweep.header.column_step_rad) = (1, 1, step);
        sweep.header.period_ns = u64::from(COLUMNS) * 1_000;
        for elevation_rad in [-0.1, 0.1] {
            sweep.rings.push(Ring { elevation_rad, offset_ns: 0 }).unwrap();
        }
        for column in 0..COLUMNS {
            let azimuth_rad = column as f32 * step - 3.0;
            sweep.columns.push(Column { azimuth_rad, offset_ns: column * 1_000, valid: 1 }).unwrap();
            for ring in (0..2).filter(|ring| (2 * column + ring) % 7 != 0) {
                let (y, x) = (azimuth_rad + 0.01).sin_cos();
                let r =
                    Return { x: 5.0 * x, y: 5.0 * y, z: 0.5, column: column as u16, ring: ring as u8, intensity: 0 };
                sweep.recorded_index.push(sweep.returns.len() as u32 + 1).unwrap();
                sweep.returns.push(r).unwrap();
            }
        }
        sweep.header.refused[0] = 1;
        sweep.header.recorded = sweep.returns.len() as u32 + 1;
        sweep
    }

    fn pieces(whole: &Sweep, sectors: u32) -> Vec<Box<Sweep>> {
        let fill = |sector| {
            let mut piece = Sweep::new_box_zeroed().unwrap();
            Cutter::new(sectors).fill(whole, sector, &mut piece);
            piece
        };
        (0..sectors).map(fill).collect()
    }

    #[test]
    fn sectors_together_are_the_sweep_and_only_the_last_says_that_it_is_complete() {
        for sectors in [1, 3, 7, 100] {
            let mut whole = turn();
            Cutter::new(sectors).measure(&mut whole);
            assert!((whole.header.stray_rad - 0.01).abs() < 1e-4, "{}", whole.header.stray_rad);
            let pieces = pieces(&whole, sectors);
            let returns: Vec<Return> = pieces.iter().flat_map(|piece| piece.returns.to_vec()).collect();
            assert_eq!(returns, whole.returns[..]);
            let indices: Vec<u32> = pieces.iter().flat_map(|piece| piece.recorded_index.to_vec()).collect();
            assert_eq!(indices, whole.recorded_index[..]);
            assert_eq!(pieces.iter().map(|piece| piece.columns.len()).sum::<usize>(), whole.columns.len());
            assert_eq!(pieces.iter().map(|piece| piece.header.recorded).sum::<u32>(), whole.header.recorded);
            for (sector, piece) in pieces.iter().enumerate() {
                let first = u32::from(piece.returns.first().unwrap().column);
                assert!(first >= piece.first_column, "returns are of the piece's own columns");
                assert_eq!(piece.header.is_complete(), sector + 1 == sectors as usize);
                assert_eq!(piece.header.accepted() as usize, piece.returns.len());
            }
        }
    }

    #[test]
    fn sectors_in_order_join_to_the_sweep_again_and_a_gap_leaves_it_out() {
        use crate::{Joiner, Part, Raw};
        let bytes = |sweep: &Sweep| {
            let mut bytes = Vec::new();
            sweep.write_raw(&mut bytes);
            bytes
        };
        let part = |sweep, sector, sectors| Part { sweep, sector, sectors, ..Part::default() };
        let mut sut = Joiner::new().unwrap();
        for sectors in [1, 3, 100] {
            let mut whole = turn();
            Cutter::new(sectors).measure(&mut whole);
            let pieces = pieces(&whole, sectors);
            // Half a sweep, then the same from its beginning: the second copy counts.
            for sector in (0..sectors / 2).chain(0..sectors) {
                let joined = sut.add(&part(4, sector, sectors), &pieces[sector as usize]);
                assert_eq!(joined.map(bytes), (sector + 1 == sectors).then(|| bytes(&whole)), "{sector} of {sectors}");
            }
            for missing in 0..sectors {
                let rest = (0..sectors).filter(|&sector| sector != missing);
                let mut joined =
                    rest.map(|sector| sut.add(&part(5, sector, sectors), &pieces[sector as usize]).is_some());
                assert!(!joined.any(|joined| joined), "{missing} of {sectors}");
            }
        }
    }

    #[test]
    fn sectors_end_when_the_next_ones_first_column_fires_and_the_last_with_the_turn() {
        let whole = turn();
        let ends: Vec<u64> = (0..4).map(|sector| Cutter::new(4).end_offset_ns(&whole, sector)).collect();
        assert_eq!(ends, [25_000, 50_000, 75_000, 100_000]);
    }

    #[test]
    fn a_sweep_that_makes_no_promise_travels_in_its_last_sector() {
        type Spoil = fn(&mut Sweep);
        let spoils: [(&str, Spoil); 9] = [
            ("an azimuth many turns out", |sweep| sweep.columns[50].azimuth_rad += 1e4 * TAU as f32),
            ("unorganised", |sweep| sweep.header.organised = 0),
            ("two returns of a firing", |sweep| sweep.returns[1].ring = sweep.returns[0].ring),
            ("columns out of order", |sweep| sweep.returns.swap(0, 50)),
            ("a column that goes back", |sweep| sweep.columns[50].azimuth_rad -= 0.2),
            ("a column that is not a number", |sweep| sweep.columns[50].azimuth_rad = f32::NAN),
            ("a return beside its column", |sweep| sweep.returns[9].x += 2.0),
            ("a return that is not a number", |sweep| sweep.returns[9].y = f32::NAN),
            ("a column not received", |sweep| sweep.columns[50].valid = 0),
        ];
        for (what, spoil) in spoils {
            let mut whole = turn();
            spoil(&mut whole);
            Cutter::new(4).measure(&mut whole);
            assert_eq!(whole.header.stray_rad, 0.0, "{what}");
            let pieces = pieces(&whole, 4);
            let returns: Vec<usize> = pieces.iter().map(|piece| piece.returns.len()).collect();
            assert_eq!(returns, [0, 0, 0, whole.returns.len()], "{what}");
        }
        let mut few = turn();
        Cutter::new(COLUMNS + 1).measure(&mut few);
        assert_eq!(few.header.stray_rad, 0.0, "fewer columns than sectors");
    }
}
