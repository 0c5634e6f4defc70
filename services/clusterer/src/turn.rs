use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use lidar::{Column, MAX_COLUMNS};

/// Columns of a sweep by how far the head had turned since the first.
///
/// The travel of a column is counted in the sense in which the head turns and on through ±π, so that it rises with the
/// column. That of a column that was not received is its predecessor's.
pub(crate) struct Turn {
    /// Azimuth and travel of the last received column.
    last: Option<(f32, f64)>,
    /// +1 or −1; 0 until the head has turned.
    sense: f64,
    travel_rad: Vec<f32>,
}

impl Turn {
    pub(crate) fn new() -> Self {
        Self { last: None, sense: 0.0, travel_rad: Vec::with_capacity(MAX_COLUMNS) }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self) {
        self.last = None;
        self.sense = 0.0;
        self.travel_rad.clear();
    }

    /// Takes in further columns of a sweep that promises to go round once. False where they break the promise: an azimuth
    /// beyond a turn, a step back or of a right angle, a turn or more in all.
    pub(crate) fn go_on(&mut self, columns: &[Column]) -> bool {
        for column in columns {
            if column.valid != 0 {
                let travel = match self.last {
                    None => 0.0,
                    Some((before, travel)) => {
                        let step = step_rad(before, column.azimuth_rad);
                        if step != 0.0 && self.sense == 0.0 {
                            self.sense = step.signum();
                        }
                        if step * self.sense < 0.0 || step.abs() >= FRAC_PI_2 {
                            return false;
                        }
                        travel + step.abs()
                    }
                };
                if f64::from(column.azimuth_rad.abs()) > TAU || travel >= TAU {
                    return false;
                }
                self.last = Some((column.azimuth_rad, travel));
            }
            self.travel_rad.push(self.last.map_or(0.0, |(_, travel)| travel as f32));
        }
        true
    }

    /// Measures the columns of a whole sweep that promises nothing. Says whether two columns whose azimuths differ by less
    /// than 3 rad (mod 2π) differ in travel by that much, or by that much and one turn: they cover less than a turn and a
    /// half and never go back by more than a right angle, and no azimuth is so far out that it is no longer known to the
    /// margins of the window.
    pub(crate) fn measure(&mut self, columns: &[Column]) -> bool {
        self.reset();
        self.sense = f64::from(sense(columns));
        let (mut start, mut end, mut back) = (0.0_f64, 0.0_f64, 0.0_f64);
        for column in columns {
            if column.valid != 0 {
                let travel = match self.last {
                    None => 0.0,
                    // From an eighth of a turn back to seven eighths on.
                    Some((before, travel)) => {
                        let step = self.sense * (f64::from(column.azimuth_rad) - f64::from(before));
                        travel + (step + FRAC_PI_4).rem_euclid(TAU) - FRAC_PI_4
                    }
                };
                if f64::from(column.azimuth_rad.abs()) > TAU {
                    return false;
                }
                self.last = Some((column.azimuth_rad, travel));
                (start, end) = (start.min(travel), end.max(travel));
                back = back.max(end - travel);
            }
            self.travel_rad.push(self.last.map_or(0.0, |(_, travel)| travel as f32));
        }
        end - start < 1.5 * TAU && back < FRAC_PI_2
    }

    /// +1 where azimuth rises with the column, −1 where it falls.
    pub(crate) fn sense(&self) -> f32 {
        if self.sense < 0.0 { -1.0 } else { 1.0 }
    }

    /// Travels of the columns taken in so far [rad].
    pub(crate) fn travels_rad(&self) -> &[f32] {
        &self.travel_rad
    }
}

/// The sense of most steps from one received column to the next: +1 where azimuth rises with the column, −1 where it falls.
pub(crate) fn sense(columns: &[Column]) -> f32 {
    let mut received = columns.iter().filter(|column| column.valid != 0);
    let Some(mut before) = received.next() else { return 1.0 };
    let mut balance = 0_i32;
    for column in received {
        let step = step_rad(before.azimuth_rad, column.azimuth_rad);
        balance += i32::from(step > 0.0) - i32::from(step < 0.0);
        before = column;
    }
    if balance < 0 { -1.0 } else { 1.0 }
}

/// The shorter way from one azimuth to the next [rad].
fn step_rad(before: f32, azimuth: f32) -> f64 {
    let on = f64::from(azimuth) - f64::from(before) + PI;
    // The remainder is slow, and seldom needed.
    if (0.0..TAU).contains(&on) { on - PI } else { on.rem_euclid(TAU) - PI }
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

    fn falling(columns: &[Column]) -> Vec<Column> {
        columns.iter().map(|column| Column { azimuth_rad: -column.azimuth_rad, ..*column }).collect()
    }

    #[test]
    fn travel_rises_through_the_seam_in_either_sense_whether_it_comes_at_once_or_by_columns() {
        let rising = columns(&[Some(3.0), Some(3.1), Some(-3.1), None, Some(-2.9)]);
        for (columns, sense_is) in [(rising.clone(), 1.0), (falling(&rising), -1.0)] {
            let (mut at_once, mut by_columns) = (Turn::new(), Turn::new());
            assert!(at_once.measure(&columns));
            assert!(columns.chunks(1).all(|column| by_columns.go_on(column)));
            assert_eq!(sense(&columns), sense_is);
            assert_eq!(at_once.travels_rad(), by_columns.travels_rad());
            assert!(at_once.travels_rad().is_sorted());
            assert!((f64::from(at_once.travel_rad[4]) - (TAU - 5.9)).abs() < 1e-5);
        }
    }

    #[test]
    fn a_gap_of_more_than_half_a_turn_is_travelled_forwards() {
        let mut sut = Turn::new();
        assert!(sut.measure(&columns(&[Some(0.0), Some(0.1), Some(0.2), Some(-2.0)])));
        assert!((f64::from(sut.travel_rad[3]) - (TAU - 2.0)).abs() < 1e-5);
    }

    #[test]
    fn columns_that_go_round_twice_are_not_a_turn() {
        let twice: Vec<Option<f32>> = (0..100).map(|c| Some(((f64::from(c) * 0.13 + PI) % TAU - PI) as f32)).collect();
        assert!(!Turn::new().measure(&columns(&twice)));
    }

    #[test]
    fn azimuths_of_many_turns_are_not_a_turn() {
        assert!(Turn::new().measure(&columns(&[Some(-6.2), Some(0.1 - 6.2)])));
        assert!(!Turn::new().measure(&columns(&[Some(1e6), Some(1e6 + 0.0625)])));
    }

    #[test]
    fn a_promise_to_go_round_once_is_broken_by_a_step_back_a_leap_a_whole_turn_and_azimuths_beyond_one() {
        let broken: [&[f32]; 5] =
            [&[0.1, 0.2, 0.1], &[0.2, 0.1, 0.2], &[0.1, 1.7], &[1e6, 1e6], &[0.0, 1.5, 3.0, -1.8, -0.4, 0.1]];
        for azimuths in broken {
            let azimuths: Vec<Option<f32>> = azimuths.iter().map(|&azimuth| Some(azimuth)).collect();
            assert!(!Turn::new().go_on(&columns(&azimuths)), "{azimuths:?}");
            assert!(Turn::new().go_on(&columns(&azimuths[..azimuths.len() - 1])) || azimuths[0] == Some(1e6));
        }
    }

    #[test]
    fn no_column_or_one_is_a_turn() {
        for columns in [columns(&[]), columns(&[Some(1.0)]), columns(&[None, None])] {
            assert!(Turn::new().measure(&columns));
            assert!(Turn::new().go_on(&columns));
        }
    }
}
