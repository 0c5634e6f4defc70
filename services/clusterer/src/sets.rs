/// What is known of a set as a whole: enough to say that nothing still to come can join it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Number of returns.
    pub(crate) points: u32,
    /// Column that must have been passed before the set can close.
    pub(crate) column: u32,
    /// Travel that must have been passed before the set can close [rad].
    pub(crate) travel_rad: f32,
    /// Whether it can close only with the sweep.
    pub(crate) held: bool,
}

impl Extent {
    fn with(self, other: Self) -> Self {
        Self {
            points: self.points + other.points,
            column: self.column.max(other.column),
            travel_rad: self.travel_rad.max(other.travel_rad),
            held: self.held | other.held,
        }
    }
}

/// Disjoint sets of runs; the root of a set is its first run.
pub(crate) struct Sets {
    parent: Vec<u32>,
    /// Another run of the same set: the runs of a set are a ring.
    next: Vec<u32>,
    /// Of a root: its set's. Of another run nothing.
    extent: Vec<Extent>,
}

impl Sets {
    /// Room for `most` runs.
    pub(crate) fn with_capacity(most: usize) -> Self {
        Self { parent: Vec::with_capacity(most), next: Vec::with_capacity(most), extent: Vec::with_capacity(most) }
    }

    /// Forgets all sets.
    pub(crate) fn reset(&mut self) {
        self.parent.clear();
        self.next.clear();
        self.extent.clear();
    }

    /// Adds a run as a set of its own.
    pub(crate) fn push(&mut self, extent: Extent) {
        let run = self.parent.len() as u32;
        self.parent.push(run);
        self.next.push(run);
        self.extent.push(extent);
    }

    /// Number of runs.
    pub(crate) fn runs(&self) -> usize {
        self.parent.len()
    }

    /// The first run of `run`'s set; shortens the way there.
    #[inline]
    pub(crate) fn root(&mut self, mut run: u32) -> u32 {
        loop {
            let above = self.parent[run as usize];
            if above == run {
                return run;
            }
            let next = self.parent[above as usize];
            self.parent[run as usize] = next;
            run = next;
        }
    }

    /// Whether a run is its set's first.
    #[inline]
    pub(crate) fn is_root(&self, run: u32) -> bool {
        self.parent[run as usize] == run
    }

    /// What is known of the set of a root.
    #[inline]
    pub(crate) fn extent(&self, root: u32) -> Extent {
        self.extent[root as usize]
    }

    /// Joins the sets of two roots and gives the root of the union.
    #[inline]
    pub(crate) fn join(&mut self, a: u32, b: u32) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        if low != high {
            self.parent[high as usize] = low;
            self.next.swap(low as usize, high as usize);
            self.extent[low as usize] = self.extent[low as usize].with(self.extent[high as usize]);
        }
        low
    }

    /// The runs of a set in no order, given one of them.
    pub(crate) fn members(&self, run: u32) -> impl Iterator<Item = u32> {
        let mut next = Some(run);
        std::iter::from_fn(move || {
            let this = next?;
            let after = self.next[this as usize];
            next = (after != run).then_some(after);
            Some(this)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sets(runs: u32) -> Sets {
        let mut sut = Sets::with_capacity(runs as usize);
        for run in 0..runs {
            let extent = Extent { points: 1, column: run, travel_rad: -(run as f32), held: run == 2 };
            sut.push(extent);
        }
        sut
    }

    #[test]
    fn the_root_is_the_first_run_whatever_the_order_of_joins() {
        let mut sut = sets(6);
        for (a, b) in [(5, 4), (3, 5), (2, 1), (1, 4), (1, 5)] {
            let (a, b) = (sut.root(a), sut.root(b));
            sut.join(a, b);
        }
        assert_eq!((0..6).map(|run| sut.root(run)).collect::<Vec<_>>(), [0, 1, 1, 1, 1, 1]);
        let mut members: Vec<u32> = sut.members(1).collect();
        members.sort();
        assert_eq!(members, [1, 2, 3, 4, 5]);
        assert_eq!(sut.members(0).collect::<Vec<_>>(), [0]);
        assert_eq!(sut.extent(1), Extent { points: 5, column: 5, travel_rad: -1.0, held: true });
        assert_eq!(sut.extent(0), Extent { points: 1, column: 0, travel_rad: 0.0, held: false });
        sut.reset();
        assert_eq!(sut.runs(), 0);
    }
}
