use nalgebra::{Rotation3, Vector3};
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::{Ball, Cone, Cuboid, Cylinder, TriMesh};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use super::*;

type V = Vector3<f64>;

/// Negative inside, zero on the surface, of unit slope or less.
type Implicit = fn(&V) -> f64;

/// Each unit solid with its implicit function.
fn solids() -> [(&'static str, &'static dyn Surface, Implicit); 4] {
    [
        ("box", &UnitBox, |p| p.amax() - 1.0),
        ("ball", &UnitBall, |p| p.norm() - 1.0),
        ("cylinder", &UnitCylinder, |p| (p.xy().norm() - 1.0).max(p.z.abs() - 1.0)),
        // 2/√5: the side's slope.
        ("cone", &UnitCone, |p| ((p.xy().norm() - 0.5 * (1.0 - p.z)) * 0.8_f64.sqrt()).max(p.z - 1.0).max(-1.0 - p.z)),
    ]
}

/// A ray from a random place outside the ball of radius 2, aimed near the origin, its direction of a random length.
fn random_ray(rng: &mut ChaCha8Rng) -> (V, V) {
    let origin = V::from(rng.sample::<[f64; 3], _>(UnitSphere)) * rng.random_range(2.0..50.0);
    let aim = V::from_fn(|_, _| rng.random_range(-1.3..1.3));
    let direction = (aim - origin).normalize() * rng.random_range(0.3..3.0);
    (origin, direction)
}

/// A sample of the ray inside the solid, if any of 4,000 within reach of it is.
fn first_sample_inside(origin: &V, direction: &V, implicit: Implicit) -> Option<f64> {
    let middle = -origin.dot(direction) / direction.norm_squared();
    let half = 2.5 / direction.norm();
    (0..4_000)
        .map(|i| middle + half * (f64::from(i) / 2_000.0 - 1.0))
        .find(|&t| t >= 0.0 && implicit(&(origin + direction * t)) < 0.0)
}

#[test]
fn a_meeting_lies_on_the_surface_and_nothing_of_the_solid_lies_before_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (name, solid, implicit) in solids() {
        let mut met = 0;
        for _ in 0..3_000 {
            let (origin, direction) = random_ray(&mut rng);
            let inside = first_sample_inside(&origin, &direction, implicit);
            match solid.meet(&origin, &direction) {
                Some(meeting) => {
                    met += 1;
                    let point = origin + direction * meeting.distance;
                    assert!(implicit(&point).abs() < 1e-9, "{name}: {} off its surface", implicit(&point));
                    assert!(inside.is_none_or(|t| t >= meeting.distance - 1e-9), "{name}: solid before the meeting");
                }
                None => assert_eq!(inside, None, "{name}: a ray through the solid met nothing"),
            }
        }
        assert!(met > 500, "{name}: only {met} rays met it");
    }
}

#[test]
fn a_normal_is_the_slope_of_the_surface_and_faces_the_ray() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for (name, solid, implicit) in solids() {
        for _ in 0..1_000 {
            let (origin, direction) = random_ray(&mut rng);
            let Some(meeting) = solid.meet(&origin, &direction) else { continue };
            let point = origin + direction * meeting.distance;
            let normal = meeting.normal.normalize();
            assert!(normal.dot(&direction) < 1e-9, "{name}: normal along the ray");
            let slope = V::from_fn(|i, _| {
                let mut step = V::zeros();
                step[i] = 1e-6;
                implicit(&(point + step)) - implicit(&(point - step))
            });
            // At edges the slope is no one's.
            if slope.norm() > 1.9e-6 {
                assert!((slope.normalize() - normal).norm() < 1e-3, "{name}: {normal} against {slope}");
            }
        }
    }
}

#[test]
fn a_ray_that_starts_inside_meets_the_solid_at_once() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for (name, solid, implicit) in solids() {
        let mut inside = 0;
        for _ in 0..500 {
            let origin = V::from_fn(|_, _| rng.random_range(-1.2..1.2));
            let direction = V::from(rng.sample::<[f64; 3], _>(UnitSphere));
            let meeting = solid.meet(&origin, &direction);
            if implicit(&origin) < 0.0 {
                inside += 1;
                assert_eq!(meeting.map(|m| m.distance), Some(0.0), "{name} at {origin}");
            } else if let Some(meeting) = meeting {
                assert!(meeting.distance > 0.0, "{name} at {origin}");
            }
        }
        assert!(inside > 50);
    }
}

#[test]
fn a_solid_behind_the_sensor_is_not_met() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for (name, solid, _) in solids() {
        for _ in 0..1_000 {
            let (origin, direction) = random_ray(&mut rng);
            if solid.meet(&origin, &direction).is_some() {
                assert_eq!(solid.meet(&origin, &-direction), None, "{name}");
            }
        }
    }
}

