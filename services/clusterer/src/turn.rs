use std::f32::consts::{PI, TAU};

use lidar::{Column, MAX_COLUMNS};

/// Steps in which azimuths are looked up.
const STEPS: usize = 8_192;

/// Columns of a sweep by how far the head had turned.
///
/// The travel of a column is its azimuth, counted in the sense in which the head turns and on through ±π, so that it
/// rises with the column. Where measured azimuths go back a little, "first column" means the first of all.
pub(crate) struct Turn {
    sense: f32,
    /// Travel of each column [rad]; that of a column that was not received is its predecessor's.
    travel_rad: Vec<f32>,
    /// First column whose running maximum of travel reaches the lower edge of each step.
    first: Vec<u16>,
    start_rad: f32,
    end_rad: f32,
    steps_per_rad: f32,
}

impl Turn {
    pub(crate) fn new() -> Self {
        Self {
            sense: 1.0,
            travel_rad: Vec::with_capacity(MAX_COLUMNS),
            first: Vec::with_capacity(STEPS),
            start_rad: 0.0,
            end_rad: 0.0,
            steps_per_rad: 0.0,
        }
    }

    /// Measures the turn of `columns`. Says whether two columns whose azimuths differ by less than 3 rad (mod 2π) differ
    /// in travel by that much, or by that much and one turn: they cover less than a turn and a half and never go back by
    /// more than a right angle, and no azimuth is so far out that it is no longer known to the margins of the window.
    pub(crate) fn measure(&mut self, columns: &[Column]) -> bool {
        self.sense = sense(columns);
        self.travel_rad.clear();
        let mut last: Option<(f32, f64)> = None;
        let (mut start, mut end, mut back) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
        let mut known = true;
        for column in columns {
            if column.valid != 0 {
                let azimuth = self.sense * column.azimuth_rad;
                known &= azimuth.abs() <= TAU;
                let travel = match last {
                    None => f64::from(azimuth),
                    Some((before, travel)) => travel + step_on(before, azimuth),
                };
                last = Some((azimuth, travel));
                (start, end) = (start.min(travel), end.max(travel));
                back = back.max(end - travel);
            }
            self.travel_rad.push(last.map_or(0.0, |(_, travel)| travel as f32));
        }
        let (start, end) = if start <= end { (start, end) } else { (0.0, 0.0) };
        (self.start_rad, self.end_rad) = (start as f32, end as f32);
        self.tabulate(columns);
        known && end - start < f64::from(1.5 * TAU) && back < f64::from(PI / 2.0)
    }

    fn tabulate(&mut self, columns: &[Column]) {
        let covered = (self.end_rad - self.start_rad).max(f32::MIN_POSITIVE);
        self.steps_per_rad = (STEPS - 1) as f32 / covered;
        self.first.clear();
        for (column, &travel) in self.travel_rad.iter().enumerate().filter(|&(column, _)| columns[column].valid != 0) {
            let reached = ((travel - self.start_rad) * self.steps_per_rad) as usize; // below 0 counts as 0
            while self.first.len() <= reached.min(STEPS - 1) {
                self.first.push(column as u16);
            }
        }
        let none = columns.len() as u16;
        while self.first.len() < STEPS {
            self.first.push(none);
        }
    }

    /// +1 where azimuth rises with the column, −1 where it falls.
    pub(crate) fn sense(&self) -> f32 {
        self.sense
    }

    /// Travel of a column [rad].
    #[inline]
    pub(crate) fn travel_rad(&self, column: usize) -> f32 {
        self.travel_rad[column]
    }

    /// A column such that none before it has travelled `travel_rad` or more; the number of columns where none has.
    #[inline]
    pub(crate) fn first_from(&self, travel_rad: f32) -> usize {
        if travel_rad > self.end_rad {
            return self.travel_rad.len();
        }
        // A column that has travelled as far as asked lies in the same step or a later one: the step is monotone in the
        // travel, and computed from the same operations in `tabulate`.
        let step = ((travel_rad - self.start_rad) * self.steps_per_rad) as usize;
        usize::from(self.first[step.min(STEPS - 1)])
    }
}

