//! Boxes of runs, eight at a time, and boxes of eight of those.

use lidar::MAX_RETURNS;

/// Boxes and returns looked at together: a multiple of every vector width in use.
pub(crate) const LANES: usize = 8;
/// Runs of a group.
const GROUP: usize = LANES * LANES;
/// More than one set, or none.
const MIXED: u32 = u32::MAX;

/// A box along the axes [m].
#[derive(Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) low_m: [f32; 3],
    pub(crate) high_m: [f32; 3],
}

/// Neighbouring boxes [m] and their sets: of runs, or of chunks of runs.
#[derive(Clone, Copy)]
struct Chunk {
    low_m: [[f32; LANES]; 3],
    high_m: [[f32; LANES]; 3],
    /// A run of the set that all of each is in, as last seen; [`MIXED`] where not all is known to be in one.
    ///
    /// It may be a root no longer, but whoever has it for a root is still in one set with all of them: sets only grow.
    set: [u32; LANES],
}

/// Nothing overlaps an empty box.
const EMPTY: Chunk =
    Chunk { low_m: [[f32::INFINITY; LANES]; 3], high_m: [[f32::NEG_INFINITY; LANES]; 3], set: [MIXED; LANES] };

#[inline]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

impl Bounds {
    pub(crate) fn of([x, y, z]: [f32; 3]) -> Self {
        Self { low_m: [x, y, z], high_m: [x, y, z] }
    }

    /// Widens it so that it holds a point.
    #[inline]
    pub(crate) fn include(&mut self, [x, y, z]: [f32; 3]) {
        let ([low_x, low_y, low_z], [high_x, high_y, high_z]) = (self.low_m, self.high_m);
        self.low_m = [min(low_x, x), min(low_y, y), min(low_z, z)];
        self.high_m = [max(high_x, x), max(high_y, y), max(high_z, z)];
    }

    /// Widened by `by_m` to all sides.
    fn wider(self, by_m: f32) -> Self {
        Self { low_m: self.low_m.map(|low_m| low_m - by_m), high_m: self.high_m.map(|high_m| high_m + by_m) }
    }
}

impl Chunk {
    fn include(&mut self, lane: usize, bounds: &Bounds) {
        for axis in 0..3 {
            let (low_m, high_m) = (&mut self.low_m[axis][lane], &mut self.high_m[axis][lane]);
            (*low_m, *high_m) = (min(*low_m, bounds.low_m[axis]), max(*high_m, bounds.high_m[axis]));
        }
    }

    fn bounds(&self, lane: usize) -> Bounds {
        Bounds { low_m: self.low_m.map(|low_m| low_m[lane]), high_m: self.high_m.map(|high_m| high_m[lane]) }
    }

    /// The lanes that `bounds` overlaps and that are not known to be of the set of `root`, a bit each. Sets before boxes:
    /// most chunks are done there.
    #[inline(always)]
    fn others(&self, bounds: &Bounds, root: u32) -> u32 {
        if self.set.iter().all(|&set| set == root) {
            return 0;
        }
        // Lane by lane and without branches, so that a line is an instruction or two on vectors.
        let mut apart_m = [f32::NEG_INFINITY; LANES];
        for axis in 0..3 {
            let (low_m, high_m) = (bounds.low_m[axis], bounds.high_m[axis]);
            for (apart_m, there_m) in apart_m.iter_mut().zip(&self.low_m[axis]) {
                *apart_m = max(*apart_m, there_m - high_m);
            }
            for (apart_m, there_m) in apart_m.iter_mut().zip(&self.high_m[axis]) {
                *apart_m = max(*apart_m, low_m - there_m);
            }
        }
        let lanes = apart_m.iter().zip(&self.set).enumerate();
        lanes.fold(0, |others, (lane, (&apart_m, &set))| others | u32::from((apart_m <= 0.0) & (set != root)) << lane)
    }
}

/// The boxes of all runs of a sweep.
pub(crate) struct Boxes {
    chunks: Vec<Chunk>,
    /// The boxes of the chunks.
    groups: Vec<Chunk>,
    runs: usize,
}

