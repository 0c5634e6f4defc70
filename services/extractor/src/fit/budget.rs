/// Residual evaluations that one fit may still spend. Counted, never timed: the same cluster gets the same fit always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Purse {
    left: u64,
    spent: u64,
}

impl Purse {
    pub(crate) fn new(evaluations: u64) -> Self {
        Self { left: evaluations, spent: 0 }
    }

    /// Takes `evaluations` if they are there.
    pub(crate) fn pay(&mut self, evaluations: usize) -> bool {
        let evaluations = evaluations as u64;
        let enough = evaluations <= self.left;
        if enough {
            self.left -= evaluations;
            self.spent += evaluations;
        }
        enough
    }

    /// Takes `evaluations` whether they are there or not: for what cannot be left out.
    pub(crate) fn owe(&mut self, evaluations: usize) {
        self.left = self.left.saturating_sub(evaluations as u64);
        self.spent += evaluations as u64;
    }

    /// Sets `share` of what is left apart.
    pub(crate) fn split(&mut self, share: f64) -> Self {
        let apart = (self.left as f64 * share.clamp(0.0, 1.0)) as u64;
        self.left -= apart;
        Self::new(apart)
    }

    /// Puts back what another purse has left, and counts what it spent.
    pub(crate) fn join(&mut self, other: Self) {
        self.left += other.left;
        self.spent += other.spent;
    }

    pub(crate) fn left(&self) -> u64 {
        self.left
    }

    pub(crate) fn spent(&self) -> u64 {
        self.spent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_apart_and_not_spent_comes_back() {
        let mut sut = Purse::new(100);
        let mut apart = sut.split(0.4);
        assert_eq!((sut.left(), apart.left()), (60, 40));
        assert!(apart.pay(30));
        assert!(!apart.pay(11));
        sut.join(apart);
        assert_eq!((sut.left(), sut.spent()), (70, 30));
        sut.owe(80);
        assert_eq!((sut.left(), sut.spent()), (0, 110));
        assert!(!sut.pay(1));
    }
}