/// The sense of most steps from one received column to the next.
pub(crate) fn sense(columns: &[Column]) -> f32 {
    let mut received = columns.iter().filter(|column| column.valid != 0);
    let Some(mut before) = received.next() else { return 1.0 };
    let mut balance = 0_i32;
    for column in received {
        let step = column.azimuth_rad - before.azimuth_rad;
        let rises = (step > 0.0) == (step.abs() < PI);
        balance += if step == 0.0 { 0 } else { 2 * i32::from(rises) - 1 };
        before = column;
    }
    if balance < 0 { -1.0 } else { 1.0 }
}

/// The way from one azimuth on to the next [rad], from an eighth of a turn back to seven eighths on.
fn step_on(before: f32, azimuth: f32) -> f64 {
    const BACK: f64 = std::f64::consts::FRAC_PI_4;
    (f64::from(azimuth) - f64::from(before) + BACK).rem_euclid(std::f64::consts::TAU) - BACK
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(azimuths: &[Option<f32>]) -> Vec<Column> {
        azimuths
            .iter()
            .map(|azimuth| Column {
                azimuth_rad: azimuth.unwrap_or(f32::NAN),
                offset_ns: 0,
                valid: azimuth.is_some() as u32,
            })
            .collect()
    }

    #[test]
    fn travel_rises_through_the_seam_in_either_sense() {
        let rising = columns(&[Some(3.0), Some(3.1), Some(-3.1), None, Some(-2.9)]);
        let falling: Vec<Column> = rising.iter().map(|c| Column { azimuth_rad: -c.azimuth_rad, ..*c }).collect();
        for (columns, sense) in [(rising, 1.0), (falling, -1.0)] {
            let mut sut = Turn::new();
            assert!(sut.measure(&columns));
            assert_eq!(sut.sense(), sense);
            let travel: Vec<f32> = (0..5).map(|column| sut.travel_rad(column)).collect();
            assert!(travel.windows(2).all(|pair| pair[0] <= pair[1]), "{travel:?}");
            assert!((travel[4] - travel[0] - (TAU - 5.9)).abs() < 1e-5);
        }
    }

    #[test]
    fn no_column_before_the_first_one_has_travelled_as_far_as_asked() {
        let azimuths: Vec<Option<f32>> = (0..500)
            .map(|c| (c % 7 != 3).then(|| (c as f32 * TAU / 500.0 + 0.01 * ((c * 37) % 11) as f32 + PI) % TAU - PI))
            .collect();
        let columns = columns(&azimuths);
        let mut sut = Turn::new();
        assert!(sut.measure(&columns));
        for ask in -10..700 {
            let ask = sut.travel_rad(0) + ask as f32 * 0.01;
            let first = sut.first_from(ask);
            let expected = (0..500).find(|&c| columns[c].valid != 0 && sut.travel_rad(c) >= ask).unwrap_or(500);
            assert!(first <= expected, "{first} is after {expected}");
            assert!(expected - first <= 12, "{first} is far before {expected}");
        }
    }

    #[test]
    fn a_gap_of_more_than_half_a_turn_is_travelled_forwards() {
        let mut sut = Turn::new();
        assert!(sut.measure(&columns(&[Some(0.0), Some(0.1), Some(0.2), Some(-2.0)])));
        assert!((sut.travel_rad(3) - (TAU - 2.0)).abs() < 1e-5);
    }

    #[test]
    fn columns_that_go_round_twice_are_not_a_turn() {
        let twice: Vec<Option<f32>> = (0..100).map(|c| Some((c as f32 * 0.13 + PI) % TAU - PI)).collect();
        assert!(!Turn::new().measure(&columns(&twice)));
    }

    #[test]
    fn azimuths_of_many_turns_are_not_a_turn() {
        assert!(Turn::new().measure(&columns(&[Some(-TAU), Some(0.1 - TAU)])));
        assert!(!Turn::new().measure(&columns(&[Some(1e6), Some(1e6 + 0.0625)])));
    }

    #[test]
    fn no_column_or_one_is_a_turn() {
        let mut sut = Turn::new();
        assert!(sut.measure(&[]));
        assert_eq!(sut.first_from(-1.0), 0);
        assert!(sut.measure(&columns(&[Some(1.0)])));
        assert_eq!(sut.first_from(1.0), 0);
        assert_eq!(sut.first_from(1.1), 1);
        assert!(sut.measure(&columns(&[None, None])));
    }
}
