//! Measures of identity against implementations that nobody here wrote: motmetrics 1.4.0 (CLEAR MOT, IDF1) and TrackEval
//! 1.3.0 (IDF1, HOTA and its parts), both from PyPI, run on the same seeded sequences.

use super::clear_mot::ClearMot;
use super::frame::Frame;
use super::hota::Hota;
use super::identity::Identity;

/// Knuth's 64-bit linear congruence: the same numbers in any language.
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Obstacles on a line that wander, hide, and are followed with noise, gaps, swapped and new numbers, and false tracks.
fn sequence(seed: u64) -> Vec<Frame> {
    let mut random = Random(seed.wrapping_mul(2_654_435_761).wrapping_add(1));
    let count = 2 + (5.0 * random.next()) as usize;
    let sweeps = 8 + (12.0 * random.next()) as usize;
    let mut at_m: Vec<f64> = (0..count).map(|place| 1.5 * place as f64).collect();
    let mut ids: Vec<u64> = (100..).take(count).collect();
    let mut next_id = 100 + count as u64;
    let one_sweep = |_| {
        let mut actual: Vec<(u16, f64)> = Vec::new();
        let mut claimed: Vec<(u64, f64)> = Vec::new();
        for (id, at_m) in (0..).zip(&mut at_m) {
            *at_m += random.next() - 0.5;
            if random.next() > 0.15 {
                actual.push((id, *at_m));
            }
        }
        if random.next() < 0.25 {
            let one = (random.next() * count as f64) as usize;
            ids.swap(one, (random.next() * count as f64) as usize);
        }
        for id in &mut ids {
            if random.next() < 0.1 {
                *id = next_id;
                next_id += 1;
            }
        }
        for (id, at_m) in ids.iter().zip(&at_m) {
            let seen_m = at_m + 2.0 * (random.next() - 0.5);
            if random.next() > 0.2 {
                claimed.push((*id, seen_m));
            }
        }
        if random.next() < 0.3 {
            let id = 900 + (3.0 * random.next()) as u64;
            claimed.push((id, random.next() * 1.5 * count as f64));
        }
        Frame {
            actual: actual.iter().map(|one| one.0).collect(),
            claimed: claimed.iter().map(|one| one.0).collect(),
            distance_m: actual
                .iter()
                .flat_map(|one| claimed.iter().map(move |other| (one.1 - other.1).abs()))
                .collect(),
        }
    };
    (0..sweeps).map(one_sweep).collect()
}

/// Seed; objects, matches, misses, false tracks, switches; MOTA, MOTP \[m\], IDF1, HOTA, DetA, AssA, LocA. Matches within
/// 1 m; similarity 1 − distance/2 m.
type Golden = (u64, [u32; 5], [f64; 7]);

const GOLDEN: [Golden; 16] = [
    (
        1,
        [64, 56, 8, 16, 14],
        [
            0.40625,
            0.5249261645400187,
            0.45588235294117646,
            0.34192714925417145,
            0.5370081640160994,
            0.2181980704278741,
            0.8337820955976935,
        ],
    ),
    (
        2,
        [87, 73, 14, 16, 17],
        [
            0.45977011494252873,
            0.5499204293128725,
            0.48863636363636365,
            0.34544125708117956,
            0.4932603229829177,
            0.24551260288048893,
            0.7891738254457671,
        ],
    ),
    (
        3,
        [27, 20, 7, 8, 7],
        [
            0.18518518518518523,
            0.3830110980379106,
            0.32727272727272727,
            0.29122639791160104,
            0.45463523245781323,
            0.18956944298052875,
            0.8482458036094298,
        ],
    ),
    (
        4,
        [18, 16, 2, 9, 4],
        [
            0.16666666666666663,
            0.46065533498979483,
            0.5581395348837209,
            0.39012870926017706,
            0.4469535279548116,
            0.3418562772510141,
            0.8170126291750925,
        ],
    ),
    (
        5,
        [31, 25, 6, 5, 3],
        [
            0.5483870967741935,
            0.5601507755707145,
            0.7868852459016393,
            0.4713231632367801,
            0.504905406439179,
            0.44160518326614434,
            0.7877413346479868,
        ],
    ),
    (
        6,
        [49, 39, 10, 7, 10],
        [
            0.44897959183673475,
            0.3791731819207146,
            0.5052631578947369,
            0.4206428379527035,
            0.5448655955555337,
            0.32975908700868506,
            0.8446271934550658,
        ],
    ),
    (
        7,
        [62, 53, 9, 7, 9],
        [
            0.5967741935483871,
            0.5090097638100624,
            0.7049180327868853,
            0.4648902635110026,
            0.5313986830979779,
            0.4087864550592065,
            0.8016216371583006,
        ],
    ),
    (
        8,
        [21, 18, 3, 8, 5],
        [
            0.23809523809523814,
            0.5457426452378109,
            0.3404255319148936,
            0.2858802932204853,
            0.42985558482919733,
            0.19232976682644048,
            0.7859333702856501,
        ],
    ),
    (
        9,
        [42, 30, 12, 10, 9],
        [
            0.26190476190476186,
            0.5269450587847995,
            0.36585365853658536,
            0.31340371586569227,
            0.4211110844519674,
            0.2358919080235265,
            0.8022458300693727,
        ],
    ),
    (
        10,
        [75, 64, 11, 15, 12],
        [
            0.4933333333333333,
            0.49854627806457474,
            0.6103896103896104,
            0.4133856425196496,
            0.5168482531432549,
            0.33116947841348215,
            0.8118010760508172,
        ],
    ),
    (
        11,
        [96, 81, 15, 17, 21],
        [
            0.44791666666666663,
            0.4889243155077736,
            0.5567010309278351,
            0.3675918044545748,
            0.5253293793731338,
            0.25768260349926414,
            0.8177217074556623,
        ],
    ),
    (
        12,
        [13, 12, 1, 5, 3],
        [
            0.3076923076923077,
            0.436432116016527,
            0.4666666666666667,
            0.38100631010450803,
            0.5288288109979064,
            0.282880493819489,
            0.8579831646619306,
        ],
    ),
    (
        13,
        [25, 18, 7, 7, 3],
        [
            0.31999999999999995,
            0.5268830261048625,
            0.52,
            0.3287564482032166,
            0.46022096317795946,
            0.2450338882358895,
            0.8307344799404803,
        ],
    ),
    (
        14,
        [40, 33, 7, 9, 7],
        [
            0.42500000000000004,
            0.4969806203424125,
            0.5609756097560976,
            0.41605025230829246,
            0.5242543492596597,
            0.3327347921001569,
            0.8054761737873282,
        ],
    ),
    (
        15,
        [55, 49, 6, 10, 15],
        [
            0.4363636363636364,
            0.5039994825505488,
            0.49122807017543857,
            0.3762197765613213,
            0.543208064353797,
            0.26491710236656363,
            0.8193401993559742,
        ],
    ),
    (
        16,
        [73, 59, 14, 15, 16],
        [
            0.3835616438356164,
            0.5579446151869416,
            0.54421768707483,
            0.3465602777142506,
            0.47622248842183434,
            0.25454324345348595,
            0.8026620274559674,
        ],
    ),
];

