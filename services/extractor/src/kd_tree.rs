use crate::neighbours::MAX_OTHERS;

/// Points of a leaf: below this a scan is faster than a descent.
const LEAF: usize = 8;

/// A k-d tree, rebuilt in place for each cluster: neighbours whatever the order of the points, in O(n log n).
#[derive(Debug)]
pub(crate) struct KdTree {
    /// Index of the point at each place of the tree.
    index_at: Vec<u32>,
    /// The points by place, so that a leaf is read in one go.
    point_at: Vec<[f32; 3]>,
    /// Split of the node whose middle place this is.
    split_at: Vec<Split>,
}

impl KdTree {
    /// Room for clusters of up to `capacity` points.
    pub(crate) fn new(capacity: usize) -> Self {
        Self {
            index_at: vec![0; capacity],
            point_at: vec![[0.0; 3]; capacity],
            split_at: vec![Split::default(); capacity],
        }
    }

    /// Finds the `wanted` nearest of every point [m] and gives them to `found`, with its index.
    pub(crate) fn find(&mut self, points: &[[f32; 3]], wanted: usize, mut found: impl FnMut(usize, &[(f32, u32)])) {
        let count = points.len();
        for (place, index) in self.index_at[..count].iter_mut().enumerate() {
            *index = place as u32;
        }
        build(&mut self.index_at[..count], &mut self.split_at[..count], points);
        for (at, &index) in self.point_at.iter_mut().zip(&self.index_at[..count]) {
            *at = points[index as usize];
        }
        let tree = Tree {
            index_at: &self.index_at[..count],
            point_at: &self.point_at[..count],
            split_at: &self.split_at[..count],
        };
        // In order of places: one search's leaves are warm for the next.
        for place in 0..count {
            let index = tree.index_at[place];
            let mut best = Best::new(wanted);
            tree.search(tree.point_at[place], index, 0..count, [0.0; 3], &mut best);
            found(index as usize, best.found());
        }
    }
}

/// Where a node parts its points: the lower half lies at or below the value, the upper half at or above it.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    value: f32,
    axis: u8,
}

/// Puts the lower half by the widest axis before the upper one, and so on down to the leaves.
fn build(index_at: &mut [u32], split_at: &mut [Split], points: &[[f32; 3]]) {
    let count = index_at.len();
    if count <= LEAF {
        return;
    }
    let axis = widest_axis(index_at, points);
    let middle = count / 2;
    let (_, &mut median, _) = index_at.select_nth_unstable_by(middle, |&a, &b| {
        points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
    });
    split_at[middle] = Split { value: points[median as usize][axis], axis: axis as u8 };
    let (lower, upper) = index_at.split_at_mut(middle);
    let (lower_splits, upper_splits) = split_at.split_at_mut(middle);
    build(lower, lower_splits, points);
    // Leaves this node's split in place: it is the upper half's first, and a node's own lies at its middle.
    build(upper, upper_splits, points);
}

fn widest_axis(index_at: &[u32], points: &[[f32; 3]]) -> usize {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for &index in index_at {
        let point = points[index as usize];
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let mut widest = 0;
    for axis in 1..3 {
        if high[axis] - low[axis] > high[widest] - low[widest] {
            widest = axis;
        }
    }
    widest
}

struct Tree<'a> {
    index_at: &'a [u32],
    point_at: &'a [[f32; 3]],
    split_at: &'a [Split],
}

impl Tree<'_> {
    /// `gap_m` is the vector from the point to the node's box, 0 along the axes where it lies inside.
    fn search(&self, point: [f32; 3], index: u32, places: std::ops::Range<usize>, gap_m: [f32; 3], best: &mut Best) {
        if places.len() <= LEAF {
            for place in places {
                let other = self.index_at[place];
                if other != index {
                    best.offer(squared_distance(point, self.point_at[place]), other);
                }
            }
            return;
        }
        let middle = places.start + places.len() / 2;
        let split = self.split_at[middle];
        let axis = usize::from(split.axis);
        let to_split = split.value - point[axis];
        let (lower, upper) = (places.start..middle, middle..places.end);
        let (near, far) = if to_split > 0.0 { (lower, upper) } else { (upper, lower) };
        self.search(point, index, near, gap_m, best);
        let mut far_gap_m = gap_m;
        far_gap_m[axis] = to_split;
        // Rounding is monotone and both sums go in the same order, so no nearer point can hide behind this bound;
        // equality must descend, for a smaller index may lie there.
        if norm2(far_gap_m) <= best.worst_m2() {
            self.search(point, index, far, far_gap_m, best);
        }
    }
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    norm2([a[0] - b[0], a[1] - b[1], a[2] - b[2]])
}

fn norm2(v: [f32; 3]) -> f32 {
    (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2]
}

/// The nearest candidates so far, nearest first.
struct Best {
    wanted: usize,
    entries: [(f32, u32); MAX_OTHERS],
}

impl Best {
    fn new(wanted: usize) -> Self {
        Self { wanted, entries: [(f32::INFINITY, u32::MAX); MAX_OTHERS] }
    }

    fn worst_m2(&self) -> f32 {
        self.entries[self.wanted - 1].0
    }

    fn offer(&mut self, distance2: f32, index: u32) {
        let before = |entry: (f32, u32)| distance2 < entry.0 || (distance2 == entry.0 && index < entry.1);
        let mut rank = self.wanted - 1;
        if !before(self.entries[rank]) {
            return;
        }
        while rank > 0 && before(self.entries[rank - 1]) {
            self.entries[rank] = self.entries[rank - 1];
            rank -= 1;
        }
        self.entries[rank] = (distance2, index);
    }

    fn found(&self) -> &[(f32, u32)] {
        &self.entries[..self.wanted]
    }
}
