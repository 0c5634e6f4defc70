//! A few sweeps that wait for their other half.

use std::collections::VecDeque;

/// Values by the number of their sweep, the oldest first. Keeps the memory of values that have left.
pub(crate) struct Hold<T> {
    held: VecDeque<(u64, T)>,
    spare: Vec<T>,
    most: usize,
}

impl<T: Default> Hold<T> {
    /// Holds at most `most`, at least 1.
    pub(crate) fn new(most: usize) -> Self {
        Self { held: VecDeque::with_capacity(most), spare: Vec::new(), most: most.max(1) }
    }

    /// A place for a sweep's value, as an earlier value has left it. The oldest goes where there are too many.
    pub(crate) fn put(&mut self, sweep: u64) -> &mut T {
        self.drop_below(sweep.saturating_sub(self.most as u64 - 1));
        let value = self.spare.pop().unwrap_or_default();
        self.held.push_back((sweep, value));
        let last = self.held.len() - 1;
        &mut self.held[last].1
    }

    /// The value of a sweep; those of earlier ones go, as nothing comes for them any more.
    pub(crate) fn get(&mut self, sweep: u64) -> Option<&T> {
        self.drop_below(sweep);
        self.held.front().filter(|(held, _)| *held == sweep).map(|(_, value)| value)
    }

    fn drop_below(&mut self, sweep: u64) {
        while self.held.front().is_some_and(|(held, _)| *held < sweep) {
            self.spare.extend(self.held.pop_front().map(|(_, value)| value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_waits_until_a_later_one_is_asked_for_or_too_many_wait() {
        let mut sut = Hold::new(2);
        for sweep in 0..4_u64 {
            *sut.put(sweep) = sweep;
        }
        assert_eq!((sut.held.len(), sut.spare.len()), (2, 0), "what left makes room for what comes");
        assert_eq!(sut.get(1), None);
        assert_eq!(sut.get(2), Some(&2));
        assert_eq!(sut.get(3), Some(&3));
        assert_eq!(sut.get(2), None);
        assert_eq!(sut.get(4), None);
        assert!(sut.held.is_empty() && sut.spare.len() == 2);
    }
}
