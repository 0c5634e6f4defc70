//! One body before a simulated sensor.

use messages::{Clusters, Part, Sweep, Truth, Verdict};
use simulator::{Motion, Obstacle, SceneFile, Shape, Simulator};
use stage::Stage;
use zerocopy::FromZeros;

use super::*;
use crate::fit::Bundle;

const SENSOR: &str = include_str!("../../../../../config/sensors/hdl-32e.toml");

/// A simulated HDL-32E of 2,170 columns, and the clusterer behind it.
pub(crate) struct Stand {
    simulator: Simulator,
    clusterer: clusterer::Clusterer,
    sweep: Box<Sweep>,
    truth: Box<Truth>,
    clusters: Box<Clusters>,
    bundle: Bundle,
    looks: u64,
}

impl Stand {
    /// Ranges with normal noise of this standard deviation [m], never rounded.
    pub(crate) fn new(range_sigma_m: f64) -> Self {
        let file: SceneFile = toml::from_str(&format!(
            "sensor = \"hdl-32e\"\nrotation_hz = 10.0\nrange_sigma_m = {range_sigma_m:?}\ndropout = 0.0\n\
             quantised = false\nseed = 1\nhorizon_m = 200.0\n"
        ))
        .unwrap();
        let sensor: lidar::SensorFile = toml::from_str(SENSOR).unwrap();
        let scene = file.checked(&sensor.checked().unwrap(), &std::collections::BTreeMap::new()).unwrap();
        let params = clusterer::Params { range_d_m: 1.0, method: clusterer::Method::Auto, min_points: 5 };
        Self {
            simulator: Simulator::new(scene),
            clusterer: clusterer::Clusterer::init(params).unwrap(),
            sweep: Sweep::new_box_zeroed().unwrap(),
            truth: Truth::new_box_zeroed().unwrap(),
            clusters: Clusters::new_box_zeroed().unwrap(),
            bundle: Bundle::new(lidar::MAX_RETURNS, messages::MAX_CELLS),
            looks: 0,
        }
    }

    /// Clusters of a sweep with this body alone; each look has noise of its own.
    pub(crate) fn look(&mut self, kind: Kind, body: &Body) -> &Clusters {
        let attitude = nalgebra::UnitQuaternion::from_matrix(&body.rotation);
        let obstacle = Obstacle {
            body: simulator::Body::Solid { shape: Shape::ALL[kind as usize], size_m: body.ln_half.map(f64::exp) * 2.0 },
            motion: Motion::at_rest(body.centre_m, attitude),
            albedo: 0.5,
        };
        self.simulator.show(vec![obstacle]).unwrap();
        self.simulator.sweep(self.looks, &mut self.sweep, &mut self.truth);
        self.looks += 1;
        messages::Message::clear(&mut *self.clusters);
        let part = Part { sectors: 1, ..Part::default() };
        assert_eq!(self.clusterer.process(part, &self.sweep, &mut self.clusters), Verdict::Complete);
        &self.clusters
    }

    /// The rays of the largest cluster of a look; none where nothing was seen.
    pub(crate) fn rays(&mut self, kind: Kind, body: &Body) -> Option<&Bundle> {
        self.look(kind, body);
        let cluster = self.clusters.clusters.iter().max_by_key(|cluster| cluster.summary.points)?;
        let returns = &self.clusters.returns[cluster.summary.member_places()];
        self.bundle.take(&self.clusters, cluster, returns);
        Some(&self.bundle)
    }
}
