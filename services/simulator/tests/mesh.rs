//! Meshes from OBJ text.

mod common;

use std::collections::BTreeMap;

use common::{exact, obstacle, sensor, simulator, sweep_of};
use messages::{Sweep, Truth};
use simulator::{Mesh, SceneFile, Simulator};

/// A box of full extents `size` round `middle`, in `unit`s, with comments, a material file and quadrangles.
fn box_obj(size: [f64; 3], middle: [f64; 3], unit: f64) -> String {
    let mut text = String::from("# a box\nmtllib nowhere.mtl\no first\n");
    for corner in 0..8 {
        let at = |axis: usize| (middle[axis] + size[axis] * (f64::from(corner >> (2 - axis) & 1) - 0.5)) / unit;
        text += &format!("v {} {} {}\n", at(0), at(1), at(2));
    }
    text + "usemtl gold\nf 1 2 4 3\nf 5 7 8 6\no second\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
}

#[expect(clippy::unwrap_used, reason = "test set-up")]
fn sweep_of_mesh(motion: &str, text: String, unit_m: f64) -> (Box<Sweep>, Box<Truth>) {
    let scene = format!("{}[[mesh]]\npath = \"m.obj\"\nunit_m = {unit_m}\nalbedo = 0.5\n{motion}", exact("hdl-32e"));
    let file: SceneFile = toml::from_str(&scene).unwrap();
    let scene = file.checked(&sensor("hdl-32e"), &BTreeMap::from([("m.obj".to_owned(), text)])).unwrap();
    sweep_of(&mut Simulator::new(scene), 2)
}

// verifies SIM-013
#[test]
fn a_mesh_of_a_box_is_seen_as_the_box_in_closed_form_even_far_away_and_in_motion() {
    let size = [3.0, 2.0, 4.0];
    for (position, tolerance_m) in [([7.0, -3.0, 0.5], 1e-4), ([70.0, -50.0, -20.0], 1e-3)] {
        let (velocity, spin) = ([1.0, -8.0, 0.5], [40.0, 0.0, -90.0]);
        let written = obstacle("box", size, position, velocity, spin);
        let (expected, _) = sweep_of(&mut simulator(&(exact("hdl-32e") + &written)), 2);
        // Off the middle of its own frame and in inches: both are undone.
        let motion: Vec<&str> = written
            .lines()
            .filter(|l| l.contains("position") || l.contains("_deg") || l.contains("_mps") || l.contains("_dps"))
            .collect();
        let (found, truth) = sweep_of_mesh(&motion.join("\n"), box_obj(size, [5.0, 6.0, -7.0], 0.0254), 0.0254);
        let alike = expected
            .returns
            .iter()
            .filter(|e| {
                found.returns.iter().any(|f| {
                    (f.column, f.ring) == (e.column, e.ring)
                        && f.intensity.abs_diff(e.intensity) <= 1
                        && (f.range_m() - e.range_m()).abs() < tolerance_m
                })
            })
            .count();
        // Rays at the silhouette may go either way.
        let allowed = expected.returns.len() / 100 + 1;
        assert!(expected.returns.len() > 15, "{}", expected.returns.len());
        assert!(expected.returns.len() - alike <= allowed, "{alike} of {} alike", expected.returns.len());
        assert!(found.returns.len().abs_diff(expected.returns.len()) <= allowed);
        for (found, expected) in truth.objects[0].size_m.into_iter().zip(size) {
            assert!((f64::from(found) - expected).abs() < 1e-5);
        }
    }
}

#[test]
fn text_that_is_no_mesh_is_refused_in_words() {
    let refused = |text: &str| Mesh::from_obj(text, 1.0).unwrap_err().to_string();
    assert!(refused("").contains("has no faces"));
    assert!(refused("v 0 0 0\nv 1 0 0\nv 0 1 0\n").contains("has no faces"));
    assert!(refused("v a b c\n").contains("is no OBJ file"));
    assert!(refused("v 0 0 0\nf 1 2 3\n").contains("is no OBJ file"));
    assert!(refused("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").contains("not finite"));
}

#[test]
fn the_satellite_of_the_repository_has_the_size_that_it_claims() {
    let mesh = Mesh::from_obj(&common::config("scenes/meshes/satellite.obj"), 1.0).unwrap();
    let size = mesh.size_m();
    assert!((size.y - 8.4).abs() < 1e-5 && (size.x - 1.5).abs() < 1e-5 && (size.z - 3.05).abs() < 1e-5, "{size}");
    assert!(mesh.bounding_radius_m() >= 4.2 && mesh.bounding_radius_m() < 5.0);
}

/// Meshes of others, where they are at hand: all read, in the size their facts give.
#[test]
fn meshes_of_others_are_read() {
    let folder = std::env::var("ENCKE_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data").to_owned());
    let spacecraft = std::path::Path::new(&folder).join("spacecraft");
    let Ok(files) = std::fs::read_dir(&spacecraft) else {
        let required = std::env::var("ENCKE_DATA_REQUIRED").is_ok_and(|value| value == "1");
        assert!(!required, "{} is missing", spacecraft.display());
        println!("skipped: {} is missing", spacecraft.display());
        return;
    };
    let mut read = 0;
    for file in files {
        let path = file.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "obj") {
            let mesh = Mesh::from_obj(&std::fs::read_to_string(&path).unwrap(), 1.0)
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert!(mesh.size_m().min() > 0.0, "{}", path.display());
            read += 1;
        }
    }
    assert!(read > 5, "{read} meshes");
}
