//! What a sweep promises, whatever the scene.

mod common;

use common::{REST, bytes_of, config, exact, obstacle, scene, sensor, simulator, sweep_of};
use messages::{NO_OBJECT, Sweep, Truth};
use simulator::{SceneFile, Simulator};
use stage::{Next, Source};
use zerocopy::FromZeros;

const SCENES: [&str; 10] = [
    "default",
    "reference",
    "box",
    "ellipsoid",
    "cylinder",
    "cone",
    "ring-crossing",
    "spacecraft",
    "asteroid",
    "single",
];

fn shipped(name: &str) -> Simulator {
    simulator(&config(&format!("scenes/{name}.toml")))
}

// verifies SIM-001
#[test]
fn every_shipped_scene_gives_full_sweeps_in_firing_order() {
    for name in SCENES {
        let mut simulator = shipped(name);
        let lasers = simulator.scene().sensor().lasers().to_vec();
        let (sweep, truth) = sweep_of(&mut simulator, 3);
        assert!(sweep.returns.len() > if name == "single" { 5 } else { 1_000 }, "{name}: {}", sweep.returns.len());
        assert_eq!(sweep.header.recorded as usize, sweep.returns.len());
        assert_eq!((sweep.header.complete, sweep.header.organised), (1, 1));
        assert_eq!(sweep.header.sensor_time_ns, 3 * sweep.header.period_ns);
        assert_eq!(truth.sensor_time_ns, sweep.header.sensor_time_ns);
        assert!(sweep.recorded_index.is_empty());
        assert!(sweep.columns.iter().all(|column| column.valid == 1));
        let times: Vec<u64> = sweep
            .returns
            .iter()
            .map(|r| {
                let laser = lasers.iter().find(|laser| laser.ring == r.ring).unwrap();
                u64::from(sweep.columns[usize::from(r.column)].offset_ns) + u64::from(laser.offset_ns)
            })
            .collect();
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{name}: not in firing order");
        assert!(times.last().unwrap() < &sweep.header.period_ns);
        assert!(sweep.returns.iter().all(|r| r.intensity >= 1));
    }
}

// verifies SIM-002
#[test]
fn same_seed_same_bytes_and_another_seed_other_bytes() {
    let text = config("scenes/default.toml");
    let reseeded = text.replace("seed = 1\n", "seed = 2\n");
    let bytes = |text: &str| {
        let (sweep, truth) = sweep_of(&mut simulator(text), 5);
        bytes_of(&sweep, &truth)
    };
    assert!(bytes(&text) == bytes(&text));
    assert!(bytes(&text) != bytes(&reseeded));
}

// verifies SIM-002
#[test]
fn a_sweep_made_alone_is_the_one_made_in_sequence() {
    let mut in_sequence = shipped("ring-crossing");
    let mut alone = shipped("ring-crossing");
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    let mut seen = Vec::new();
    for _ in 0..8 {
        assert_eq!(in_sequence.next(&mut sweep, &mut truth).unwrap(), Next::Sweep);
        seen.push(bytes_of(&sweep, &truth));
    }
    for number in [7, 0, 3] {
        let (sweep, truth) = sweep_of(&mut alone, number);
        assert!(bytes_of(&sweep, &truth) == seen[number as usize], "sweep {number}");
    }
    alone.resume_at(6);
    alone.next(&mut sweep, &mut truth).unwrap();
    assert!(bytes_of(&sweep, &truth) == seen[6]);
    assert!(seen[6] != seen[7]);
}

// verifies SIM-002
#[test]
fn a_scene_at_rest_gets_new_noise_with_every_sweep() {
    let mut simulator = shipped("reference");
    let returns = |sweep: &Sweep| sweep.returns.item_bytes().to_vec();
    let [first, second] = [0, 6].map(|number| returns(&sweep_of(&mut simulator, number).0));
    assert_eq!(first.len(), second.len());
    assert!(first != second);
}