impl Boxes {
    pub(crate) fn new() -> Self {
        Self {
            chunks: Vec::with_capacity(MAX_RETURNS.div_ceil(LANES)),
            groups: Vec::with_capacity(MAX_RETURNS.div_ceil(GROUP)),
            runs: 0,
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self) {
        self.chunks.clear();
        self.groups.clear();
        self.runs = 0;
    }

    /// Adds the box of the next run, which is a set of its own.
    pub(crate) fn push(&mut self, bounds: &Bounds) {
        let (chunk, lane) = (self.runs / LANES, self.runs % LANES);
        if lane == 0 {
            self.chunks.push(EMPTY);
        }
        if self.runs.is_multiple_of(GROUP) {
            self.groups.push(EMPTY);
        }
        self.chunks[chunk].include(lane, bounds);
        self.chunks[chunk].set[lane] = self.runs as u32;
        self.groups[chunk / LANES].include(chunk % LANES, bounds);
        self.groups[chunk / LANES].set[chunk % LANES] = MIXED;
        self.runs += 1;
    }

    /// The box of all within `reach_m` of a run, and more.
    #[inline]
    pub(crate) fn around(&self, run: u32, reach_m: f32) -> Bounds {
        self.chunks[run as usize / LANES].bounds(run as usize % LANES).wider(reach_m)
    }

    /// Calls `with` for runs that `bounds` overlaps and that are not known to be of the set of `root`, newest first: those
    /// from `first` to before `end`, and some beside them. It gives the root that it has come to be, and the run's own.
    #[inline(always)]
    pub(crate) fn visit(
        &mut self,
        bounds: &Bounds,
        (first, end): (u32, u32),
        mut root: u32,
        mut with: impl FnMut(u32, u32, u32) -> (u32, u32),
    ) -> u32 {
        for group in (first as usize / GROUP..(end as usize).div_ceil(GROUP)).rev() {
            let mut chunks = self.groups[group].others(bounds, root);
            while chunks != 0 {
                let chunk = chunks.ilog2() as usize;
                chunks &= !(1 << chunk);
                let this = &mut self.chunks[group * LANES + chunk];
                let mut runs = this.others(bounds, root);
                while runs != 0 {
                    let lane = runs.ilog2() as usize;
                    runs &= !(1 << lane);
                    let run = (group * GROUP + chunk * LANES + lane) as u32;
                    (root, this.set[lane]) = with(run, this.set[lane], root);
                }
                if this.set.iter().all(|&set| set == root) {
                    self.groups[group].set[chunk] = root;
                }
            }
        }
        root
    }

    /// Notes the set of a run.
    #[inline]
    pub(crate) fn note(&mut self, run: u32, root: u32) {
        self.chunks[run as usize / LANES].set[run as usize % LANES] = root;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn visited(sut: &mut Boxes, bounds: &Bounds, range: (u32, u32), root: u32) -> Vec<u32> {
        let mut visited = Vec::new();
        sut.visit(bounds, range, root, |run, set, root| {
            visited.push(run);
            (root, set)
        });
        visited
    }

    #[test]
    fn runs_whose_boxes_overlap_are_visited_newest_first_unless_they_are_of_the_set() {
        let mut sut = Boxes::new();
        // 200 points a metre apart on each axis in turn.
        for run in 0..200 {
            let mut point = [0.0; 3];
            point[run % 3] = (run / 3) as f32;
            sut.push(&Bounds::of(point));
        }
        let around = sut.around(150, 1.0); // x = 50
        assert_eq!(visited(&mut sut, &around, (0, 200), 999), [153, 150, 147]);
        assert_eq!(visited(&mut sut, &around, (192, 200), 999), [] as [u32; 0]);
        sut.note(153, 7);
        assert_eq!(visited(&mut sut, &around, (0, 200), 7), [150, 147]);
        // All of a group in one set are passed over, until a run is added to it.
        let everywhere = Bounds { low_m: [-1e3; 3], high_m: [1e3; 3] };
        sut.visit(&everywhere, (0, 200), 7, |_, _, root| (root, root));
        assert_eq!(visited(&mut sut, &everywhere, (0, 200), 7), [] as [u32; 0]);
        sut.push(&Bounds::of([0.0; 3]));
        assert_eq!(visited(&mut sut, &everywhere, (0, 201), 7), [200]);
    }
}
