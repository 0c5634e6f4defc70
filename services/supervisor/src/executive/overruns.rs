//! Slow: over the budget again and again.

/// Sweeps that count.
const SWEEPS: u64 = 10;

/// Which of the last ten sweeps were over the budget.
#[derive(Debug, Default)]
pub(crate) struct Overruns {
    sweeps: u64,
    overruns: u64,
    /// The latest sweep is the lowest bit.
    recent: u16,
    slow: bool,
}

impl Overruns {
    /// Begins with a new life of the stage, whose page counts on.
    pub(crate) fn begin(sweeps: u64, overruns: u64) -> Self {
        Self { sweeps, overruns, recent: 0, slow: false }
    }

    /// Looks when the stage has done `sweeps` in all, `overruns` of them over its budget. Gives how many of the last ten, as
    /// long as it is slow: from `most` of them on, until there is none.
    pub(crate) fn look(&mut self, sweeps: u64, overruns: u64, most: u32) -> Option<u32> {
        let passed = sweeps.saturating_sub(self.sweeps).min(SWEEPS);
        if passed > 0 {
            let over = overruns.saturating_sub(self.overruns).min(passed);
            (self.sweeps, self.overruns) = (sweeps, overruns);
            self.recent = ((self.recent << passed) | ((1 << over) - 1)) & ((1 << SWEEPS) - 1);
        }
        let of_ten = self.recent.count_ones();
        self.slow = of_ten >= most || (self.slow && of_ten > 0);
        self.slow.then_some(of_ten)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lets sweeps pass, over the budget or not; what is said after each.
    fn pass(sut: &mut Overruns, over: &[bool]) -> Vec<Option<u32>> {
        let look = |&over: &bool| sut.look(sut.sweeps + 1, sut.overruns + u64::from(over), 3);
        over.iter().map(look).collect()
    }

    #[test]
    fn three_of_the_last_ten_are_slow_until_ten_are_well() {
        let mut sut = Overruns::default();
        assert_eq!(pass(&mut sut, &[true, false, true, false, true]), [None, None, None, None, Some(3)]);
        assert_eq!(pass(&mut sut, &[false; 9]).last(), Some(&Some(1)), "one of ten is slow still");
        assert_eq!(pass(&mut sut, &[false]), [None]);
        assert_eq!(pass(&mut sut, &[true, true, false, false]), [None; 4], "two of ten are not slow again");
    }

    #[test]
    fn a_third_overrun_after_the_first_has_passed_is_not_slow() {
        let mut sut = Overruns::default();
        assert!(
            pass(&mut sut, &[true, false, false, false, true, false, false, false, false, false, true])
                .iter()
                .all(Option::is_none)
        );
    }

    #[test]
    fn sweeps_that_pass_between_two_looks_all_count() {
        let mut sut = Overruns::default();
        assert_eq!(sut.look(5, 4, 3), Some(4));
        assert_eq!(sut.look(5, 4, 3), Some(4), "nothing passed");
        assert_eq!(sut.look(100, 4, 3), None);
        assert_eq!(sut.look(101, 40, 3), None, "one sweep is over its budget once");
        assert_eq!(sut.look(90, 40, 3), None, "a source went back");
    }
}
