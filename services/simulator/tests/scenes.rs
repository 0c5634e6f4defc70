//! Scenes: what is refused, what each key does, what a field promises.

mod common;

use std::collections::BTreeMap;

use common::{bytes_of, config, sensor, simulator, sweep_of};
use lidar::ObstacleClass;
use simulator::{Body, SceneFile};

const WRITTEN: &str = r#"
sensor = "hdl-32e"
rotation_hz = 10.0
range_sigma_m = 0.02
reach_m = [1.0, 100.0]
dropout = 0.01
quantised = true
seed = 5
horizon_m = 40.0

[[obstacle]]
shape = "cylinder"
size_m = [2.0, 2.0, 3.0]
position_m = [6.0, -2.0, 0.0]
attitude_wxyz = [1.0, 0.5, 0.0, 0.0]
velocity_mps = [0.1, 0.0, 0.0]
spin_dps = [0.0, 10.0, 0.0]
albedo = 0.7

[[mesh]]
path = "meshes/satellite.obj"
unit_m = 0.5
position_m = [-5.0, 2.0, 0.0]
attitude_deg = [20.0, 0.0, 0.0]
velocity_mps = [0.0, 0.2, 0.0]
spin_dps = [0.0, 0.0, 5.0]
albedo = 0.6

[[field]]
shapes = ["box", "ellipsoid"]
count = 20
half_extent_m = [0.3, 1.5]
proportion = [0.5, 1.0]
ring_m = [4.0, 20.0]
half_height_m = 1.0
spacing_m = 0.5
clear_m = 1.0
velocity_mps = [0.0, 0.0, 0.0]
velocity_sigma_mps = [0.3, 0.3, 0.0]
spin_dps = [5.0, 20.0]
albedo = [0.3, 0.9]
"#;

fn check(text: &str) -> Result<simulator::Scene, String> {
    let file: SceneFile = toml::from_str(text).map_err(|error| error.to_string())?;
    let texts = BTreeMap::from([("meshes/satellite.obj".to_owned(), config("scenes/meshes/satellite.obj"))]);
    file.checked(&sensor("hdl-32e"), &texts).map_err(|error| error.to_string())
}

