//! The stage as the shell sees it: parts it takes and parts it refuses.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use clusterer::Method;
use clusterer::validation::roots_of;
use common::scanner::Scanner;
use common::twins::{assert_same, assert_summaries};
use common::{METHODS, WHOLE, assert_exact, cloud, empty_turn, process, put, room};
use messages::{Clusters, Part, Refusal, Sweep, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

#[track_caller]
fn assert_nothing_but_the_header(sweep: &Sweep, clusters: &Clusters) {
    assert!(clusters.header == sweep.header || sweep.header.column_step_rad.is_nan());
    let lengths = [clusters.clusters.len(), clusters.returns.len(), clusters.members.len(), clusters.cells.len()];
    assert_eq!((lengths, clusters.ring_elevation_rad.len()), ([0; 4], 0));
}

#[track_caller]
fn assert_malformed(what: &str, spoil: impl Fn(&mut Sweep)) {
    for method in METHODS {
        let mut sweep = Scanner { columns: 40, missing: 0.1, ..Scanner::default() }.sweep();
        let mut sut = room(method, 1.0);
        assert_eq!(process(&mut sut, &sweep).0, Verdict::Complete);
        spoil(&mut sweep);
        let (verdict, clusters) = process(&mut sut, &sweep);
        assert_eq!(verdict, Verdict::RejectedMalformed, "{what}");
        assert_nothing_but_the_header(&sweep, &clusters);
    }
}

// verifies CLU-010
#[test]
fn coordinates_that_are_no_numbers_are_refused() {
    for odd in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_malformed("x", |sweep| sweep.returns[0].x = odd);
        assert_malformed("y", |sweep| sweep.returns[99].y = odd);
        assert_malformed("z", |sweep| sweep.returns.last_mut().unwrap().z = odd);
        assert_malformed("elevation", |sweep| sweep.rings[3].elevation_rad = odd);
        assert_malformed("azimuth", |sweep| sweep.columns.iter_mut().find(|c| c.valid != 0).unwrap().azimuth_rad = odd);
    }
}

// verifies CLU-010
#[test]
fn counts_that_do_not_match_are_refused() {
    assert_malformed("too many recorded", |sweep| sweep.header.recorded += 1);
    assert_malformed("too few recorded", |sweep| sweep.header.recorded -= 1);
    assert_malformed("refused, and no indices", |sweep| {
        sweep.header.refused[Refusal::TooNear as usize] = 2;
        sweep.header.recorded += 2;
    });
    assert_malformed("more refused than can be counted", |sweep| sweep.header.refused = [u32::MAX; 5]);
    assert_malformed("one index for all", |sweep| sweep.recorded_index.push(0).unwrap());
    assert_malformed("the middle of a sweep", |sweep| sweep.first_return = 7);
    assert_malformed("the right half of a sweep", |sweep| sweep.first_column = 7);
}

// verifies CLU-010
#[test]
fn indices_that_do_not_rise_or_are_too_high_are_refused() {
    let index = |sweep: &mut Sweep| {
        for index in 0..sweep.returns.len() as u32 {
            sweep.recorded_index.push(index).unwrap();
        }
    };
    assert_malformed("twice the same", |sweep| {
        index(sweep);
        sweep.recorded_index[4] = 3;
    });
    assert_malformed("the last is beyond the end", |sweep| {
        index(sweep);
        *sweep.recorded_index.last_mut().unwrap() += 1;
    });
}

// verifies CLU-010
#[test]
fn returns_without_a_firing_are_refused() {
    assert_malformed("no such ring", |sweep| sweep.returns[5].ring = 16);
    assert_malformed("no such ring at all", |sweep| sweep.returns[5].ring = 255);
    assert_malformed("no such column", |sweep| sweep.returns[5].column = 40);
    assert_malformed("column that was not received", |sweep| {
        let column = sweep.columns.iter().position(|column| column.valid == 0).unwrap();
        sweep.returns[5].column = column as u16;
    });
    assert_malformed("rings in a cloud", |sweep| sweep.header.organised = 0);
}