// verifies SIM-003
#[test]
fn columns_follow_from_the_sensor_and_its_speed() {
    for (name, rotation, columns) in [
        ("hdl-32e", "10.0", 2_170),
        ("hdl-32e", "20.0", 1_085),
        ("hdl-32e", "20.01", 1_084),
        ("hdl-32e-paper", "10.0", 500),
    ] {
        let text = exact(name).replace("rotation_hz = 10.0", &format!("rotation_hz = {rotation}"));
        let (sweep, _) = sweep_of(&mut simulator(&text), 0);
        assert_eq!(sweep.columns.len(), columns);
        let period_ns = columns as u64 * u64::from(sensor(name).cycle_ns());
        assert_eq!(sweep.header.period_ns, period_ns);
        assert!((sweep.header.column_step_rad - std::f32::consts::TAU / columns as f32).abs() < 1e-9);
    }
}

// verifies SIM-004
#[test]
fn range_noise_has_the_deviation_asked_for_and_no_mean() {
    let exactly = exact("hdl-32e") + &obstacle("ellipsoid", [12.0, 10.0, 9.0], [10.0, 3.0, -2.0], REST, REST);
    let noisy = exactly.replace("range_sigma_m = 0.0", "range_sigma_m = 0.02");
    let (expected, _) = sweep_of(&mut simulator(&exactly), 0);
    let (found, _) = sweep_of(&mut simulator(&noisy), 0);
    assert_eq!(expected.returns.len(), found.returns.len());
    let count = found.returns.len() as f64;
    assert!(count > 10_000.0);
    let errors: Vec<f64> = expected
        .returns
        .iter()
        .zip(&found.returns)
        .map(|(e, f)| f64::from(f.range_m()) - f64::from(e.range_m()))
        .collect();
    let mean = errors.iter().sum::<f64>() / count;
    let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count).sqrt();
    // Standard errors: σ/√n and σ/√(2n), both under 0.2 mm.
    assert!(mean.abs() < 5.0 * 0.02 / count.sqrt(), "{mean}");
    assert!((deviation - 0.02).abs() < 5.0 * 0.02 / (2.0 * count).sqrt(), "{deviation}");
    // Neighbours are independent.
    let together = errors.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / count / deviation.powi(2);
    assert!(together.abs() < 5.0 / count.sqrt(), "{together}");
}

// verifies SIM-004
#[test]
fn quantised_ranges_are_whole_counts_and_azimuths_whole_hundredths_of_a_degree() {
    let (sweep, _) = sweep_of(&mut shipped("default"), 4);
    for r in &sweep.returns {
        let counts = f64::from(r.range_m()) / 0.002;
        assert!((counts - counts.round()).abs() < 0.02, "{counts}");
    }
    for column in &sweep.columns {
        let counts = f64::from(column.azimuth_rad).to_degrees() * 100.0;
        assert!((counts - counts.round()).abs() < 0.002, "{counts}");
    }
    let (exact, _) =
        sweep_of(&mut simulator(&config("scenes/default.toml").replace("quantised = true", "quantised = false")), 4);
    assert!(exact.returns.iter().any(|r| (r.range_m() / 0.002).fract() > 0.3 && (r.range_m() / 0.002).fract() < 0.7));
}

// verifies SIM-004
#[test]
fn dropouts_take_their_share_and_leave_the_others_as_they_are() {
    let text = exact("hdl-32e") + &obstacle("ellipsoid", [12.0, 10.0, 9.0], [10.0, 3.0, -2.0], REST, REST);
    let lossy = text.replace("dropout = 0.0", "dropout = 0.1");
    let (all, _) = sweep_of(&mut simulator(&text), 0);
    let (left, truth) = sweep_of(&mut simulator(&lossy), 0);
    let (n, lost) = (all.returns.len() as f64, (all.returns.len() - left.returns.len()) as f64);
    assert!((lost - 0.1 * n).abs() < 5.0 * (n * 0.1 * 0.9).sqrt(), "{lost} of {n}");
    let mut others = all.returns.iter();
    assert!(left.returns.iter().all(|kept| others.any(|other| other == kept)), "a dropout changed its neighbours");
    assert_eq!(truth.owners.len(), left.returns.len());
    let (none, truth) = sweep_of(&mut simulator(&text.replace("dropout = 0.0", "dropout = 1.0")), 0);
    assert!(none.returns.is_empty() && truth.owners.is_empty());
}

