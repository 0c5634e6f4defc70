//! Sweeps nobody thought of.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::scanner::Scanner;
use common::twins::assert_cells;
use common::{assert_exact, empty_turn, put};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::default() }
}

prop_compose! {
    fn scanner()(
        rings in 1_usize..24,
        columns in 1_usize..120,
        positive in any::<bool>(),
        start_rad in -3.2..3.2,
        turns in prop_oneof![Just(1.0), 0.05..1.6],
        (turning, uneven) in any::<(bool, bool)>(),
        jitter in prop_oneof![Just(0.0), 0.0..3.0],
        missing in prop_oneof![Just(0.0), 0.0..1.0],
        dropout in 0.0..0.9,
        dust in prop_oneof![Just(0.0), 0.0..0.2],
        sideways_rad in prop_oneof![Just(0.0), 0.0..0.6],
        walls in any::<bool>(),
        (dust_m, obstacles, seed) in (0.1..5.0, 0_usize..30, any::<u64>()),
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

proptest! {
    #![proptest_config(config(400))]

    // verifies CLU-001, CLU-002, CLU-007
    #[test]
    fn any_sweep_is_parted_exactly(scanner in scanner(), range_d_m in prop_oneof![0.01_f32..0.3, 0.3_f32..4.0, 4.0_f32..40.0]) {
        let sweep = scanner.sweep();
        let clusters = assert_exact(&sweep, range_d_m);
        if sweep.returns.len() < 600 {
            assert_cells(&sweep, &clusters, 5);
        }
    }

    // verifies CLU-002
    #[test]
    fn any_few_returns_at_the_length_of_d_are_parted_exactly(
        columns in 3_usize..300,
        returns in prop::collection::vec((0_usize..32, 0.0..1.0, 0.9..6.0), 2..40),
        range_d_m in 0.8_f32..1.6,
    ) {
        let mut sweep = empty_turn(32, columns);
        let mut taken = std::collections::BTreeSet::new();
        for (ring, part, range_m) in returns {
            let column = (part * columns as f64) as usize;
            if taken.insert((ring, column)) {
                put(&mut sweep, ring, column, range_m);
            }
        }
        assert_exact(&sweep, range_d_m);
    }
}