// verifies CLU-010
#[test]
fn parts_that_no_sweep_has_are_refused() {
    let sweep = Scanner::default().sweep();
    for (sector, sectors, expected) in [
        (0, 0, Verdict::RejectedMalformed),
        (1, 1, Verdict::RejectedMalformed),
        (36, 36, Verdict::RejectedMalformed),
        (1, 2, Verdict::RejectedIncomplete),
    ] {
        let mut output = Clusters::new_box_zeroed().unwrap();
        let verdict = room(Method::Auto, 1.0).process(Part { sector, sectors, ..WHOLE }, &sweep, &mut output);
        assert_eq!(verdict, expected, "sector {sector} of {sectors}");
        assert_nothing_but_the_header(&sweep, &output);
    }
}

// verifies CLU-005
#[test]
fn keys_and_members_are_indices_over_all_recorded_returns() {
    let mut sweep = Scanner { walls_m: None, ..Scanner::default() }.sweep();
    let count = sweep.returns.len() as u32;
    for place in 0..count {
        sweep.recorded_index.push(3 * place + 2).unwrap();
    }
    sweep.header.recorded = 3 * count;
    sweep.header.refused[Refusal::NotFinite as usize] = 2 * count;
    let clusters = assert_exact(&sweep, 1.0);
    assert!(clusters.clusters.len() > 5);
    assert!(clusters.members.iter().all(|member| member % 3 == 2));
}

// verifies CLU-009
#[test]
fn a_sweep_leaves_no_trace_in_the_next() {
    let sweeps = [
        Scanner { dust: 0.1, seed: 21, ..Scanner::default() }.sweep(),
        cloud(&[[1.0, 2.0, 3.0], [1.0, 2.0, 3.5]]),
        Scanner { walls_m: None, obstacles: 50, seed: 22, sense: -1.0, ..Scanner::default() }.sweep(),
        empty_turn(3, 3),
        Scanner { sideways_rad: 1.5, seed: 23, ..Scanner::default() }.sweep(),
    ];
    for method in METHODS {
        let mut sut = room(method, 0.6);
        for sweep in sweeps.iter().chain(sweeps.iter().rev()) {
            let (_, again) = process(&mut sut, sweep);
            let (_, fresh) = process(&mut room(method, 0.6), sweep);
            assert_same(&again, &fresh);
        }
    }
}

// verifies CLU-009
#[test]
fn what_the_output_held_before_is_gone() {
    let sweep = Scanner::default().sweep();
    let mut sut = room(Method::Auto, 0.6);
    let (_, fresh) = process(&mut sut, &sweep);
    let (_, mut used) = process(&mut sut, &Scanner { seed: 30, ..Scanner::default() }.sweep());
    assert_eq!(sut.process(WHOLE, &sweep, &mut used), Verdict::Complete);
    assert_same(&used, &fresh);
}

// verifies CLU-011
#[test]
fn the_largest_sweep_is_taken_in_whole() {
    let mut sweep = empty_turn(32, 4_608);
    for column in 0..4_608 {
        for ring in 0..32 {
            put(&mut sweep, ring, column, 60.0);
        }
    }
    assert_eq!(sweep.returns.len(), lidar::MAX_RETURNS);
    for (range_d_m, points) in [(0.001, 1), (1.5, lidar::MAX_RETURNS as u32)] {
        let (verdict, clusters) = process(&mut room(Method::Auto, range_d_m), &sweep);
        assert_eq!(verdict, Verdict::Complete);
        roots_of(&sweep, &clusters).unwrap();
        assert!(clusters.clusters.iter().all(|cluster| cluster.summary.points == points));
        if points > 1 {
            assert_summaries(&sweep, &clusters, range_d_m);
        }
    }
}