// verifies SIM-005
#[test]
fn the_truth_names_the_owner_of_each_return_and_counts_them() {
    let (sweep, truth) = sweep_of(&mut shipped("ring-crossing"), 20);
    assert_eq!(truth.owners.len(), sweep.returns.len());
    let mut counted = vec![0; truth.objects.len()];
    for (r, &owner) in sweep.returns.iter().zip(&truth.owners) {
        assert_ne!(owner, NO_OBJECT);
        let object = &truth.objects[usize::from(owner)];
        counted[usize::from(owner)] += 1;
        let half_diagonal = object.size_m.iter().map(|s| s * s).sum::<f32>().sqrt() / 2.0;
        let [x, y, z] = object.centre_m;
        let away = ((r.x - x).powi(2) + (r.y - y).powi(2) + (r.z - z).powi(2)).sqrt();
        // 0.2 m: drift during the sweep; 0.1 m: five deviations of noise.
        assert!(away < half_diagonal + 0.3, "a return {away} m from the centre of its owner");
    }
    for (place, object) in truth.objects.iter().enumerate() {
        assert_eq!((usize::from(object.id), object.returns), (place, counted[place]));
        let norm = object.attitude_wxyz.iter().map(|q| q * q).sum::<f32>();
        assert!((norm - 1.0).abs() < 1e-5);
    }
}

// verifies SIM-006
#[test]
fn the_nearest_obstacle_hides_those_behind_it() {
    let far = obstacle("box", [1.0, 8.0, 8.0], [12.0, 0.0, 0.0], REST, REST);
    let near = obstacle("ellipsoid", [2.0, 2.0, 2.0], [6.0, 0.0, 0.0], REST, REST);
    let alone = |text: &str| sweep_of(&mut simulator(&(exact("hdl-32e") + text)), 0).0;
    let (far_alone, near_alone) = (alone(&far), alone(&near));
    for (text, near_id) in [(far.clone() + &near, 1), (near + &far, 0)] {
        let (both, truth) = sweep_of(&mut simulator(&(exact("hdl-32e") + &text)), 0);
        for (r, &owner) in both.returns.iter().zip(&truth.owners) {
            let same_ray = |other: &&lidar::Return| (other.column, other.ring) == (r.column, r.ring);
            match near_alone.returns.iter().find(same_ray) {
                Some(near) => assert_eq!((r.position(), owner), (near.position(), near_id)),
                None => assert_eq!(r.position(), far_alone.returns.iter().find(same_ray).unwrap().position()),
            }
        }
        assert!(both.returns.len() > near_alone.returns.len() + 1_000);
        assert!(both.returns.len() < near_alone.returns.len() + far_alone.returns.len());
    }
}

// verifies SIM-006
#[test]
fn a_surface_out_of_reach_gives_no_return_but_hides_what_is_behind() {
    let near = obstacle("box", [1.0, 8.0, 8.0], [5.0, 0.0, 0.0], REST, REST);
    let far = obstacle("ellipsoid", [2.0, 2.0, 2.0], [20.0, 0.0, 0.0], REST, REST);
    let text = exact("hdl-32e").replace("[0.1, 120.0]", "[10.0, 120.0]");
    assert!(sweep_of(&mut simulator(&(text.clone() + &near + &far)), 0).0.returns.is_empty());
    assert!(!sweep_of(&mut simulator(&(text.clone() + &far)), 0).0.returns.is_empty());
    let short = text.replace("[10.0, 120.0]", "[10.0, 15.0]");
    assert!(sweep_of(&mut simulator(&(short + &far)), 0).0.returns.is_empty());
}

// verifies SIM-006
#[test]
fn a_sensor_inside_an_obstacle_sees_nothing() {
    for shape in ["box", "ellipsoid", "cylinder", "cone"] {
        let round = obstacle(shape, [6.0, 6.0, 6.0], [0.3, 0.1, 0.2], REST, REST);
        let beside = obstacle("box", [2.0, 2.0, 2.0], [8.0, 0.0, 0.0], REST, REST);
        let text = exact("hdl-32e").replace("[0.1, 120.0]", "[0.0, 120.0]") + &round + &beside;
        assert!(sweep_of(&mut simulator(&text), 0).0.returns.is_empty(), "{shape}");
    }
}

