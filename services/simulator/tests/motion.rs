//! Obstacles are seen where they are when each ray reaches them.

mod common;

use common::{exact, obstacle, simulator, sweep_of};
use nalgebra::{UnitQuaternion, Vector3};
use simulator::{Motion, Pose};

/// How far a point of the body frame is off the surface of a solid, as a share of its half extents; positive outside.
fn off_surface(shape: &str, point: Vector3<f64>, half: Vector3<f64>) -> f64 {
    let p = point.component_div(&half);
    match shape {
        "box" => p.amax() - 1.0,
        "ellipsoid" => p.norm() - 1.0,
        "cylinder" => (p.xy().norm() - 1.0).max(p.z.abs() - 1.0),
        _ => (p.xy().norm() - 0.5 * (1.0 - p.z)).max(-1.0 - p.z),
    }
}

/// Largest distance of a return from its obstacle's surface [half extents], with the obstacle where `pose` says.
fn worst(shape: &str, sensor: &str, pose: impl Fn(&Motion, f64) -> Pose) -> f64 {
    let text =
        exact(sensor) + &obstacle(shape, [3.0, 3.0, 5.0], [9.0, -4.0, 0.5], [-3.0, 12.0, 1.0], [90.0, -120.0, 60.0]);
    let mut simulator = simulator(&text);
    let motion = simulator.scene().obstacles()[0].motion.clone();
    let mut worst: f64 = 0.0;
    let mut returns = 0;
    for number in [0, 2, 5] {
        let (sweep, _) = sweep_of(&mut simulator, number);
        for r in &sweep.returns {
            let column = sweep.columns[usize::from(r.column)];
            let ring = sweep.rings[usize::from(r.ring)];
            let time_ns = sweep.header.sensor_time_ns + u64::from(column.offset_ns + ring.offset_ns);
            let Pose { position_m, attitude } = pose(&motion, time_ns as f64 * 1e-9);
            let point = Vector3::new(r.x, r.y, r.z).cast::<f64>();
            let body = attitude.inverse() * (point - position_m);
            worst = worst.max(off_surface(shape, body, Vector3::new(1.5, 1.5, 2.5)).abs());
            returns += 1;
        }
    }
    assert!(returns > 500, "{returns}");
    worst
}

// verifies SIM-010
#[test]
fn each_return_lies_on_its_obstacle_at_its_own_firing_time() {
    for sensor in ["hdl-32e", "hdl-32e-paper"] {
        for shape in ["box", "ellipsoid", "cylinder", "cone"] {
            let found = worst(shape, sensor, |motion, time_s| motion.pose(time_s, 200.0));
            // 5e-6 of 1.5 m: 8 µm, the rounding of positions to single precision.
            assert!(found < 5e-6, "{shape} {sensor}: {found}");
        }
    }
}

// verifies SIM-019
#[test]
fn each_return_lies_on_its_obstacle_when_the_sensor_itself_drifts_and_turns_as_the_header_says() {
    let ego = "[ego]\nvelocity_mps = [2.0, 1.0, -0.5]\nspin_dps = [4.0, -9.0, 25.0]\n";
    let [position, velocity, spin] = [[9.0, -4.0, 0.5], [-1.0, 13.0, 0.5], [90.0, -120.0, 60.0]];
    let text = exact("hdl-32e") + ego + &obstacle("box", [3.0, 3.0, 5.0], position, velocity, spin);
    let still = exact("hdl-32e") + &obstacle("box", [3.0, 3.0, 5.0], position, velocity, spin);
    let inertial = simulator(&still).scene().obstacles()[0].motion.clone();
    let mut simulator = simulator(&text);
    let (mut worst, mut returns) = (0.0_f64, 0);
    for number in [0, 2, 5] {
        let (sweep, truth) = sweep_of(&mut simulator, number);
        let known = sweep.header.ego.get().unwrap();
        let [w, x, y, z] = known.attitude_wxyz;
        let to_inertial = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let [place, speed, turn] = [known.position_m, known.velocity_mps, known.spin_radps].map(Vector3::from);
        for r in &sweep.returns {
            let column = sweep.columns[usize::from(r.column)];
            let ring = sweep.rings[usize::from(r.ring)];
            let after_s = f64::from(column.offset_ns + ring.offset_ns) * 1e-9;
            let axes = UnitQuaternion::from_scaled_axis(turn * after_s) * to_inertial;
            let point = place + speed * after_s + axes * Vector3::new(r.x, r.y, r.z).cast::<f64>();
            let pose = inertial.pose(sweep.header.sensor_time_ns as f64 * 1e-9 + after_s, 1e6);
            let body = pose.attitude.inverse() * (point - pose.position_m);
            worst = worst.max(off_surface("box", body, Vector3::new(1.5, 1.5, 2.5)).abs());
            returns += 1;
        }
        // What the truth says is relative to the sensor, along its axes.
        let truth = truth.objects[0];
        let pose = inertial.pose(sweep.header.sensor_time_ns as f64 * 1e-9, 1e6);
        let centre = to_inertial.inverse() * (pose.position_m - place);
        assert!((Vector3::from(truth.centre_m).cast::<f64>() - centre).norm() < 1e-5);
        let relative = to_inertial.inverse() * (inertial.velocity_mps - speed);
        assert!((Vector3::from(truth.velocity_mps).cast::<f64>() - relative).norm() < 1e-5);
    }
    assert!(returns > 500, "{returns}");
    // Positions are rounded to single precision, and tens of metres away by now.
    assert!(worst < 2e-5, "{worst}");
}

