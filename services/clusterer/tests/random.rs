//! Sweeps nobody thought of.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::scanner::Scanner;
use common::twins::assert_cells;
use common::{any, assert_exact, empty_turn, put};
use proptest::prelude::*;

/// Any scanner at all.
fn scanner() -> impl Strategy<Value = Scanner> {
    any::scanner(any::Bounds {
        columns: 1..120,
        most_turns: 1.6,
        most_jitter: 3.0,
        most_missing: 1.0,
        most_sideways_rad: 0.6,
        most_obstacles: 30,
    })
}

proptest! {
    #![proptest_config(any::config(400))]

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
