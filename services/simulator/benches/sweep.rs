//! One sweep of 69,440 rays (HDL-32E at 10 Hz): 60 obstacles of the reference distribution, at rest and in motion, and
//! scenes as shipped.

#![expect(clippy::unwrap_used, reason = "a bench that cannot be set up shall stop")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use lidar::{SensorFile, SensorModel};
use messages::{Sweep, Truth};
use simulator::{SceneFile, Simulator};
use zerocopy::FromZeros;

fn hdl_32e() -> SensorModel {
    let file: SensorFile = toml::from_str(include_str!("../../../config/sensors/hdl-32e.toml")).unwrap();
    file.checked().unwrap()
}

fn sixty(text: &str) -> SceneFile {
    let mut file: SceneFile = toml::from_str(text).unwrap();
    file.sensor = "hdl-32e".to_owned();
    file.field[0].count = 60;
    file
}

fn sweeps(c: &mut Criterion) {
    let mut moving = sixty(include_str!("../../../config/scenes/reference.toml"));
    moving.field[0].velocity_sigma_mps = [0.5, 0.5, 0.1];
    moving.field[0].spin_dps = [5.0, 60.0];
    let scenes = [
        ("reference_60_at_rest", sixty(include_str!("../../../config/scenes/reference.toml"))),
        ("reference_60_moving", moving),
        ("ring_crossing_60", sixty(include_str!("../../../config/scenes/ring-crossing.toml"))),
    ];
    let shipped = |text| toml::from_str(text).unwrap();
    let scenes = scenes.into_iter().chain([
        ("default", shipped(include_str!("../../../config/scenes/default.toml"))),
        ("spacecraft", shipped(include_str!("../../../config/scenes/spacecraft.toml"))),
    ]);
    let satellite = include_str!("../../../config/scenes/meshes/satellite.obj").to_owned();
    let meshes = [("meshes/satellite.obj".to_owned(), satellite)].into();
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    let mut truth = Truth::new_box_zeroed().unwrap();
    for (name, file) in scenes {
        let mut simulator = Simulator::new(file.checked(&hdl_32e(), &meshes).unwrap());
        let mut number = 0;
        c.bench_function(name, |b| {
            b.iter(|| {
                simulator.sweep(number, &mut sweep, &mut truth);
                number = (number + 1) % 100;
                black_box(sweep.returns.len())
            });
        });
    }
}

criterion_group!(benches, sweeps);
criterion_main!(benches);
