//! The scan window takes no memory from the heap; a k-d tree does, which tells which of the two was at work. Alone in
//! its file: the counter sees every thread.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::alloc::System;
use std::f64::consts::PI;

use clusterer::Method::{Auto, Kdtree, Scan};
use common::scanner::Scanner;
use common::sectors::Sender;
use common::{WHOLE, cloud, empty_turn, room};
use messages::{Clusters, Cutter, Message, Sweep};
use stage::Stage;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Whether the heap was left alone, for the first sweep of a room and for those after it.
fn scans(method: clusterer::Method, sweep: &Sweep) -> bool {
    let mut sut = room(method, 1.0);
    let mut output = Clusters::new_box_zeroed().unwrap();
    let region = Region::new(GLOBAL);
    for _ in 0..3 {
        output.clear();
        sut.process(WHOLE, sweep, &mut output);
    }
    let change = region.change();
    assert_eq!(output.returns.len(), sweep.returns.len());
    change.allocations + change.reallocations + change.deallocations == 0
}

/// Whether the heap is left alone by sweeps in sectors.
fn scans_in_sectors(sweep: &mut Sweep, sectors: u32) -> bool {
    Cutter::new(sectors).measure(sweep);
    assert!(sweep.header.stray_rad > 0.0);
    let mut sender = Sender::new(room(Auto, 1.0));
    let region = Region::new(GLOBAL);
    let mut returns = 0;
    for _ in 0..2 {
        for sector in 0..sectors {
            sender.send_quietly(sweep, sectors, sector);
            returns += sender.output.returns.len();
        }
    }
    let change = region.change();
    assert_eq!(returns, 2 * sweep.returns.len());
    change.allocations + change.reallocations + change.deallocations == 0
}

// verifies CLU-009, CLU-011
#[test]
fn regular_sweeps_are_scanned_without_allocating_and_others_go_to_the_tree() {
    let plain = Scanner::default();
    let regular = [
        Scanner { sense: -1.0, ..plain.clone() },
        Scanner { columns: 2_170, rings: 32, dust: 0.01, ..plain.clone() },
        Scanner { jitter: 0.8, missing: 0.3, uneven: true, ..plain.clone() },
        Scanner { turns: 1.1, start_rad: PI / 2.0, ..plain.clone() },
        Scanner { turns: 0.3, sideways_rad: 0.04, ..plain.clone() },
        plain.clone(),
    ];
    for scanner in regular {
        let sweep = scanner.sweep();
        assert!(scans(Auto, &sweep) && scans(Scan, &sweep), "{scanner:?}");
        assert!(!scans(Kdtree, &sweep));
    }
    for sectors in [1, 7, 36, 180] {
        let mut sweep = Scanner { missing: 0.1, walls_m: None, obstacles: 60, ..plain.clone() }.sweep();
        assert!(scans_in_sectors(&mut sweep, sectors), "{sectors} sectors");
    }
    assert!(scans(Auto, &empty_turn(32, 4_608)));
    // A ring whose returns stray by more than 0.1 rad: exact in the window, but slow.
    let mut crooked = Scanner { turning: false, ..plain.clone() }.sweep();
    crooked.returns[900].column += 5;
    crooked.returns.truncate(901);
    crooked.header.recorded = 901;
    assert!(!scans(Auto, &crooked) && scans(Scan, &crooked));
    for sweep in [cloud(&[[1.0, 2.0, 3.0]; 50]), Scanner { turns: 1.7, ..plain.clone() }.sweep()] {
        assert!(!scans(Auto, &sweep) && !scans(Scan, &sweep));
    }
    let mut dual = plain.sweep();
    let again = *dual.returns.last().unwrap();
    let _ = dual.returns.push(again);
    dual.header.recorded += 1;
    assert!(scans(Auto, &dual) && scans(Scan, &dual));
    // Returns that are not in order of their columns.
    dual.returns.swap(0, 900);
    assert!(!scans(Auto, &dual) && !scans(Scan, &dual));
}
