//! Scanners by chance.

use std::ops::Range;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::scanner::Scanner;

/// `cases` cases, the same in every run.
pub(crate) fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() }
}

/// How far a scanner may go.
#[derive(Clone, Debug)]
pub(crate) struct Bounds {
    pub(crate) columns: Range<usize>,
    pub(crate) most_turns: f64,
    pub(crate) most_jitter: f64,
    pub(crate) most_missing: f64,
    pub(crate) most_sideways_rad: f64,
    pub(crate) most_obstacles: usize,
}

prop_compose! {
    pub(crate) fn scanner(bounds: Bounds)(
        rings in 1_usize..24,
        columns in bounds.columns,
        positive in any::<bool>(),
        start_rad in -3.2..3.2,
        turns in prop_oneof![Just(1.0), 0.05..bounds.most_turns],
        (turning, uneven) in any::<(bool, bool)>(),
        jitter in prop_oneof![Just(0.0), 0.0..bounds.most_jitter],
        missing in prop_oneof![Just(0.0), 0.0..bounds.most_missing],
        dropout in 0.0..0.9,
        dust in prop_oneof![Just(0.0), 0.0..0.2],
        sideways_rad in prop_oneof![Just(0.0), 0.0..bounds.most_sideways_rad],
        walls in any::<bool>(),
        (dust_m, obstacles, seed) in (0.1..5.0, 0..bounds.most_obstacles, any::<u64>()),
    ) -> Scanner {
        Scanner {
            rings,
            columns,
            sense: if positive { 1.0 } else { -1.0 },
            start_rad,
            turns,
            turning,
            jitter,
            missing,
            dropout,
            dust,
            dust_m,
            noise_m: 0.02,
            uneven,
            sideways_rad,
            walls_m: walls.then_some([5.0, 8.0, 3.0]),
            obstacles,
            seed,
        }
    }
}