// verifies SIM-007
#[test]
fn a_sweep_without_a_miss_fills_every_firing_and_no_more() {
    let mut file: SceneFile = toml::from_str(&exact("hdl-32e")).unwrap();
    file.quantised = true;
    file.mesh.push(
        toml::from_str(
            "path = \"room\"\nunit_m = 1.0\nposition_m = [0, 0, 0]\nattitude_deg = [0, 0, 0]\nvelocity_mps = [0, 0, 0]\n\
             spin_dps = [0, 0, 0]\nalbedo = 0.5",
        )
        .unwrap(),
    );
    let scene = file.checked(&sensor("hdl-32e"), &[("room".to_owned(), ROOM.to_owned())].into()).unwrap();
    let (sweep, truth) = sweep_of(&mut Simulator::new(scene), 0);
    assert_eq!(sweep.returns.len(), 2_170 * 32);
    assert_eq!(truth.objects[0].returns, 2_170 * 32);
    assert!(sweep.returns.iter().all(|r| (r.x.abs().max(r.y.abs()).max(r.z.abs()) - 10.0).abs() < 0.01));
}

/// The walls of a room of 20 m.
const ROOM: &str = "v -10 -10 -10\nv -10 -10 10\nv -10 10 -10\nv -10 10 10\nv 10 -10 -10\nv 10 -10 10\nv 10 10 -10\nv 10 10 10\n\
                    f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";

// verifies SIM-008
#[test]
fn packets_made_of_a_sweep_read_back_to_its_positions() {
    for name in ["default", "reference"] {
        let mut simulator = shipped(name);
        let sensor = simulator.scene().sensor().clone();
        let laser_of = |ring: u8| *sensor.lasers().iter().find(|laser| laser.ring == ring).unwrap();
        let sweeps: Vec<Box<Sweep>> = (0..3).map(|number| sweep_of(&mut simulator, number).0).collect();
        let columns = sweeps[0].columns.len();
        let counts = |index: usize| {
            let azimuth_rad = f64::from(sweeps[index / columns].columns[index % columns].azimuth_rad);
            (-azimuth_rad.to_degrees() * 100.0).round().rem_euclid(36_000.0)
        };
        for (number, sweep) in sweeps.iter().enumerate() {
            for r in &sweep.returns {
                let index = number * columns + usize::from(r.column);
                let packet = index / 12 * 12;
                if packet + 11 >= 3 * columns {
                    continue; // a packet that the fourth sweep ends
                }
                let laser = laser_of(r.ring);
                let speed =
                    (counts(packet + 11) - counts(packet)).rem_euclid(36_000.0) / (11.0 * f64::from(sensor.cycle_ns()));
                let azimuth = ((counts(index) + speed * f64::from(laser.offset_ns)) / 100.0).to_radians();
                let range_m = (f64::from(r.range_m()) / 0.002).round() * 0.002;
                let horizontal_m = range_m * laser.elevation_rad.cos();
                let expected =
                    [horizontal_m * azimuth.cos(), -horizontal_m * azimuth.sin(), range_m * laser.elevation_rad.sin()];
                for (found, expected) in r.position().into_iter().zip(expected) {
                    assert!((f64::from(found) - expected).abs() < 5e-6, "{name}: {found} read back as {expected}");
                }
            }
        }
    }
}

// verifies SIM-009
#[test]
fn obstacles_shown_one_at_a_time_are_seen_alone() {
    use rand::SeedableRng;
    let scene = scene(&config("scenes/single.toml"));
    let field = scene.fields()[0].clone();
    let mut simulator = Simulator::new(scene);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for example in 0..40 {
        for &shape in field.shapes() {
            let obstacle = field.draw(shape, &mut rng);
            simulator.show(vec![obstacle]).unwrap();
            let (sweep, truth) = sweep_of(&mut simulator, example);
            assert_eq!(truth.objects.len(), 1);
            assert_eq!(truth.objects[0].class, shape.class());
            assert!(truth.owners.iter().all(|&owner| owner == 0));
            assert_eq!(truth.objects[0].returns as usize, sweep.returns.len());
        }
    }
}

#[test]
fn a_scene_without_obstacles_gives_empty_sweeps() {
    let (sweep, truth) = sweep_of(&mut simulator(&exact("hdl-32e")), 0);
    assert_eq!((sweep.returns.len(), sweep.columns.len(), truth.objects.len()), (0, 2_170, 0));
}