// verifies SIM-010
#[test]
fn a_wrong_time_or_attitude_would_show() {
    let late = worst("box", "hdl-32e", |motion, time_s| motion.pose(time_s + 50e-6, 200.0));
    assert!(late > 1e-4, "{late}");
    let frozen = worst("box", "hdl-32e", |motion, time_s| Pose {
        attitude: motion.pose(0.0, 200.0).attitude,
        ..motion.pose(time_s, 200.0)
    });
    assert!(frozen > 1e-2, "{frozen}");
}

// verifies SIM-011
#[test]
fn an_obstacle_that_leaves_the_horizon_comes_in_where_its_path_entered() {
    let motion = Motion {
        position_m: Vector3::new(3.0, 4.0, 0.0),
        attitude: UnitQuaternion::identity(),
        velocity_mps: Vector3::new(2.0, 0.0, 0.0),
        spin_radps: Vector3::zeros(),
    };
    // The path is the chord y = 4 of a circle of 5 m: from x = −3 to x = 3.
    let at = |time_s: f64| motion.pose(time_s, 5.0 + 1e-12).position_m;
    assert!((at(0.0) - Vector3::new(3.0, 4.0, 0.0)).norm() < 1e-9);
    assert!((at(1.0) - Vector3::new(-1.0, 4.0, 0.0)).norm() < 1e-6);
    assert!((at(3.5) - Vector3::new(-2.0, 4.0, 0.0)).norm() < 1e-6);
    for step in 0..10_000 {
        let position = at(f64::from(step) * 0.37);
        assert!(position.norm() <= 5.0 + 1e-6, "{position} at step {step}");
        assert!((position.y - 4.0).abs() < 1e-9);
    }
    assert_eq!(motion.closest_approach_m(), 4.0);

    // From the middle of the chord: it leaves after 1.5 s.
    let from_middle = Motion { position_m: Vector3::new(0.0, 4.0, 0.0), ..motion };
    let at = |time_s: f64| from_middle.pose(time_s, 5.0).position_m.x;
    assert_eq!([at(0.0), at(1.0), at(1.5), at(2.0), at(3.0)], [0.0, 2.0, -3.0, -2.0, 0.0]);
}

// verifies SIM-011
#[test]
fn a_drifting_field_stays_inhabited_and_keeps_clear_of_the_sensor() {
    let clear_m = 2.0; // in both scenes
    for (scene, obstacles) in [("default", 40), ("ring-crossing", 60)] {
        let mut simulator = simulator(&common::config(&format!("scenes/{scene}.toml")));
        for number in (0..6_000).step_by(250) {
            let (sweep, truth) = sweep_of(&mut simulator, number);
            assert!(sweep.returns.len() > 1_500, "{scene}, sweep {number}: {}", sweep.returns.len());
            assert_eq!(truth.objects.len(), obstacles);
            let nearest_m = sweep.returns.iter().map(|r| f64::from(r.range_m())).fold(f64::INFINITY, f64::min);
            assert!(nearest_m > clear_m - 0.1, "{scene}, sweep {number}: {nearest_m}");
        }
    }
}
