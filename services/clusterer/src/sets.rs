/// Disjoint sets of returns; the root of a set is its smallest member.
pub(crate) struct Sets {
    parent: Vec<u32>,
    count: usize,
}

impl Sets {
    /// Room for `most` returns.
    pub(crate) fn with_capacity(most: usize) -> Self {
        Self { parent: Vec::with_capacity(most), count: 0 }
    }

    /// Makes every one of `count` returns a set of its own.
    pub(crate) fn reset(&mut self, count: usize) {
        self.parent.clear();
        self.parent.extend(0..count as u32);
        self.count = count;
    }

    /// Number of sets.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The smallest member of `member`'s set; shortens the way there.
    #[inline]
    pub(crate) fn root(&mut self, mut member: u32) -> u32 {
        loop {
            let above = self.parent[member as usize];
            if above == member {
                return member;
            }
            let next = self.parent[above as usize];
            self.parent[member as usize] = next;
            member = next;
        }
    }

    /// Joins the sets of two returns and gives the root of the union.
    #[inline]
    pub(crate) fn join(&mut self, a: u32, b: u32) -> u32 {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high as usize] = low;
        self.count -= usize::from(low != high);
        low
    }

    /// The root of each return, in order.
    pub(crate) fn roots(&mut self) -> &[u32] {
        // A parent is never larger than its child, so it is flat already when the child's turn comes.
        for member in 0..self.parent.len() {
            self.parent[member] = self.parent[self.parent[member] as usize];
        }
        &self.parent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_the_smallest_member_whatever_the_order_of_joins() {
        let mut sut = Sets::with_capacity(6);
        sut.reset(6);
        for (a, b) in [(5, 4), (3, 5), (2, 1), (1, 4)] {
            sut.join(a, b);
        }
        assert_eq!(sut.roots(), &[0, 1, 1, 1, 1, 1]);
        sut.reset(2);
        assert_eq!(sut.roots(), &[0, 1]);
    }

    #[test]
    fn no_returns_are_no_sets() {
        let mut sut = Sets::with_capacity(0);
        sut.reset(0);
        assert!(sut.roots().is_empty());
    }
}
