/// Which warnings are said aloud: a few at once, then fewer, and whatever is worse than all before.
///
/// Each warning costs one of a few credits; a part without trouble gives back a little, so that a stage that was well for
/// a while is heard again. The worst always gets through.
#[derive(Debug)]
pub(crate) struct Throttle {
    credit: u32,
    worst: u64,
    unsaid: u64,
}

/// Credit of one warning.
const WARNING: u32 = 100;
/// Warnings that are said at once.
const MOST: u32 = 5 * WARNING;

impl Throttle {
    pub(crate) fn new() -> Self {
        Self { credit: MOST, worst: 0, unsaid: 0 }
    }

    /// Nothing happened: credit heals by a hundredth of a warning.
    pub(crate) fn heal(&mut self) {
        self.credit = (self.credit + 1).min(MOST);
    }

    /// Something happened, as bad as `severity`. Gives the number of warnings left unsaid since the last one when this
    /// one is to be said.
    pub(crate) fn admit(&mut self, severity: u64) -> Option<u64> {
        let worse = severity > self.worst;
        self.worst = self.worst.max(severity);
        match self.credit.checked_sub(WARNING) {
            Some(rest) => self.credit = rest,
            None if worse => {}
            None => {
                self.unsaid += 1;
                return None;
            }
        }
        Some(std::mem::take(&mut self.unsaid))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_are_said_then_none_but_the_worst_and_the_count_of_the_unsaid_is_not_lost() {
        let mut sut = Throttle::new();
        let said: Vec<_> = (0..8).map(|_| sut.admit(10)).collect();
        assert_eq!(said, [Some(0), Some(0), Some(0), Some(0), Some(0), None, None, None]);
        assert_eq!(sut.admit(11), Some(3), "worse than all before");
        assert_eq!(sut.admit(11), None, "as bad as the worst");
    }

    #[test]
    fn it_heals_while_nothing_happens() {
        let mut sut = Throttle::new();
        while sut.admit(1).is_some() {}
        for _ in 0..99 {
            sut.heal();
        }
        assert_eq!(sut.admit(1), None);
        sut.heal();
        assert_eq!(sut.admit(1), Some(2));
    }
}
