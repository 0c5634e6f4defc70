//! Which sweeps of a stream of parts came, were given up, or came twice.

/// Counts the sweeps of a stream whose numbers rise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    first: u64,
    /// All sweeps below have come or are given up.
    next: u64,
    /// Whether sweep `next` has begun.
    open: bool,
    /// Nothing of any sweep from here on has come.
    seen: u64,
    whole: u64,
    doubles: u64,
}

impl Stream {
    /// Expects sweeps from `first` on.
    pub(crate) fn new(first: u64) -> Self {
        Self { first, next: first, open: false, seen: first, whole: 0, doubles: 0 }
    }

    /// Takes note of a part; false where nothing can be made of it: its sweep is settled, or did not begin here. With
    /// its first sector a sweep begins, and those before it are given up; a part in the middle gives up none, since
    /// the beginning may be sent again.
    pub(crate) fn takes(&mut self, sweep: u64, sector: u32) -> bool {
        if sweep < self.next {
            self.doubles += 1;
            return false;
        }
        self.seen = self.seen.max(sweep.saturating_add(1));
        if sector > 0 {
            return self.open && sweep == self.next;
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
        self.seen
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
        assert!(sut.takes(4, 0) && sut.takes(4, 1));
        assert_eq!((sut.lost(), sut.next(), sut.seen()), (1, 4, 5));
        sut.end(4);
        assert!(sut.takes(5, 0) && sut.takes(7, 0));
        assert_eq!((sut.lost(), sut.next()), (3, 7));
        sut.give_up_below(sut.seen());
        assert_eq!((sut.lost(), sut.next()), (4, 8));
    }

    #[test]
    fn what_is_settled_is_a_double_and_changes_nothing() {
        let mut sut = Stream::new(0);
        assert!(sut.takes(0, 0));
        sut.end(0);
        assert!(!sut.takes(0, 0));
        assert_eq!((sut.lost(), sut.next(), sut.doubles()), (0, 1, 1));
    }

    #[test]
    fn the_rest_of_a_sweep_that_began_elsewhere_gives_up_nothing_until_a_later_one_begins() {
        let mut sut = Stream::new(5);
        assert!(!sut.takes(7, 20) && !sut.takes(7, 21));
        assert!(sut.takes(5, 0), "sent again from an earlier sweep on");
        sut.end(5);
        assert!(!sut.takes(8, 1));
        assert_eq!((sut.lost(), sut.next(), sut.seen(), sut.doubles()), (0, 6, 9, 0));
        assert!(sut.takes(9, 0));
        assert_eq!(sut.lost(), 3);
    }
}