/// `WRITTEN` with `line` in place of the `nth` (from 0) line of the same key; taken out where `line` is only a key.
fn with(nth: usize, line: &str) -> String {
    let key = line.split(" =").next().unwrap_or_default();
    let mut seen = 0;
    let lines = WRITTEN.lines().map(|old| {
        if old.split(" =").next().unwrap_or_default() == key && old.contains(" =") {
            seen += 1;
            if seen == nth + 1 {
                return if line.contains(" =") { line } else { "" };
            }
        }
        old
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    assert!(seen > nth, "no {nth}th {key}");
    text
}

// verifies SIM-014
#[test]
fn each_broken_key_is_refused_by_name_with_both_sides() {
    assert!(check(WRITTEN).is_ok());
    for (nth, line, expected) in [
        (0, "sensor = \"vlp-16\"", "sensor is vlp-16, must be the sensor in use: hdl-32e"),
        (0, "rotation_hz = 21.0", "rotation_hz is 21, must be within [4.975, 20.1]"),
        (0, "rotation_hz = nan", "rotation_hz is NaN, must be within"),
        (0, "range_sigma_m = -0.1", "range_sigma_m is -0.1, must be within [0, 10]"),
        (0, "reach_m = [5.0, 2.0]", "reach_m[1] is 2, must be at least 5"),
        (0, "reach_m = [1.0, 200.0]", "reach_m[1] is 200, must be within [0, 131.07]"),
        (0, "dropout = 1.5", "dropout is 1.5, must be within [0, 1]"),
        (0, "position_m = [46.0, -2.0, 0.0]", "horizon_m is 40, must be more than 46.04"),
        (0, "horizon_m = 10.0", "ring_m[1] is 20, must be such that the field lies within horizon_m, 10"),
        (0, "size_m = [2.0, 2.0, 0.0]", "obstacle[0].size_m[2] is 0, must be within (0, 10000]"),
        (0, "size_m = [2.0, 2.1, 3.0]", "obstacle[0].size_m[1] is 2.1, must be equal to size_m[0]"),
        (0, "position_m = [inf, 0.0, 0.0]", "obstacle[0].position_m[0] is inf"),
        (0, "attitude_wxyz = [0.0, 0.0, 0.0, 0.0]", "obstacle[0] gives an attitude_wxyz that is no rotation"),
        (0, "attitude_wxyz", "obstacle[0] gives none, must give one of attitude_wxyz"),
        (0, "velocity_mps = [0.0, 2000.0, 0.0]", "obstacle[0].velocity_mps[1] is 2000"),
        (0, "spin_dps = [0.0, 0.0, 361.0]", "obstacle[0].spin_dps[2] is 361, must be within [-360, 360]"),
        (0, "albedo = 0.0", "obstacle[0].albedo is 0, must be within (0, 1]"),
        (0, "path = \"other.obj\"", "mesh[0].path is other.obj, must be one of the files given"),
        (0, "unit_m = -1.0", "mesh[0].unit_m is -1"),
        (0, "attitude_deg = [400.0, 0.0, 0.0]", "mesh[0].attitude_deg[0] is 400"),
        (0, "shapes = []", "field[0].shapes is empty, must name at least one"),
        (0, "shapes = [\"torus\"]", "torus"),
        (0, "count = 0", "field[0].count is 0, must be within [1, 1024]"),
        (0, "count = 1023", "field[0].count is 1023, must be at most about"),
        (0, "half_extent_m = [0.0, 1.0]", "field[0].half_extent_m[0] is 0"),
        (0, "proportion = [0.9, 0.5]", "field[0].proportion[1] is 0.5, must be at least 0.9"),
        (0, "ring_m = [-1.0, 20.0]", "field[0].ring_m[0] is -1"),
        (0, "half_height_m = -1.0", "field[0].half_height_m is -1"),
        (0, "spacing_m = -1.0", "field[0].spacing_m is -1"),
        (0, "spacing_m = 30.0", "field[0].count is 20, must be at most about"),
        (0, "clear_m = -1.0", "field[0].clear_m is -1"),
        (2, "velocity_mps = [nan, 0.0, 0.0]", "field[0].velocity_mps[0] is NaN"),
        (0, "velocity_sigma_mps = [-1.0, 0.0, 0.0]", "field[0].velocity_sigma_mps[0] is -1"),
        (2, "spin_dps = [0.0, 400.0]", "field[0].spin_dps[1] is 400"),
        (2, "albedo = [0.5, 1.5]", "field[0].albedo[1] is 1.5"),
        (0, "dropout", "missing field `dropout`"),
        (0, "dropout = 0.0\ndropouts = 0.0", "unknown field `dropouts`"),
    ] {
        let refused = check(&with(nth, line)).err().unwrap_or_else(|| panic!("{line} was taken"));
        assert!(refused.contains(expected), "{line}: {refused}");
    }
}

// verifies SIM-014
#[test]
fn both_attitudes_at_once_are_refused() {
    let text = with(0, "attitude_wxyz = [1.0, 0.0, 0.0, 0.0]\nattitude_deg = [0.0, 0.0, 0.0]");
    assert!(check(&text).unwrap_err().contains("obstacle[0] gives both, must give one"));
}

// verifies SIM-014
#[test]
fn a_turn_that_no_message_can_carry_is_refused() {
    let wide = config("sensors/hdl-32e.toml").replace("rotation_hz = [5.0, 20.0]", "rotation_hz = [1.0, 20.0]");
    let wide: lidar::SensorFile = toml::from_str(&wide).unwrap();
    let mut file: SceneFile = toml::from_str(&common::exact("hdl-32e")).unwrap();
    file.rotation_hz = 4.0;
    let refused = file.checked(&wide.checked().unwrap(), &BTreeMap::new()).unwrap_err().to_string();
    assert!(refused.contains("rotation_hz gives 5425 columns of 32 rings"), "{refused}");
}

// verifies SIM-015
#[test]
fn each_key_changes_what_is_seen() {
    let seen = |text: &str| {
        let mut simulator = simulator::Simulator::new(check(text).unwrap());
        let mut bytes = Vec::new();
        for number in [0, 700] {
            let (sweep, truth) = sweep_of(&mut simulator, number);
            bytes.extend(bytes_of(&sweep, &truth));
        }
        bytes
    };
    let unchanged = seen(WRITTEN);
    for (nth, line) in [
        (0, "rotation_hz = 12.0"),
        (0, "range_sigma_m = 0.03"),
        (0, "range_sigma_m"), // taken out: the sensor file says the same
        (0, "reach_m = [1.0, 10.0]"),
        (0, "dropout = 0.02"),
        (0, "quantised = false"),
        (0, "seed = 6"),
        (0, "horizon_m = 30.0"),
        (0, "shape = \"cone\""),
        (0, "size_m = [2.0, 2.0, 3.1]"),
        (0, "position_m = [6.0, -2.1, 0.0]"),
        (0, "attitude_wxyz = [1.0, 0.6, 0.0, 0.0]"),
        (0, "velocity_mps = [0.2, 0.0, 0.0]"),
        (0, "spin_dps = [0.0, 11.0, 0.0]"),
        (0, "albedo = 0.8"),
        (0, "unit_m = 0.6"),
        (1, "position_m = [-5.0, 2.1, 0.0]"),
        (0, "attitude_deg = [21.0, 0.0, 0.0]"),
        (1, "velocity_mps = [0.0, 0.3, 0.0]"),
        (1, "spin_dps = [0.0, 0.0, 6.0]"),
        (1, "albedo = 0.5"),
        (0, "shapes = [\"box\"]"),
        (0, "count = 21"),
        (0, "half_extent_m = [0.2, 1.5]"),
        (0, "proportion = [0.4, 1.0]"),
        (0, "ring_m = [5.0, 20.0]"),
        (0, "half_height_m = 1.1"),
        (0, "spacing_m = 1.5"),
        (0, "clear_m = 3.0"),
        (2, "velocity_mps = [0.1, 0.0, 0.0]"),
        (0, "velocity_sigma_mps = [0.2, 0.3, 0.0]"),
        (2, "spin_dps = [5.0, 25.0]"),
        (2, "albedo = [0.2, 0.9]"),
    ] {
        let same = seen(&with(nth, line)) == unchanged;
        assert_eq!(same, line == "range_sigma_m", "{line}");
    }
}

// verifies SIM-016
#[test]
fn a_field_keeps_its_spacing_its_sizes_and_its_ring() {
    let text = config("scenes/reference.toml");
    for seed in 1..8 {
        let scene = common::scene(&text.replace("seed = 1\n", &format!("seed = {seed}\n")));
        let obstacles = scene.obstacles();
        assert_eq!(obstacles.len(), 40);
        for (index, one) in obstacles.iter().enumerate() {
            let position = one.motion.position_m;
            assert!((3.0..=25.0).contains(&position.xy().norm()) && position.z.abs() <= 1.5);
            assert!(position.norm() - one.body.bounding_radius_m() >= 1.5 - 1e-9);
            let size = one.body.size_m();
            assert!((0.7 - 1e-9..=4.4 + 1e-9).contains(&size.max()), "{size}");
            assert!(size.min() >= 0.4 * size.max() - 1e-9, "{size}");
            for other in &obstacles[..index] {
                let gap = (position - other.motion.position_m).norm()
                    - one.body.bounding_radius_m()
                    - other.body.bounding_radius_m();
                assert!(gap >= 1.0 - 1e-9, "{gap}");
            }
        }
    }
}

// verifies SIM-016
#[test]
fn draws_follow_the_reference_distribution() {
    use rand::SeedableRng;
    let scene = common::scene(&config("scenes/reference.toml"));
    let field = &scene.fields()[0];
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
    let n = 4_000;
    for &shape in field.shapes() {
        let drawn: Vec<_> = (0..n).map(|_| field.draw(shape, &mut rng)).collect();
        let share =
            |holds: &dyn Fn(&simulator::Obstacle) -> bool| drawn.iter().filter(|o| holds(o)).count() as f64 / n as f64;
        // Medians: √(0.35 · 2.2) m of the half extent, √((9 + 625)/2) m of the ring; 4 % is five standard errors.
        assert!((share(&|o| o.body.size_m().max() / 2.0 < 0.77_f64.sqrt()) - 0.5).abs() < 0.04);
        assert!((share(&|o| o.motion.position_m.xy().norm() < 317.0_f64.sqrt()) - 0.5).abs() < 0.04);
        // Any axis may be the largest; of a round solid, the diameter or the height.
        let largest = if shape.is_round() { 1.0 / 2.0 } else { 1.0 / 3.0 };
        assert!((share(&|o| o.body.size_m().z == o.body.size_m().max()) - largest).abs() < 0.04);
        // A body axis uniform on the sphere: its height uniform in [−1, 1].
        for axis in [nalgebra::Vector3::x(), nalgebra::Vector3::z()] {
            assert!((share(&|o| (o.motion.attitude * axis).z < 0.5) - 0.75).abs() < 0.04);
        }
        assert!(drawn.iter().all(|o| matches!(&o.body, Body::Solid { shape: s, .. } if *s == shape)));
        assert!(drawn.iter().all(|o| !shape.is_round() || o.body.size_m().x == o.body.size_m().y));
        assert_eq!(drawn[0].body.class(), shape.class());
    }
}

#[test]
fn scenes_of_one_shape_hold_that_shape_only_and_the_reference_holds_all_four() {
    let classes = |name: &str| {
        let (_, truth) = sweep_of(&mut simulator(&config(&format!("scenes/{name}.toml"))), 0);
        let mut classes: Vec<ObstacleClass> = truth.objects.iter().map(|object| object.class).collect();
        classes.sort();
        classes.dedup();
        classes
    };
    assert_eq!(classes("box"), [ObstacleClass::Rectangular]);
    assert_eq!(classes("ellipsoid"), [ObstacleClass::Ellipsoidal]);
    assert_eq!(classes("cylinder"), [ObstacleClass::Cylindrical]);
    assert_eq!(classes("cone"), [ObstacleClass::Conical]);
    assert_eq!(classes("reference"), ObstacleClass::SOLIDS);
}
