//! The paper's Algorithm 1: clusters grow breadth first over a k-d tree.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use lidar::MAX_RETURNS;

use crate::distance::squared_m2;
use crate::runs::Runs;
use crate::seen::Seen;
use crate::sets::{Extent, Sets};

/// Radius of a query, as a factor of d: the tree rounds otherwise than [`squared_m2`], which has the last word.
const WIDER: f32 = 1.000_1;

/// Algorithm 1 and its memory. The tree itself is built, and so allocated, for each sweep: kiddo offers no rebuilding
/// in place, and its mutable tree refuses equal points beyond a bucket.
pub(crate) struct Tree {
    range_d_m: f32,
    positions: Vec<[f32; 3]>,
    seen: Vec<bool>,
    queue: Vec<u32>,
}

impl Tree {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self {
            range_d_m,
            positions: Vec::with_capacity(MAX_RETURNS),
            seen: Vec::with_capacity(MAX_RETURNS),
            queue: Vec::with_capacity(MAX_RETURNS),
        }
    }

    /// Joins all pairs of returns within d. Each return is a run of its own.
    pub(crate) fn partition(&mut self, seen: &Seen, runs: &mut Runs, sets: &mut Sets) {
        let count = seen.returns.len();
        runs.lay_alone(count);
        sets.reset();
        for _ in 0..count {
            sets.push(Extent { points: 1, column: 0, travel_rad: 0.0, held: true });
        }
        self.positions.clear();
        self.positions.extend(seen.returns.iter().map(|r| r.position()));
        // Fails for more items than the index can number only: a sweep has far fewer.
        let Ok(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(&self.positions) else { return };
        let within_m2 = self.range_d_m * self.range_d_m;
        let radius_m2 = within_m2 * (WIDER * WIDER);
        let mut scratch = tree.create_scratch::<SquaredEuclidean<f32>>();
        self.seen.clear();
        self.seen.resize(count, false);
        let Self { positions, seen, queue, .. } = self;
        for start in 0..count {
            if seen[start] {
                continue;
            }
            // Algorithm 1: a point not yet processed opens a queue, to which each of its members adds its neighbours.
            seen[start] = true;
            queue.clear();
            queue.push(start as u32);
            let mut head = 0;
            while let Some(&member) = queue.get(head) {
                head += 1;
                let position = positions[member as usize];
                let query = tree.query(&position).within::<SquaredEuclidean<f32>>(radius_m2).unsorted();
                query.with_scratch(&mut scratch).visit(|found| {
                    let place = found.item as usize;
                    if !seen[place] && squared_m2(positions[place], position) <= within_m2 {
                        seen[place] = true;
                        queue.push(found.item);
                    }
                });
            }
            for &member in &queue[1..] {
                sets.join(start as u32, member);
            }
        }
    }
}
