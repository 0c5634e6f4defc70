//! Fits that contradict the track, and returns that tell nothing new of it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{Played, Seen, moving, params};
use tracker::Params;

/// The same returns of something at rest, 10 m ahead, fitted as a body of an extent [m]: the larger, the farther is its centre.
fn fitted(size_m: f32) -> Seen {
    let returns_m = 10.0 - 0.65 * 0.5;
    Seen { size_m: [size_m; 3], ..Seen::at(returns_m + 0.65 * 0.5 * f64::from(size_m), 0.0, 0.0) }
}

/// The shipped parameters, with this patience whatever a track stands on.
fn patient(patience: u32) -> Params {
    let mut params = params();
    params.fit.patience = patience;
    params.fit.patience_share = 0.0;
    params
}

/// Extents of its track after twenty fits of 1 m and after each of these [m].
fn extents_m(params: Params, fits_m: &[f32]) -> Vec<f32> {
    let mut sut = Played::new(params);
    for _ in 0..20 {
        sut.sweep(&[fitted(1.0)]);
    }
    let id = sut.only().id;
    let after = |size_m: &f32| {
        sut.sweep(&[fitted(*size_m)]);
        assert_eq!(sut.only().id, id);
        sut.only().size_m[0]
    };
    fits_m.iter().map(after).collect()
}

/// Each so far from the one before that it is a jump, whatever the jumps before left in doubt.
const JUMPS_M: [f32; 4] = [2.0, 4.0, 8.0, 16.0];

#[test]
fn a_track_that_fits_contradict_again_and_again_goes_where_they_are() {
    for patience in 1..=4 {
        let found_m = extents_m(patient(patience), &JUMPS_M);
        let last = patience as usize - 1;
        for (place, (found_m, fit_m)) in found_m.iter().zip(JUMPS_M).enumerate().take(patience as usize) {
            let believed_m = if place == last { fit_m } else { 1.0 };
            assert!(
                (found_m - believed_m).abs() < 0.05 * believed_m,
                "jump {place} with a patience of {patience}: {found_m} m"
            );
        }
    }
    // As shipped it takes more than four.
    assert!(extents_m(params(), &JUMPS_M).iter().all(|found_m| (found_m - 1.0).abs() < 0.05));
}

#[test]
fn a_track_that_stands_on_many_fits_bears_more_that_contradict_it() {
    let found_m = |patience_share: f64| {
        let mut params = patient(2);
        params.fit.patience_share = patience_share;
        extents_m(params, &JUMPS_M[..3])
    };
    // A tenth of twenty is two, a fifth four.
    assert!((found_m(0.1)[1] - JUMPS_M[1]).abs() < 0.2, "{:?}", found_m(0.1));
    assert!((found_m(0.2)[2] - 1.0).abs() < 0.2, "{:?}", found_m(0.2));
}

#[test]
fn a_fit_as_expected_between_two_that_are_not_keeps_a_track_where_it_is() {
    let found_m = extents_m(patient(2), &[1.4, 1.0, 3.0]);
    assert!(found_m.iter().all(|found_m| (found_m - 1.0).abs() < 0.05), "{found_m:?}");
}

#[test]
fn a_track_that_goes_where_fits_are_may_have_any_velocity_again() {
    let speed_sigma_mps = |patience: u32| {
        let mut sut = Played::new(patient(patience));
        for _ in 0..20 {
            sut.sweep(&[fitted(1.0)]);
        }
        sut.sweep(&[fitted(3.0)]);
        sut.only().covariance_of(3, 3).sqrt()
    };
    assert!(speed_sigma_mps(1) > 10.0 * speed_sigma_mps(8), "{} {}", speed_sigma_mps(1), speed_sigma_mps(8));
}

#[test]
fn returns_without_a_fit_do_not_move_a_track_that_fits_know_better() {
    let strayed_m = |worth: f64| {
        let mut params = params();
        params.centroid.worth = worth;
        let mut sut = Played::new(params);
        for _ in 0..20 {
            sut.sweep(&[Seen::at(10.0, 0.0, 0.0)]);
        }
        for _ in 0..10 {
            sut.sweep(&[Seen { fitted: false, ..Seen::at(10.2, 0.2, 0.0) }]);
            assert_eq!(sut.only().last_seen_sweeps, 0);
        }
        sut.only().position_m[1].abs()
    };
    assert!(strayed_m(params().centroid.worth) < 1e-4, "{}", strayed_m(params().centroid.worth));
    // Were they worth more, they would.
    assert!(strayed_m(1e6) > 1e-3, "{}", strayed_m(1e6));
}

#[test]
fn returns_without_a_fit_are_all_there_is_of_a_track_that_never_had_one() {
    let mut params = params();
    // Whatever they are worth beside fits.
    params.centroid.worth = 0.0;
    let mut sut = Played::new(params);
    for sweep in 0..30 {
        sut.sweep(&[Seen { fitted: false, ..moving([10.0, 0.0, 0.0], [0.0, 0.3, 0.0], sweep) }]);
    }
    let found_mps = sut.only().velocity_mps[1];
    assert!((found_mps - 0.3).abs() < 0.1, "{found_mps}");
}
