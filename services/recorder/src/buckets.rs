//! A row of buckets of time that never grows: when it is full, neighbours become one, and a bucket is twice as long.

/// What a bucket holds, and how two become one.
pub trait Merge: Default {
    /// Adds what a later bucket holds.
    fn merge(&mut self, later: &Self);
}

/// Buckets of equal length from the first that something came into to the last one.
///
/// A bucket begins at a multiple of its length, which is the first length times a power of two. So rows that began at
/// different times fit upon each other, and what a row holds does not depend on the order in which it came.
#[derive(Clone, Debug)]
pub struct Buckets<T> {
    width_ns: u64,
    /// Number of the first bucket: its begin over the length.
    first: u64,
    used: usize,
    /// Empty from `used` on.
    slots: Box<[T]>,
}

impl<T: Merge> Buckets<T> {
    /// An empty row of at most `most` buckets (2 at least), each `width_ns` long at first. All memory is made here.
    pub fn new(width_ns: u64, most: usize) -> Self {
        let slots = std::iter::repeat_with(T::default).take(most.max(2)).collect();
        Self { width_ns: width_ns.max(1), first: 0, used: 0, slots }
    }

    /// Length of a bucket [ns].
    pub fn width_ns(&self) -> u64 {
        self.width_ns
    }

    /// The bucket of a moment [ns], made room for where there is none.
    pub fn at(&mut self, at_ns: u64) -> &mut T {
        let mut number = at_ns / self.width_ns;
        if self.used == 0 {
            (self.first, self.used) = (number, 1);
        }
        while self.last().max(number) - self.first.min(number) >= self.slots.len() as u64 {
            self.coarsen();
            number = at_ns / self.width_ns;
        }
        if number < self.first {
            let before = (self.first - number) as usize;
            self.used += before;
            self.slots[..self.used].rotate_right(before);
            self.first = number;
        }
        let place = (number - self.first) as usize;
        self.used = self.used.max(place + 1);
        &mut self.slots[place]
    }

    /// Makes buckets at least so long [ns].
    pub fn coarsen_to(&mut self, width_ns: u64) {
        while self.width_ns < width_ns {
            self.coarsen();
        }
    }

    /// The buckets in order, empty ones between included: begin [ns] and content.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &T)> {
        (self.first..).map(|number| number.saturating_mul(self.width_ns)).zip(&self.slots[..self.used])
    }

    /// Number of the last bucket.
    fn last(&self) -> u64 {
        self.first + self.used.saturating_sub(1) as u64
    }

    fn coarsen(&mut self) {
        let first = self.first / 2;
        let mut used = 0;
        for place in 0..self.used {
            let target = ((self.first + place as u64) / 2 - first) as usize;
            used = target + 1;
            if target < place {
                let later = std::mem::take(&mut self.slots[place]);
                self.slots[target].merge(&later);
            }
        }
        (self.first, self.used, self.width_ns) = (first, used, self.width_ns.saturating_mul(2));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// How many came, and the latest of them.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    struct Count(u64, u64);

    impl Merge for Count {
        fn merge(&mut self, later: &Self) {
            *self = Self(self.0 + later.0, self.1.max(later.1));
        }
    }

    fn row(most: usize, moments: &[u64]) -> Buckets<Count> {
        let mut row = Buckets::<Count>::new(4, most);
        for &at_ns in moments {
            row.at(at_ns).merge(&Count(1, at_ns));
        }
        row
    }

    #[test]
    fn a_full_row_has_half_as_many_buckets_of_twice_the_length() {
        let mut sut = row(4, &[4, 9, 12, 19]);
        assert_eq!(sut.iter().map(|(at, count)| (at, count.0)).collect::<Vec<_>>(), [(4, 1), (8, 1), (12, 1), (16, 1)]);
        sut.at(20).0 += 1;
        assert_eq!(sut.width_ns(), 8);
        assert_eq!(sut.iter().map(|(at, count)| (at, count.0)).collect::<Vec<_>>(), [(0, 1), (8, 2), (16, 2)]);
    }

    #[test]
    fn the_last_moment_of_all_has_a_bucket_and_the_first_as_well() {
        let sut = row(2, &[u64::MAX, 0]);
        assert_eq!(sut.iter().map(|(_, count)| count.0).sum::<u64>(), 2);
    }

    proptest! {
        #[test]
        fn counts_add_up_and_maxima_are_kept_for_any_number_of_buckets(
            most in 2_usize..40, moments in prop::collection::vec(0_u64..5_000, 1..80),
        ) {
            let sut = row(most, &moments);
            let found: Vec<_> = sut.iter().collect();
            prop_assert!(found.len() <= most);
            prop_assert_eq!(found.iter().map(|(_, count)| count.0).sum::<u64>(), moments.len() as u64);
            for (begin_ns, count) in found {
                let within = moments.iter().filter(|&&at| at >= begin_ns && at < begin_ns + sut.width_ns());
                prop_assert_eq!(count.1, within.clone().copied().max().unwrap_or(0));
                prop_assert_eq!(count.0, within.count() as u64);
            }
        }

        #[test]
        fn the_order_in_which_things_came_does_not_show(
            most in 2_usize..20, moments in prop::collection::vec(0_u64..5_000, 1..40),
        ) {
            let content = |row: &Buckets<Count>| row.iter().map(|(at, &count)| (at, count)).collect::<Vec<_>>();
            let reversed: Vec<u64> = moments.iter().rev().copied().collect();
            prop_assert_eq!(content(&row(most, &moments)), content(&row(most, &reversed)));
        }
    }
}