#[test]
fn rays_along_the_axes_meet_faces_caps_base_and_apex() {
    type Case<'a> = (&'a dyn Surface, [f64; 3], [f64; 3], Option<f64>);
    let cases: [Case; 14] = [
        (&UnitBox, [-5.0, 0.5, 0.5], [1.0, 0.0, 0.0], Some(4.0)),
        (&UnitBox, [-5.0, 1.5, 0.5], [1.0, 0.0, 0.0], None),
        (&UnitBox, [0.0, 0.0, 9.0], [0.0, 0.0, -2.0], Some(4.0)),
        (&UnitBall, [0.0, -3.0, 0.0], [0.0, 1.0, 0.0], Some(2.0)),
        (&UnitBall, [0.0, -3.0, 1.1], [0.0, 1.0, 0.0], None),
        (&UnitCylinder, [0.3, 0.2, 4.0], [0.0, 0.0, -1.0], Some(3.0)),
        (&UnitCylinder, [1.3, 0.2, 4.0], [0.0, 0.0, -1.0], None),
        (&UnitCylinder, [0.0, 6.0, 0.9], [0.0, -1.0, 0.0], Some(5.0)),
        (&UnitCylinder, [0.0, 6.0, 1.1], [0.0, -1.0, 0.0], None),
        (&UnitCone, [0.3, 0.2, -4.0], [0.0, 0.0, 1.0], Some(3.0)),
        (&UnitCone, [0.0, 0.0, 4.0], [0.0, 0.0, -1.0], Some(3.0)),
        (&UnitCone, [0.0, 6.0, 0.0], [0.0, -1.0, 0.0], Some(5.5)),
        (&UnitCone, [0.0, 6.0, 1.1], [0.0, -1.0, 0.0], None),
        // Parallel to the side: one root of the equation is infinite. In the plane x = 0 the side is y = −(1 − z)/2.
        (&UnitCone, [0.0, -2.0, 0.0], [0.0, 1.0, 2.0], None),
    ];
    for (index, (solid, origin, direction, expected)) in cases.into_iter().enumerate() {
        let found = solid.meet(&V::from(origin), &V::from(direction)).map(|meeting| meeting.distance);
        match (found, expected) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-12, "case {index}: {found}"),
            _ => assert_eq!(found, expected, "case {index}"),
        }
    }
}

#[test]
fn box_and_ball_are_parrys() {
    let (cuboid, ball) = (Cuboid::new(Vector::splat(1.0)), Ball::new(1.0));
    let cases: [(&str, &dyn Surface, &dyn RayCast); 2] = [("box", &UnitBox, &cuboid), ("ball", &UnitBall, &ball)];
    for (name, ours, parrys) in cases {
        let (met, differing) = compare_with_parry(ours, parrys, 1e-4);
        assert!(met > 1_000, "{name}");
        // Single precision decides otherwise at silhouettes.
        assert!(differing <= met / 500, "{name}: {differing} of {met} differ");
    }
}

#[test]
fn cylinder_and_cone_are_the_meshes_that_they_round_off() {
    // Not parry's own rays for these, which are wrong by metres at times. Its mesh stands y up.
    let upright = Rotation3::from_axis_angle(&V::x_axis(), std::f64::consts::FRAC_PI_2);
    let cylinder = mesh(Cylinder::new(1.0, 1.0).to_trimesh(720), &upright);
    let cone = mesh(Cone::new(1.0, 1.0).to_trimesh(720), &upright);
    let cases: [(&str, &dyn Surface, TriMesh); 2] = [("cylinder", &UnitCylinder, cylinder), ("cone", &UnitCone, cone)];
    for (name, ours, mesh) in cases {
        let (met, differing) = compare_with_parry(ours, &mesh, 2e-3);
        assert!(met > 1_000, "{name}");
        // Facets of half a degree lie 1e-5 inside the surface: only grazing rays tell.
        assert!(differing <= met / 100, "{name}: {differing} of {met} differ");
    }
}

fn mesh((vertices, indices): (Vec<Vector>, Vec<[u32; 3]>), upright: &Rotation3<f64>) -> TriMesh {
    let turned = vertices.into_iter().map(|vertex| {
        let vertex = upright * V::new(vertex.x.into(), vertex.y.into(), vertex.z.into());
        Vector::new(vertex.x as f32, vertex.y as f32, vertex.z as f32)
    });
    TriMesh::new(turned.collect(), indices).unwrap()
}

/// Rays that meet `ours`, and rays on which both differ by more than `tolerance` or on whether there is a meeting.
fn compare_with_parry(ours: &dyn Surface, parrys: &dyn RayCast, tolerance: f64) -> (usize, usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut met, mut differing) = (0, 0);
    for _ in 0..6_000 {
        let origin = V::from(rng.sample::<[f64; 3], _>(UnitSphere)) * rng.random_range(2.0..8.0);
        let aim = V::from_fn(|_, _| rng.random_range(-1.2..1.2));
        let direction = (aim - origin).normalize();
        let single = |v: &V| Vector::new(v.x as f32, v.y as f32, v.z as f32);
        let expected = parrys.cast_local_ray(&Ray::new(single(&origin), single(&direction)), 100.0, true);
        let found = ours.meet(&origin, &direction).map(|meeting| meeting.distance);
        met += usize::from(found.is_some());
        differing += usize::from(match (found, expected) {
            (Some(found), Some(expected)) => (found - f64::from(expected)).abs() > tolerance,
            (None, None) => false,
            _ => true,
        });
    }
    (met, differing)
}

#[test]
fn roots_come_in_order_and_without_cancellation() {
    assert_eq!(roots(1.0, -2.5, 4.0), Some((1.0, 4.0)));
    assert_eq!(roots(-1.0, 2.5, -4.0), Some((1.0, 4.0)));
    assert_eq!(roots(1.0, 0.0, 1.0), None);
    for b in [1.0, -1.0] {
        let (low, high) = roots(1e-12, b, 1.0).unwrap();
        let near = if b > 0.0 { high } else { low };
        assert!((near.abs() - 0.5).abs() < 1e-12, "{near}");
    }
    let (_, high) = roots(0.0, -1.0, 1.0).unwrap();
    assert!(high.is_infinite());
}
