//! One body before a simulated sensor, or a scene of many.

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
        Self {
            simulator: Simulator::new(scene),
            clusterer: clusterer(),
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

/// A scene of `config/scenes/reference-tumbling.toml`, with a seed of its own, and the clusterer behind it.
pub(crate) struct Field {
    simulator: Simulator,
    clusterer: clusterer::Clusterer,
    sweep: Box<Sweep>,
    truth: Box<Truth>,
    clusters: Box<Clusters>,
    bundle: Bundle,
}

/// A cluster of a scene, nine in ten of whose returns lie on one body.
pub(crate) struct Known<'a> {
    pub(crate) kind: Kind,
    /// The body when its last return was taken.
    pub(crate) body: Body,
    pub(crate) points: usize,
    pub(crate) rays: &'a Bundle,
}

impl Field {
    pub(crate) fn new(seed: u64) -> Self {
        let mut file: SceneFile =
            toml::from_str(include_str!("../../../../../config/scenes/reference-tumbling.toml")).unwrap();
        file.seed = seed;
        let sensor: lidar::SensorFile =
            toml::from_str(include_str!("../../../../../config/sensors/hdl-32e-paper.toml")).unwrap();
        let scene = file.checked(&sensor.checked().unwrap(), &std::collections::BTreeMap::new()).unwrap();
        Self {
            simulator: Simulator::new(scene),
            clusterer: clusterer(),
            sweep: Sweep::new_box_zeroed().unwrap(),
            truth: Truth::new_box_zeroed().unwrap(),
            clusters: Clusters::new_box_zeroed().unwrap(),
            bundle: Bundle::new(lidar::MAX_RETURNS, messages::MAX_CELLS),
        }
    }

    /// Shows each cluster of a sweep that can be fitted, with what it is of.
    pub(crate) fn show(&mut self, sweep: u64, mut to: impl FnMut(&Known<'_>)) {
        self.simulator.sweep(sweep, &mut self.sweep, &mut self.truth);
        messages::Message::clear(&mut *self.clusters);
        let part = Part { sectors: 1, ..Part::default() };
        assert_eq!(self.clusterer.process(part, &self.sweep, &mut self.clusters), Verdict::Complete);
        for cluster in &self.clusters.clusters {
            let places = cluster.summary.member_places();
            let owners =
                || self.clusters.members[places.clone()].iter().map(|&member| self.truth.owners[member as usize]);
            let owner = owners().next().unwrap();
            let own = owners().filter(|&other| other == owner).count();
            let points = places.len();
            if points < messages::MIN_FEATURE_POINTS || own * 10 < points * 9 {
                continue;
            }
            self.bundle.take(&self.clusters, cluster, &self.clusters.returns[places.clone()]);
            let object = self.truth.objects[usize::from(owner)];
            let body = body_of(&object, f64::from(cluster.summary.last_offset_ns) * 1e-9);
            to(&Known { kind: Kind::ALL[object.kind as usize], body, points, rays: &self.bundle });
        }
    }
}

/// An obstacle so long after its sweep began.
fn body_of(object: &messages::TruthObject, after_s: f64) -> Body {
    let vector = |components: [f32; 3]| V::from(components.map(f64::from));
    let [w, i, j, k] = object.attitude_wxyz.map(f64::from);
    let attitude = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
    Body {
        centre_m: vector(object.centre_m) + vector(object.velocity_mps) * after_s,
        rotation: (Rotation3::new(vector(object.spin_radps) * after_s) * attitude.to_rotation_matrix()).into_inner(),
        ln_half: vector(object.size_m).map(|size_m| (0.5 * size_m).ln()),
    }
}

fn clusterer() -> clusterer::Clusterer {
    let params = clusterer::Params { range_d_m: 1.0, method: clusterer::Method::Auto, min_points: 5 };
    clusterer::Clusterer::init(params).unwrap()
}
