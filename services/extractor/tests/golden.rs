//! A small fixed cluster and its bins: a change here changes what every shipped model was trained on.

use extractor::{Features, Params};
use lidar::Return;

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
    let mut sut = Features::new(&Params { neighbours: 5, spacing_deg: 0.72 }.checked().expect("in range"));
    let bins: Vec<(u32, f32)> = sut.describe(&cluster(), 1).bins().map(|bin| (bin.index, bin.weight)).collect();
    assert_eq!(bins, EXPECTED);
}

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
