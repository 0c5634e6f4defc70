use messages::Part;

/// Which parts may follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sequence {
    /// Sweep, sectors and next sector of the sweep that has begun and not ended.
    open: Option<(u64, u32, u32)>,
}

impl Sequence {
    /// Whether a part follows the ones before: the first sector of a sweep always does, another one if it is the next of
    /// the sweep that has begun. If not, that sweep is given up.
    pub(crate) fn follows(&mut self, part: &Part) -> bool {
        let follows = part.sector == 0 || self.open == Some((part.sweep, part.sectors, part.sector));
        let goes_on = follows && !part.is_last();
        self.open = goes_on.then(|| (part.sweep, part.sectors, part.sector + 1));
        follows
    }

    /// Gives up the sweep that has begun: none of its sectors follows any more.
    pub(crate) fn give_up(&mut self) {
        self.open = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn follows(sut: &mut Sequence, sweep: u64, sector: u32, sectors: u32) -> bool {
        sut.follows(&Part { sweep, sector, sectors, ..Part::default() })
    }

    #[test]
    fn sectors_follow_in_order_and_after_a_gap_nothing_does_until_a_sweep_begins() {
        let mut sut = Sequence::default();
        assert!(!follows(&mut sut, 0, 1, 3)); // none has begun
        assert!((0..3).all(|sector| follows(&mut sut, 1, sector, 3)));
        assert!(!follows(&mut sut, 1, 3, 4)); // the sweep has ended
        assert!(follows(&mut sut, 2, 0, 3));
        assert!(!follows(&mut sut, 2, 2, 3)); // one is missing
        assert!(!follows(&mut sut, 2, 1, 3)); // and the sweep given up
        assert!(follows(&mut sut, 3, 0, 3));
        assert!(!follows(&mut sut, 4, 1, 3)); // of another sweep
        assert!(follows(&mut sut, 5, 0, 3));
        assert!(!follows(&mut sut, 5, 1, 4)); // cut otherwise
        assert!(follows(&mut sut, 6, 0, 3) && follows(&mut sut, 7, 0, 3) && follows(&mut sut, 7, 1, 3));
        sut.give_up();
        assert!(!follows(&mut sut, 7, 2, 3));
    }
}
