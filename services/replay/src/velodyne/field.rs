//! The part of the turn that a sensor is set to leave out.

use super::packet::TURN_CDEG;

const TURN: f64 = TURN_CDEG as f64;

/// The gap in a sensor's field of view, as blocks on both sides of it tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gap {
    /// Where the block after the last one before it would have been [0.01°].
    from_cdeg: f64,
    width_cdeg: f64,
    step_cdeg: f64,
    /// The edges move by up to a block from turn to turn; within this they are the same [0.01°].
    tolerance_cdeg: f64,
}

impl Gap {
    /// Between blocks at `last_cdeg` and `next_cdeg`, `step_cdeg` being the usual way from block to block.
    pub(super) fn between(last_cdeg: f64, next_cdeg: f64, step_cdeg: f64) -> Self {
        let from_cdeg = (last_cdeg + step_cdeg).rem_euclid(TURN);
        let width_cdeg = (next_cdeg - from_cdeg).rem_euclid(TURN);
        Self { from_cdeg, width_cdeg, step_cdeg, tolerance_cdeg: (3.0 * step_cdeg).min(width_cdeg / 3.0) }
    }

    /// Azimuth that it takes [0.01°].
    pub(super) fn width_cdeg(&self) -> f64 {
        self.width_cdeg
    }

    /// Whether it is the same gap, give or take its edges' usual play.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let apart = |a: f64, b: f64| ((a - b + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0).abs();
        apart(self.from_cdeg, other.from_cdeg) <= self.tolerance_cdeg
            && (self.width_cdeg - other.width_cdeg).abs() <= 2.0 * self.tolerance_cdeg
    }

    /// Whether an azimuth lies within it, and not just at an edge.
    pub(super) fn holds(&self, azimuth_cdeg: f64) -> bool {
        let inside = (azimuth_cdeg - self.from_cdeg).rem_euclid(TURN);
        (self.tolerance_cdeg..self.width_cdeg - self.tolerance_cdeg).contains(&inside)
    }

    /// Whether a block at an azimuth would not be sent.
    pub(super) fn covers(&self, azimuth_cdeg: f64) -> bool {
        (azimuth_cdeg - self.from_cdeg + self.step_cdeg / 2.0).rem_euclid(TURN) < self.width_cdeg
    }

    /// Whether a head that turned by `advance_cdeg` from `start_cdeg` on passed over all of it.
    pub(super) fn is_passed(&self, start_cdeg: f64, advance_cdeg: f64) -> bool {
        let ahead_cdeg = (self.from_cdeg - start_cdeg + self.tolerance_cdeg).rem_euclid(TURN) - self.tolerance_cdeg;
        ahead_cdeg + self.width_cdeg <= advance_cdeg + self.tolerance_cdeg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_knows_what_lies_in_it_and_who_passed_it_round_the_turn_too() {
        for from in [9_000.0, 35_000.0, 0.0] {
            let at = |cdeg: f64| (from + cdeg).rem_euclid(TURN);
            let sut = Gap::between(at(-20.0), at(18_000.0), 20.0);
            assert_eq!(sut.width_cdeg(), 18_000.0);
            assert!(sut.holds(at(9_000.0)) && sut.holds(at(61.0)) && !sut.holds(at(30.0)) && !sut.holds(at(18_010.0)));
            assert!(
                sut.covers(at(1.0)) && sut.covers(at(17_980.0)) && !sut.covers(at(-19.0)) && !sut.covers(at(18_000.0))
            );
            assert!(sut.is_passed(at(0.0), 18_000.0));
            assert!(sut.is_passed(at(20.0), 17_990.0), "edges have some play");
            assert!(sut.is_passed(at(-5_000.0), 23_000.0));
            assert!(!sut.is_passed(at(0.0), 17_000.0));
            assert!(!sut.is_passed(at(-5_000.0), 20_000.0));
            assert!(!sut.is_passed(at(18_000.0), 100.0));
            assert!(sut.is_same(&Gap::between(at(-35.0), at(18_011.0), 20.0)));
            assert!(!sut.is_same(&Gap::between(at(-200.0), at(18_000.0), 20.0)));
        }
    }
}