#[test]
fn clear_mot_idf1_and_hota_are_those_of_motmetrics_and_trackeval() {
    for (seed, counts, values) in GOLDEN {
        let frames = sequence(seed);
        let (clear, matches) = ClearMot::of(&frames, 1.0);
        let found = [clear.objects, clear.matched, clear.missed, clear.false_tracks, clear.switches];
        assert_eq!(found, counts, "seed {seed}");
        assert_eq!(matches.iter().map(Vec::len).sum::<usize>() as u32, clear.matched);
        let (identity, hota) = (Identity::of(&frames, 1.0), Hota::of(&frames, 2.0));
        let found = [
            clear.mota(),
            clear.motp_m(),
            identity.idf1(),
            hota.hota(),
            hota.detection(),
            hota.association(),
            hota.localisation(),
        ];
        for (found, expected) in found.into_iter().zip(values) {
            assert!((found.unwrap() - expected).abs() < 1e-9, "seed {seed}: {found:?} is not {expected}");
        }
    }
}

#[test]
fn a_perfect_tracker_has_all_of_it_and_one_that_says_nothing_has_none() {
    let mut frames = sequence(1);
    for frame in &mut frames {
        frame.claimed = frame.actual.iter().map(|&id| u64::from(id) + 7).collect();
        let count = frame.actual.len();
        frame.distance_m = (0..count * count).map(|place| if place % (count + 1) == 0 { 0.0 } else { 3.0 }).collect();
    }
    let all = |frames: &[Frame]| {
        let (clear, identity, hota) = (ClearMot::of(frames, 1.0).0, Identity::of(frames, 1.0), Hota::of(frames, 2.0));
        [clear.mota(), identity.idf1(), hota.hota(), hota.detection(), hota.association()]
    };
    assert_eq!(all(&frames).map(|value| (value.unwrap() * 1e12).round() / 1e12), [1.0; 5]);
    for frame in &mut frames {
        (frame.claimed, frame.distance_m) = Default::default();
    }
    assert_eq!(all(&frames), [Some(0.0); 5]);
    assert_eq!(all(&[]), [None; 5]);
}

#[test]
fn scores_of_scenes_add_up() {
    let (one, other) = (sequence(2), sequence(3));
    let mut clear = ClearMot::of(&one, 1.0).0;
    clear.add(&ClearMot::of(&other, 1.0).0);
    assert_eq!(clear.objects, 87 + 27);
    assert!((clear.mota().unwrap() - (1.0 - f64::from(14 + 16 + 17 + 7 + 8 + 7) / 114.0)).abs() < 1e-12);
    // The same twice is the same.
    let once = Hota::of(&one, 2.0);
    let mut twice = once;
    twice.add(&once);
    assert!((twice.hota().unwrap() - once.hota().unwrap()).abs() < 1e-12);
}
