//! The sets that models are made from and tested on: each with random numbers of its own, so that no obstacle of one is
//! in another.

use simulator::Shape;

use crate::{Example, ObserveError, Observer};

/// A set of obstacles seen alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Set {
    Training = 0,
    HeldOut = 1,
}

impl Set {
    /// The set's first `count` obstacles of a shape.
    pub(crate) fn alone(
        self,
        observer: &mut Observer,
        seed: u64,
        shape: Shape,
        count: usize,
    ) -> Result<Vec<Example>, ObserveError> {
        let seed = self.seed(seed);
        (0..count as u32).map(|number| observer.alone(seed, shape, number)).collect()
    }

    /// What the set is drawn with under a plan's seed.
    pub(crate) fn seed(self, plan: u64) -> u64 {
        set_seed(plan, self as u64)
    }
}

/// Every cluster of the first `scenes` cluttered scenes of a shape.
pub(crate) fn cluttered(
    observer: &mut Observer,
    seed: u64,
    shape: Shape,
    scenes: usize,
) -> Result<Vec<Example>, ObserveError> {
    let mut examples = Vec::new();
    for number in 0..scenes as u64 {
        let seed = set_seed(seed, 2).wrapping_add(4 * number + shape as u64);
        examples.extend(observer.cluttered(seed, shape)?);
    }
    Ok(examples)
}

fn set_seed(plan: u64, set: u64) -> u64 {
    plan.wrapping_add(set << 40)
}
