//! A small fixed cluster, its bins and its fit: a change here changes what every shipped model was trained on.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{add_cells, histogram_params, message, params};
use extractor::{Extractor, Features};
use lidar::Return;
use messages::{Cell, CellKind, Descriptors, Part, Verdict};
use stage::Stage;
use zerocopy::FromZeros;

/// Four rings of four returns on a rough wall, in coordinates that need no trigonometry.
fn cluster() -> Vec<Return> {
    (0..16_u16)
        .map(|i| Return {
            x: 8.0 + f32::from(i * 7 % 5) / 64.0,
            y: f32::from(i % 4) / 8.0,
            z: f32::from(i / 4) / 4.0,
            column: i % 4,
            ring: (i / 4) as u8,
            intensity: 0,
        })
        .collect()
}

// verifies EXT-012
#[test]
fn a_fixed_cluster_has_the_bins_it_always_had() {
    let mut sut = Features::new(&histogram_params().checked().unwrap());
    let bins: Vec<(u32, f32)> = sut.describe(&cluster(), 1).bins().map(|bin| (bin.index, bin.weight)).collect();
    assert_eq!(bins, EXPECTED);
}

// verifies EXT-012
#[test]
fn a_fixed_cluster_has_the_fit_it_always_had() {
    let mut input = message(&[cluster()], 0.016);
    input.header.reach_m = 100.0;
    input.header.range_sigma_m = 0.02;
    input.turn_columns = 400;
    input.ring_elevation_rad.extend_from_slice(&std::array::from_fn::<f32, 8, _>(|ring| ring as f32 / 32.0)).unwrap();
    let cells: Vec<Cell> = (0..4)
        .flat_map(|ring| [(398_u16, -2.0), (399, -1.0), (4, 4.0), (5, 5.0)].map(|(column, step)| (ring, column, step)))
        .map(|(ring, column, step)| Cell {
            azimuth_rad: step / 64.0,
            column,
            ring,
            kind: if step > 4.0 { CellKind::Farther } else { CellKind::Miss },
            range_m: if step > 4.0 { 12.0 } else { 0.0 },
        })
        .collect();
    add_cells(&mut input, &cells);
    let mut output = Descriptors::new_box_zeroed().unwrap();
    let verdict = Extractor::init(params()).unwrap().process(Part::default(), &input, &mut output);
    assert_eq!(verdict, Verdict::Complete);
    let fit = &output.fits[0];
    assert_eq!((fit.hits, fit.misses, fit.nearer), (16, 16, 0));
    for (place, (solid, (cost, centre_m, size_m))) in fit.solids.iter().zip(FIT).enumerate() {
        let found = [&[solid.cost()][..], &solid.solid.centre_m, &solid.solid.size_m].concat();
        let expected = [&[cost][..], &centre_m, &size_m].concat();
        // Functions of the mathematical library differ in their last digit from machine to machine.
        let is_close = |(found, expected): (&f32, &f32)| (found - expected).abs() <= 1e-3 * (1.0 + expected.abs());
        assert!(found.iter().zip(&expected).all(is_close), "solid {place}: {found:?}");
    }
    let relief = [0, 4, 5, 6, 45, 48, 51, 56].map(|place| fit.relief[place]);
    for (found, expected) in relief.iter().zip(FIT_RELIEF) {
        assert!((found - expected).abs() < 1e-4, "{relief:?}");
    }
}

/// Cost, centre [m] and size [m] of the four solids.
const FIT: [(f32, [f32; 3], [f32; 3]); 4] = [
    (23.470629, [8.285504, 0.18579575, 0.3730397], [0.6133231, 0.75568783, 0.51067626]),
    (42.746864, [8.133001, 0.19075635, 0.28033412], [0.25070283, 1.6297292, 0.6306676]),
    (38.52944, [8.312893, 0.193126, 0.374682], [0.6472097, 0.6472097, 0.77073854]),
    (66.742546, [8.142947, 0.23462869, 1.8142495], [0.6922164, 0.6922164, 3.5954955]),
];
/// A few numbers of its relief.
const FIT_RELIEF: [f32; 8] =
    [4.0, 0.37453303, 0.085334495, -1.2551292, 0.3122132, -0.00011836076, 0.020512737, 5.3382405e-6];

const EXPECTED: [(u32, f32); 21] = [
    (762, 0.01200014),
    (773, 0.057475038),
    (774, 0.031631745),
    (785, 0.050606817),
    (786, 0.033611715),
    (797, 0.09656655),
    (798, 0.05770542),
    (809, 0.018963011),
    (810, 0.035829373),
    (821, 0.026644072),
    (905, 0.014367274),
    (906, 0.052663736),
    (918, 0.033503212),
    (929, 0.057961628),
    (930, 0.10817202),
    (941, 0.078839175),
    (942, 0.103832945),
    (953, 0.033747446),
    (954, 0.035950825),
    (966, 0.047829513),
    (1074, 0.012098337),
];
