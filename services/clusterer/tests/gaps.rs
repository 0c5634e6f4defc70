//! Sectors that are missing, contradict each other or are left out on purpose.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use clusterer::Method;
use common::room;
use common::scanner::Scanner;
use common::sectors::{Closed, Sender};
use messages::Verdict::{Complete, RejectedIncomplete, RejectedMalformed, RejectedShed};
use messages::{Cutter, Refusal, Step, Sweep};

const SECTORS: u32 = 6;

fn measured() -> Box<Sweep> {
    let scanner = Scanner { walls_m: None, obstacles: 50, missing: 0.05, ..Scanner::default() };
    let mut sweep = scanner.sweep();
    Cutter::new(SECTORS).measure(&mut sweep);
    assert!(sweep.header.stray_rad > 0.0);
    sweep
}

fn sender() -> Sender {
    Sender::new(room(Method::Auto, 0.7))
}

fn bytes(closed: &[Closed]) -> Vec<Vec<u8>> {
    closed.iter().map(Closed::bytes).collect()
}

/// The next sweep is as if nothing had been before it.
#[track_caller]
fn assert_heals(sender: &mut Sender, sweep: &Sweep) {
    sender.sweep += 1;
    let closed = sender.send_all(sweep, SECTORS);
    let mut fresh = self::sender();
    assert!(bytes(&closed) == bytes(&fresh.send_all(sweep, SECTORS)));
    assert!(closed.len() > 5);
}

// verifies CLU-015
#[test]
fn after_a_missing_sector_nothing_goes_out_until_a_sweep_begins() {
    let sweep = measured();
    for missing in 0..SECTORS {
        let mut sender = sender();
        for sector in (0..SECTORS).filter(|&sector| sector != missing) {
            let expected = if sector < missing { Complete } else { RejectedIncomplete };
            assert_eq!(sender.send_sector(&sweep, SECTORS, sector), expected, "sector {sector} without {missing}");
        }
        assert_heals(&mut sender, &sweep);
    }
}

// verifies CLU-015
#[test]
fn a_sweep_that_begins_before_the_one_before_has_ended_is_whole_itself() {
    let sweep = measured();
    let mut sender = sender();
    for sector in 0..SECTORS - 1 {
        assert_eq!(sender.send_sector(&sweep, SECTORS, sector), Complete);
    }
    assert_heals(&mut sender, &sweep);
    // A sector of another sweep, of another number of sectors, or again.
    for (sweep_on, sectors, sector) in [(1, SECTORS, 2), (0, SECTORS + 1, 2), (0, SECTORS, 1)] {
        for sector in 0..2 {
            assert_eq!(sender.send_sector(&sweep, SECTORS, sector), Complete);
        }
        sender.sweep += sweep_on;
        sender.cut(&sweep, SECTORS, sector);
        assert_eq!(sender.send(sectors, sector), RejectedIncomplete);
        assert_eq!(sender.send_sector(&sweep, SECTORS, 2), RejectedIncomplete);
        assert_heals(&mut sender, &sweep);
    }
}

#[track_caller]
fn assert_malformed(what: &str, at: u32, spoil: impl Fn(&mut Sweep)) {
    for method in common::METHODS {
        let sweep = measured();
        let mut sender = Sender::new(room(method, 0.7));
        for sector in 0..SECTORS {
            sender.cut(&sweep, SECTORS, sector);
            if sector == at {
                spoil(&mut sender.piece);
            }
            let expected = match sector.cmp(&at) {
                std::cmp::Ordering::Less => Complete,
                std::cmp::Ordering::Equal => RejectedMalformed,
                std::cmp::Ordering::Greater => RejectedIncomplete,
            };
            assert_eq!(sender.send(SECTORS, sector), expected, "{what}: sector {sector}");
        }
        sender.sweep += 1;
        assert!(sender.send_all(&sweep, SECTORS).len() > 5);
    }
}

