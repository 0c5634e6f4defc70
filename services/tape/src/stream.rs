//! Which sweeps of a stream of parts came, were given up, or came twice.

/// Counts the sweeps of a stream whose numbers rise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    first: u64,
    /// All sweeps below have come or are given up.
    next: u64,
    /// One that has begun and not ended.
    open: bool,
    whole: u64,
    doubles: u64,
}

impl Stream {
    /// Expects sweeps from `first` on.
    pub(crate) fn new(first: u64) -> Self {
        Self { first, next: first, open: false, whole: 0, doubles: 0 }
    }

    /// Takes note of a part; false where its sweep is settled already. Those before it are given up.
    pub(crate) fn takes(&mut self, sweep: u64) -> bool {
        if sweep < self.next {
            self.doubles += 1;
            return false;
        }
        (self.next, self.open) = (sweep, true);
        true
    }

    /// The sweep has come as a whole.
    pub(crate) fn end(&mut self, sweep: u64) {
        (self.next, self.open) = (sweep.saturating_add(1), false);
        self.whole += 1;
    }

    /// All sweeps below this number have come or are given up.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// Number of the first sweep of which nothing came.
    pub(crate) fn seen(&self) -> u64 {
        self.next.saturating_add(self.open.into())
    }

    /// Gives up all sweeps below a number.
    pub(crate) fn give_up_below(&mut self, sweep: u64) {
        if sweep > self.next {
            (self.next, self.open) = (sweep, false);
        }
    }

    /// Sweeps that were given up.
    pub(crate) fn lost(&self) -> u64 {
        (self.next - self.first).saturating_sub(self.whole)
    }

    /// Parts of sweeps that were settled already.
    pub(crate) fn doubles(&self) -> u64 {
        self.doubles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_that_never_ended_are_lost_once_a_later_one_begins() {
        let mut sut = Stream::new(3);
        assert!(sut.takes(4) && sut.takes(4));
        assert_eq!((sut.lost(), sut.next(), sut.seen()), (1, 4, 5));
        sut.end(4);
        assert!(sut.takes(5) && sut.takes(7));
        assert_eq!((sut.lost(), sut.next()), (3, 7));
        sut.give_up_below(sut.seen());
        assert_eq!((sut.lost(), sut.next()), (4, 8));
    }

    #[test]
    fn what_is_settled_is_a_double_and_changes_nothing() {
        let mut sut = Stream::new(0);
        assert!(sut.takes(0));
        sut.end(0);
        assert!(!sut.takes(0));
        assert_eq!((sut.lost(), sut.next(), sut.doubles()), (0, 1, 1));
    }
}
