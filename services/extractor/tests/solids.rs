//! Fits as the shell sees them: which clusters get one, and what the message says of them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{add_cells, message, params, sphere};
use extractor::{Extractor, Params};
use lidar::Return;
use messages::{Cell, CellKind, Clusters, Descriptors, MAX_FITS, Part, Verdict};
use stage::Stage;
use zerocopy::{FromZeros, IntoBytes};

const STEP_RAD: f32 = 0.012_566_37;

fn room() -> Extractor {
    Extractor::init(Params { histogram: false, ..params() }).unwrap()
}

fn process(room: &mut Extractor, input: &Clusters) -> (Verdict, Box<Descriptors>) {
    let mut output = Descriptors::new_box_zeroed().unwrap();
    let verdict = room.process(Part::default(), input, &mut output);
    (verdict, output)
}

fn ball(range_m: f64) -> Vec<Return> {
    sphere([range_m, 0.5, 0.2], 0.6, 0.72, 0.02, 4)
}

/// A row of returns as wide as this [m].
fn row(count: u16, width_m: f32) -> Vec<Return> {
    let step_m = width_m / f32::from(count - 1);
    (0..count).map(|i| Return { x: 9.0, y: f32::from(i) * step_m, column: i, ..Return::default() }).collect()
}

// verifies EXT-013
#[test]
fn clusters_of_five_points_and_more_get_a_fit_but_not_those_wider_than_any_body() {
    let input = message(&[row(4, 1.0), row(5, 1.0), row(9, 8.1), row(9, 7.9), ball(6.0)], STEP_RAD);
    let (verdict, output) = process(&mut room(), &input);
    assert_eq!(verdict, Verdict::Complete);
    let places: Vec<Option<usize>> = output.descriptors.iter().map(|d| d.fit_place()).collect();
    assert_eq!(places, [None, Some(0), None, Some(1), Some(2)]);
    assert_eq!(output.fits.len(), 3);
    assert!(output.bins.is_empty());
    assert_eq!(output.fits[0].hits, 5);
}

// verifies EXT-009
#[test]
fn a_clusters_fit_does_not_depend_on_the_clusters_beside_or_before_it() {
    let mut sut = room();
    let (_, alone) = process(&mut sut, &message(&[ball(6.0)], STEP_RAD));
    let (_, among) = process(&mut sut, &message(&[ball(3.0), ball(6.0), row(50, 2.0)], STEP_RAD));
    assert_eq!(among.fits[1].as_bytes(), alone.fits[0].as_bytes());
    assert_ne!(among.fits[0].as_bytes(), alone.fits[0].as_bytes());
}

// verifies EXT-014
#[test]
fn what_does_not_fit_into_the_message_is_left_out_and_said_so() {
    let mut params = Params { histogram: false, ..params() };
    params.fit.evaluations = 1;
    let mut sut = Extractor::init(params).unwrap();
    let clusters = vec![row(5, 0.5); MAX_FITS + 2];
    let (verdict, output) = process(&mut sut, &message(&clusters[..MAX_FITS], STEP_RAD));
    assert_eq!((verdict, output.fits.len()), (Verdict::Complete, MAX_FITS));
    let (verdict, output) = process(&mut sut, &message(&clusters, STEP_RAD));
    assert_eq!((verdict, output.fits.len()), (Verdict::PartialFits, MAX_FITS));
    assert_eq!(output.descriptors.len(), MAX_FITS + 2);
    let fitted = output.descriptors.iter().take_while(|d| d.fit_place().is_some()).count();
    assert_eq!(fitted, MAX_FITS);
    assert!(output.descriptors[MAX_FITS..].iter().all(|d| d.fit_place().is_none()));
}

fn with_cells() -> Box<Clusters> {
    let mut input = message(&[ball(6.0), ball(9.0)], STEP_RAD);
    input.ring_elevation_rad.extend_from_slice(&[0.0; 32]).unwrap();
    input.turn_columns = 500;
    let cell = Cell { kind: CellKind::Miss, ring: 3, column: 7, ..Cell::default() };
    add_cells(&mut input, &[cell; 4]);
    input
}

// verifies EXT-010
#[test]
fn cells_that_contradict_the_message_are_rejected() {
    let mut sut = room();
    let spoils: [fn(&mut Clusters); 8] = [
        |m| m.clusters[1].first_cell += 1,
        |m| m.clusters[1].cells += 1,
        |m| m.clusters[1].cells = u32::MAX,
        |m| m.clusters[1].cells = 0,
        |m| m.clusters[0].cells = 4,
        |m| m.cells.truncate(3),
        |m| m.cells[2].azimuth_rad = f32::NAN,
        |m| m.turn_columns = u64::MAX,
    ];
    for (number, spoil) in spoils.into_iter().enumerate() {
        let mut input = with_cells();
        assert_eq!(process(&mut sut, &input).0, Verdict::Complete);
        spoil(&mut input);
        let (verdict, output) = process(&mut sut, &input);
        assert_eq!(verdict, Verdict::RejectedMalformed, "spoil {number}");
        assert!(output.descriptors.is_empty() && output.fits.is_empty());
    }
}

#[test]
fn a_cluster_without_cells_may_have_them_begin_anywhere() {
    let mut input = with_cells();
    let (_, expected) = process(&mut room(), &input);
    for first_cell in [4, 5, u32::MAX] {
        input.clusters[0].first_cell = first_cell;
        let (verdict, output) = process(&mut room(), &input);
        assert_eq!(verdict, Verdict::Complete);
        assert_eq!(output.fits.as_bytes(), expected.fits.as_bytes());
    }
}

#[test]
fn cells_of_rings_and_columns_that_are_not_there_do_no_harm() {
    let mut input = with_cells();
    for (place, (ring, column)) in [(255, 0), (31, u16::MAX), (63, 499), (0, 0)].into_iter().enumerate() {
        (input.cells[place].ring, input.cells[place].column) = (ring, column);
    }
    input.header.reach_m = f32::NAN;
    input.header.range_sigma_m = f32::INFINITY;
    let (verdict, output) = process(&mut room(), &input);
    assert_eq!((verdict, output.fits.len()), (Verdict::Complete, 2));
}

#[test]
fn coordinates_at_the_ends_of_their_range_do_no_harm() {
    for scale in [f32::MIN_POSITIVE, 1e-40, 1e-20, 1e-3, 1e20, f32::MAX] {
        let at = |i: usize| [scale, -scale, 1e-40, 0.0][i % 4];
        let scattered: Vec<Return> =
            (0..12).map(|i| Return { x: at(i), y: at(i / 2), z: scale, ..Return::default() }).collect();
        let opposite = (0..6).map(|i| Return { x: [scale, -scale][i % 2], ..Return::default() }).collect();
        let far_off = (0..6).map(|i| Return { x: scale, y: i as f32, ..Return::default() }).collect();
        let (verdict, output) = process(&mut room(), &message(&[scattered, opposite, far_off], STEP_RAD));
        assert_eq!(verdict, Verdict::Complete);
        for fit in &output.fits {
            let sizes = fit.solids.iter().flat_map(|s| s.solid.size_m).chain(fit.relief);
            assert!(sizes.into_iter().all(f32::is_finite), "{scale}");
            assert!(fit.solids.iter().all(|s| s.cost().is_finite()), "{scale}: {:?}", fit.solids.map(|s| s.cost()));
        }
    }
}
