//! Sensors, scenes and sweeps for the tests.

#![allow(clippy::unwrap_used, dead_code, reason = "test set-up; not every file uses all of it")]

use std::collections::BTreeMap;

use lidar::{SensorFile, SensorModel};
use messages::{Sweep, Truth};
use simulator::{Scene, SceneFile, Simulator};
use zerocopy::FromZeros;

pub(crate) fn config(path: &str) -> String {
    let path = format!("{}/../../config/{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

pub(crate) fn sensor(name: &str) -> SensorModel {
    let file: SensorFile = toml::from_str(&config(&format!("sensors/{name}.toml"))).unwrap();
    file.checked().unwrap()
}

/// The scene of this text, with the sensor it names and the meshes it asks for.
pub(crate) fn scene(text: &str) -> Scene {
    let file: SceneFile = toml::from_str(text).unwrap();
    let texts: BTreeMap<String, String> =
        file.mesh_paths().into_iter().map(|path| (path.to_owned(), config(&format!("scenes/{path}")))).collect();
    let sensor = sensor(&file.sensor);
    file.checked(&sensor, &texts).unwrap()
}

pub(crate) fn simulator(text: &str) -> Simulator {
    Simulator::new(scene(text))
}

/// Sweep `number` of a scene.
pub(crate) fn sweep_of(simulator: &mut Simulator, number: u64) -> (Box<Sweep>, Box<Truth>) {
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    simulator.sweep(number, &mut sweep, &mut truth);
    (sweep, truth)
}

/// All that a sweep and its truth say.
pub(crate) fn bytes_of(sweep: &Sweep, truth: &Truth) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(format!("{:?} {:?}", sweep.header, truth.objects).as_bytes());
    bytes.extend_from_slice(sweep.rings.item_bytes());
    bytes.extend_from_slice(sweep.columns.item_bytes());
    bytes.extend_from_slice(sweep.returns.item_bytes());
    bytes.extend_from_slice(truth.owners.item_bytes());
    bytes
}

/// The keys of a scene that a test does not care for: exact ranges, no dropouts.
pub(crate) fn exact(sensor: &str) -> String {
    format!(
        "sensor = \"{sensor}\"\nrotation_hz = 10.0\nrange_sigma_m = 0.0\nreach_m = [0.1, 120.0]\ndropout = 0.0\n\
         quantised = false\nseed = 1\nhorizon_m = 200.0\n"
    )
}

/// One solid, written.
pub(crate) fn obstacle(shape: &str, size: [f64; 3], position: [f64; 3], velocity: [f64; 3], spin: [f64; 3]) -> String {
    format!(
        "[[obstacle]]\nshape = \"{shape}\"\nsize_m = {size:?}\nposition_m = {position:?}\n\
         attitude_deg = [10.0, 20.0, 30.0]\nvelocity_mps = {velocity:?}\nspin_dps = {spin:?}\nalbedo = 0.5\n"
    )
}

pub(crate) const REST: [f64; 3] = [0.0; 3];
