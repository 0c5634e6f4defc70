//! The chain's rooms without processes: what the chain would find in simulated sweeps.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test file uses what it needs, and may panic")]

use std::collections::BTreeMap;

use classifier::{Classifier, ModelFiles};
use clusterer::Clusterer;
use extractor::Extractor;
use lidar::SensorFile;
use messages::{Clusters, Descriptors, Detections, Hop, Message, Part, Sweep, Trace};
use simulator::{SceneFile, Simulator};
use stage::Stage;
use zerocopy::FromZeros;

/// The default scene.
pub fn scene() -> Simulator {
    let file: SceneFile = toml::from_str(include_str!("../../../../config/scenes/default.toml")).unwrap();
    let sensor: SensorFile = toml::from_str(include_str!("../../../../config/sensors/hdl-32e.toml")).unwrap();
    Simulator::new(file.checked(&sensor.checked().unwrap(), &BTreeMap::new()).unwrap())
}

/// Clusterer, extractor and classifier in a row.
pub struct Rooms {
    clusterer: Clusterer,
    extractor: Extractor,
    classifier: Classifier,
    clusters: Box<Clusters>,
    descriptors: Box<Descriptors>,
    pub detections: Box<Detections>,
}

impl Rooms {
    pub fn new() -> Self {
        fn init<S: Stage>(text: &str, complete: impl FnOnce(&mut S::Params)) -> S {
            let mut params = toml::from_str(text).unwrap();
            complete(&mut params);
            S::init(params).unwrap()
        }
        Self {
            clusterer: init(include_str!("../../../../config/stages/clusterer.toml"), |_| ()),
            extractor: init(include_str!("../../../../config/stages/extractor.toml"), |_| ()),
            classifier: init::<Classifier>(include_str!("../../../../config/stages/classifier.toml"), |params| {
                params.overload = None;
                let card = include_str!("../../../../config/models/solids/card.toml").to_owned();
                params.files =
                    Some(ModelFiles { card, model: include_str!("../../../../config/models/solids/model.txt").into() });
            }),
            clusters: Clusters::new_box_zeroed().unwrap(),
            descriptors: Descriptors::new_box_zeroed().unwrap(),
            detections: Detections::new_box_zeroed().unwrap(),
        }
    }

    pub fn process(&mut self, number: u64, sweep: &Sweep) {
        let part = Part { ordinal: number, sweep: number, sectors: 1, ..Part::default() };
        self.clusters.clear();
        self.descriptors.clear();
        self.detections.clear();
        self.clusterer.process(part, sweep, &mut self.clusters);
        self.extractor.process(part, &self.clusters, &mut self.descriptors);
        self.classifier.process(part, &self.descriptors, &mut self.detections);
    }
}

/// A trace with this latency.
pub fn trace(sweep: u64, latency_ns: u64) -> Trace {
    let part = Part { ordinal: sweep, sweep, sectors: 1, ..Part::default() };
    let mut trace = Trace { part, due_ns: 1_000_000, ..Trace::default() };
    for hop in 1..4 {
        trace.push(Hop { finished_ns: 1_000_000 + latency_ns * hop / 3, stage: hop as u16, ..Hop::default() });
    }
    trace
}
