//! The stages themselves on sweeps that were spoiled: they answer every one, whatever it looks like.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;

use classifier::{Card, Classifier, ModelFiles};
use clusterer::Clusterer;
use extractor::Extractor;
use faults::{CATALOGUE, Corruptor, Fault};
use lidar::{MAX_RETURNS, Return, SensorFile};
use messages::{
    Clusters, Cutter, Descriptors, Detections, MAX_FITS, Message, Part, Refusal, Sweep, Tracks, Truth, Verdict,
};
use simulator::{SceneFile, Simulator};
use stage::Stage;
use tracker::Tracker;
use zerocopy::FromZeros;

fn config(path: &str) -> String {
    let path = format!("{}/../../config/{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Sweep `number` of the default scene, organised or not.
fn sweep(number: u64, organised: bool) -> (Box<Sweep>, Box<Truth>) {
    let file: SceneFile = toml::from_str(&config("scenes/default.toml")).unwrap();
    let sensor: SensorFile = toml::from_str(&config(&format!("sensors/{}.toml", file.sensor))).unwrap();
    let scene = file.checked(&sensor.checked().unwrap(), &BTreeMap::new()).unwrap();
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    Simulator::new(scene).sweep(number, &mut sweep, &mut truth);
    if !organised {
        sweep.rings.clear();
        sweep.columns.clear();
        (sweep.header.organised, sweep.header.column_step_rad) = (0, 0.0);
        sweep.returns.iter_mut().for_each(|r| (r.column, r.ring) = (0, 0));
    }
    (sweep, truth)
}

/// The faults that spoil what is in a sweep, with their levels.
fn contents() -> impl Iterator<Item = (Fault, u32)> {
    let elsewhere = [Fault::DuplicatedSweep, Fault::SkippedSweep, Fault::ReorderedSweeps, Fault::ClockStepped];
    let of_contents = CATALOGUE.iter().filter(move |e| e.fault.is_of_sweeps() && !elsewhere.contains(&e.fault));
    of_contents.flat_map(|entry| (1..=if entry.strength.is_some() { 3 } else { 1 }).map(|level| (entry.fault, level)))
}

/// A sweep of the default scene that a level of a fault has spoiled.
fn spoil(fault: Fault, level: u32, seed: u64, organised: bool) -> (Box<Sweep>, Box<Truth>) {
    let (mut sweep, mut truth) = sweep(3, organised);
    Corruptor::default().corrupt(fault, level, (seed, 0), &mut sweep, &mut truth);
    (sweep, truth)
}

fn bytes(sweep: &Sweep, truth: &Truth) -> Vec<u8> {
    let mut bytes = format!("{:?} {:?}", sweep.header, truth.objects).into_bytes();
    bytes.extend_from_slice(sweep.returns.item_bytes());
    bytes.extend_from_slice(truth.owners.item_bytes());
    bytes
}

// verifies FLT-004
#[test]
fn a_seed_decides_what_a_sweep_looks_like() {
    for (fault, level) in contents() {
        let made = |seed| {
            let (sweep, truth) = spoil(fault, level, seed, true);
            bytes(&sweep, &truth)
        };
        assert_eq!(made(1), made(1), "{}", fault.name());
        let is_random =
            !matches!(fault, Fault::EmptySweep | Fault::AllNan | Fault::DuplicatePoints | Fault::GiantCluster);
        assert_eq!(made(1) != made(2), is_random, "{}", fault.name());
    }
}

// verifies FLT-005
#[test]
fn what_comes_out_is_a_sweep_whose_parts_agree() {
    for organised in [true, false] {
        for (fault, level) in contents() {
            let name = fault.name();
            let (sweep, truth) = spoil(fault, level, 5, organised);
            let refused: u32 = sweep.header.refused.iter().sum();
            assert_eq!(sweep.header.recorded as usize, sweep.returns.len() + refused as usize, "{name}");
            assert_eq!(sweep.recorded_index.len(), if refused > 0 { sweep.returns.len() } else { 0 }, "{name}");
            assert_eq!(truth.owners.len(), if sweep.returns.is_empty() { 0 } else { sweep.returns.len() }, "{name}");
            for object in &truth.objects {
                let owned = truth.owners.iter().filter(|owner| **owner == object.id).count();
                assert_eq!(object.returns as usize, owned, "{name}");
            }
            if organised {
                assert!(sweep.returns.windows(2).all(|pair| pair[0].column <= pair[1].column), "{name}");
                let in_place =
                    |r: &Return| usize::from(r.ring) < sweep.rings.len() && usize::from(r.column) < sweep.columns.len();
                assert!(sweep.returns.iter().all(in_place), "{name}");
            } else {
                assert!(sweep.rings.is_empty() && sweep.columns.is_empty(), "{name}");
            }
        }
    }
}

// verifies FLT-006
#[test]
fn each_fault_does_what_it_says_and_a_higher_level_more() {
    let (whole, _) = sweep(3, true);
    let before = whole.returns.len() as f64;
    let share = |count: usize| count as f64 / before;
    let range_m = |r: &Return| f64::from(r.range_m());
    let at = |fault, level| spoil(fault, level, 9, true).0;
    let moved = |sweep: &Sweep| {
        let changed = |r: &&Return| !whole.returns.iter().any(|other| other == *r);
        sweep.returns.iter().filter(changed).count()
    };
    for (level, place) in [(1, 0), (2, 1), (3, 2)] {
        let within = |what: &str, is: f64, least: [f64; 3], most: [f64; 3]| {
            assert!((least[place]..most[place]).contains(&is), "{what} at level {level}: {is}");
        };
        let mut rings = [false; 64];
        at(Fault::BeamsMissing, level).returns.iter().for_each(|r| rings[usize::from(r.ring)] = true);
        let mut all = [false; 64];
        whole.returns.iter().for_each(|r| all[usize::from(r.ring)] = true);
        let lost = all.iter().zip(rings).filter(|(before, now)| **before && !now).count();
        assert!(lost <= [2, 8, 16][place] && lost >= [1, 3, 7][place], "{lost} beams lost at level {level}");

        within("crosstalk", share(moved(&at(Fault::Crosstalk, level))), [0.005, 0.03, 0.08], [0.015, 0.05, 0.12]);
        let dust = at(Fault::Dust, level);
        let near = dust.returns.iter().filter(|r| range_m(r) < 5.0).count();
        assert!(near > [20, 200, 500][place], "{near} grains at level {level}");
        let faint = at(Fault::IncompleteEcho, level).returns.len();
        within("echoes lost", 1.0 - share(faint), [0.04, 0.13, 0.27], [0.11, 0.32, 0.62]);
        let blurred = at(Fault::MotionBlur, level);
        let errors = blurred.returns.iter().zip(&whole.returns).map(|(now, then)| (range_m(now) - range_m(then)).abs());
        within("range error", errors.fold(0.0, f64::max), [0.015, 0.05, 0.13], [0.021, 0.061, 0.151]);
    }
    assert_eq!(at(Fault::EmptySweep, 1).returns.len(), 0);
    assert_eq!(at(Fault::OnePoint, 1).returns.len(), 1);
    assert!(at(Fault::AllNan, 1).returns.iter().all(|r| r.x.is_nan() && r.y.is_nan() && r.z.is_nan()));
    assert_eq!(at(Fault::DuplicatePoints, 1).returns.len(), 2 * whole.returns.len());
    assert_eq!(at(Fault::GiantCluster, 1).returns.len(), whole.rings.len() * whole.columns.len());
    let oversized = at(Fault::OversizedSweep, 1);
    assert_eq!(oversized.returns.len(), MAX_RETURNS);
    assert_eq!(oversized.header.refused[Refusal::OverCapacity as usize], 1, "one more was tried, and is counted");
}

/// The real stages, with the shipped parameters and models.
struct Chain {
    clusterer: Clusterer,
    extractor: Extractor,
    classifier: Classifier,
    tracker: Tracker,
    piece: Box<Sweep>,
    clusters: Box<Clusters>,
    descriptors: Box<Descriptors>,
    detections: Box<Detections>,
    tracks: Box<Tracks>,
}

impl Chain {
    fn new() -> Self {
        let mut params: classifier::Params = toml::from_str(&config("stages/classifier.toml")).unwrap();
        let files = |model: &str| {
            let card = config(&format!("models/{model}/card.toml"));
            let file = Card::parse(&card).unwrap().file;
            Some(ModelFiles { model: config(&format!("models/{model}/{file}")).into_bytes(), card })
        };
        params.files = files(&params.model);
        if let Some(overload) = &mut params.overload {
            overload.files = files(&overload.model);
        }
        Self {
            clusterer: Clusterer::init(toml::from_str(&config("stages/clusterer.toml")).unwrap()).unwrap(),
            extractor: Extractor::init(toml::from_str(&config("stages/extractor.toml")).unwrap()).unwrap(),
            classifier: Classifier::init(params).unwrap(),
            tracker: Tracker::init(toml::from_str(&config("stages/tracker.toml")).unwrap()).unwrap(),
            piece: Sweep::new_box_zeroed().unwrap(),
            clusters: Clusters::new_box_zeroed().unwrap(),
            descriptors: Descriptors::new_box_zeroed().unwrap(),
            detections: Detections::new_box_zeroed().unwrap(),
            tracks: Tracks::new_box_zeroed().unwrap(),
        }
    }

    /// The worst verdict of each stage; how many detections, and how many fits.
    fn answer(&mut self, number: u64, whole: &mut Sweep, sectors: u32) -> ([Verdict; 4], usize, usize) {
        let cutter = Cutter::new(sectors);
        cutter.measure(whole);
        let (mut worst, mut detections, mut fits) = ([Verdict::Complete; 4], 0, 0);
        for sector in 0..sectors {
            let part = Part {
                ordinal: number * u64::from(sectors) + u64::from(sector),
                sweep: number,
                sector,
                sectors,
                ..Part::default()
            };
            self.piece.clear();
            cutter.fill(whole, sector, &mut self.piece);
            self.clusters.clear();
            self.descriptors.clear();
            self.detections.clear();
            self.tracks.clear();
            let verdicts = [
                self.clusterer.process(part, &self.piece, &mut self.clusters),
                self.extractor.process(part, &self.clusters, &mut self.descriptors),
                self.classifier.process(part, &self.descriptors, &mut self.detections),
                self.tracker.process(part, &self.detections, &mut self.tracks),
            ];
            for (worst, verdict) in worst.iter_mut().zip(verdicts) {
                *worst = if verdict.is_rejected() { verdict } else { *worst };
            }
            let tracks = self.tracks.table.tracks.iter();
            let numbers = tracks.flat_map(|track| [track.position_m, track.velocity_mps].concat());
            assert!(numbers.into_iter().all(f32::is_finite), "sweep {number}");
            detections += self.detections.detections.len();
            fits += self.descriptors.fits.len();
        }
        (worst, detections, fits)
    }
}

// verifies FLT-007
#[test]
fn the_chain_answers_every_spoiled_sweep_and_the_next_one_as_ever() {
    let mut chain = Chain::new();
    let (mut plain, _) = sweep(4, true);
    let mut number = 0;
    for sectors in [1, 36] {
        let usual = chain.answer(number, &mut plain, sectors);
        number += 1;
        assert_eq!(usual.0, [Verdict::Complete; 4]);
        for organised in [true, false] {
            for (fault, level) in contents() {
                for seed in 0..2 {
                    let what =
                        format!("{} {level}, seed {seed}, {sectors} sectors, organised: {organised}", fault.name());
                    let (mut spoiled, _) = spoil(fault, level, seed, organised);
                    let (verdicts, detections, fits) = chain.answer(number, &mut spoiled, sectors);
                    number += 1;
                    if fault == Fault::AllNan {
                        assert_eq!(verdicts[0], Verdict::RejectedMalformed, "{what}");
                        assert_eq!(detections, 0, "{what}");
                    } else {
                        assert!(!verdicts.iter().any(|verdict| verdict.is_rejected()), "{what}: {verdicts:?}");
                        assert_eq!(detections == 0, spoiled.returns.is_empty(), "{what}");
                    }
                    // Each fit has a counted budget, so their number bounds the work. The cap is of a message.
                    assert!(fits <= MAX_FITS * sectors as usize && detections <= spoiled.returns.len(), "{what}");
                }
            }
        }
        assert_eq!(chain.answer(number, &mut plain, sectors), usual, "nothing is left of what was spoiled");
        number += 1;
    }
}

// verifies FLT-005
#[test]
fn a_recording_without_truth_stays_without() {
    let (mut sweep, mut truth) = sweep(0, true);
    truth.clear();
    Corruptor::default().corrupt(Fault::Dust, 3, (1, 1), &mut sweep, &mut truth);
    assert!(truth.owners.is_empty());
}