// verifies CLU-010, CLU-015
#[test]
fn a_sector_that_contradicts_those_before_ends_its_sweep() {
    assert_malformed("time", 2, |sector| sector.header.sensor_time_ns += 1);
    assert_malformed("period", 2, |sector| sector.header.period_ns += 1);
    assert_malformed("order", 2, |sector| sector.header.organised = 0);
    assert_malformed("step", 2, |sector| sector.header.column_step_rad *= 2.0);
    assert_malformed("noise", 2, |sector| sector.header.range_sigma_m += 0.1);
    assert_malformed("reach", 2, |sector| sector.header.reach_m += 0.1);
    assert_malformed("promise", 2, |sector| sector.header.stray_rad *= 2.0);
    assert_malformed("no promise any more", 2, |sector| sector.header.stray_rad = 0.0);
    assert_malformed("ring", 2, |sector| sector.rings[3].elevation_rad += 0.1);
    assert_malformed("number of rings", 2, |sector| sector.rings.truncate(15));
    assert_malformed("first column", 2, |sector| sector.first_column += 1);
    assert_malformed("columns of the sector before", 3, |sector| sector.first_column = 60);
    assert_malformed("indices of the sector before", 3, |sector| sector.first_return = 1);
    assert_malformed("counts", 3, |sector| sector.header.recorded += 1);
    assert_malformed("a return of the sector before", 3, |sector| sector.returns[0].column = 0);
    assert_malformed("a return of the sector after", 3, |sector| sector.returns[0].column = 179);
    assert_malformed("indices beyond the end", SECTORS - 1, |sector| sector.first_return += 1);
    assert_malformed("more than a sweep may have", 3, |sector| {
        sector.columns.resize_zeroed(lidar::MAX_COLUMNS).unwrap();
    });
    assert_malformed("an index that does not rise", 3, |sector| {
        let first = sector.first_return;
        for place in 0..sector.returns.len() as u32 {
            sector.recorded_index.push(first + place - 9).unwrap();
        }
    });
    assert_malformed("refused, and no indices", SECTORS - 1, |sector| {
        sector.header.refused[Refusal::TooNear as usize] = 2;
        sector.header.recorded += 2;
    });
}

// verifies CLU-010, CLU-015
#[test]
fn a_sector_that_breaks_the_promise_of_its_sweep_ends_it() {
    for at in [0, 2, SECTORS - 1] {
        assert_malformed("beside its column", at, |sector| {
            let r = &mut sector.returns[4];
            (r.x, r.y) = (r.x - 0.3 * r.y, r.y + 0.3 * r.x);
        });
        assert_malformed("behind the sensor", at, |sector| {
            let r = &mut sector.returns[4];
            (r.x, r.y) = (-r.x, -r.y);
        });
        assert_malformed("too far", at, |sector| sector.returns[4].z = 2e6);
        assert_malformed("not a number", at, |sector| sector.returns[4].z = f32::NAN);
        assert_malformed("out of order", at, |sector| {
            let last = sector.returns.len() - 1;
            sector.returns.swap(0, last);
        });
        assert_malformed("two of a firing", at, |sector| {
            let again = sector.returns[4];
            sector.returns[5] = again;
        });
        assert_malformed("a column that goes back", at, |sector| {
            let middle = sector.columns.len() / 2;
            sector.columns[middle].azimuth_rad -= 0.3;
            sector.columns[middle].valid = 1;
        });
        assert_malformed("a column not received", at, |sector| {
            let column = u32::from(sector.returns[0].column) - sector.first_column;
            sector.columns[column as usize].valid = 0;
        });
    }
    assert_malformed("stray", 0, |sector| sector.header.stray_rad = 0.6);
    assert_malformed("no step", 0, |sector| sector.header.column_step_rad = 0.0);
    assert_malformed("a promise that is no number", 0, |sector| sector.header.stray_rad = f32::NAN);
    assert_malformed("returns before the last sector of a sweep that may not be cut", 0, |sector| {
        sector.header.stray_rad = 0.0;
    });
}

// verifies CLU-016
#[test]
fn every_odd_sweep_is_shed_at_the_last_step_and_leaves_no_gap() {
    let sweep = measured();
    let mut sender = sender();
    sender.step = Step::EverySecondSweep;
    let first = sender.send_all(&sweep, SECTORS);
    for round in 0..2 {
        assert_eq!(sender.sweep % 2, 1);
        for sector in 0..SECTORS {
            assert_eq!(sender.send_sector(&sweep, SECTORS, sector), RejectedShed);
        }
        sender.sweep += 1;
        assert!(bytes(&sender.send_all(&sweep, SECTORS)) == bytes(&first), "round {round}");
    }
    sender.step = Step::ClustersOnly;
    assert!(bytes(&sender.send_all(&sweep, SECTORS)) == bytes(&first), "lesser steps shed nothing");
}
