//! Ray distances against ray marching, parry3d and the simulator.

use parry3d::math::Vector;
use parry3d::query::RayCast;
use parry3d::shape::{Ball, Cuboid};
use rand::RngExt;

use super::stand::Stand;
use super::*;

/// First sample of the ray inside the body, if any of many is.
fn march(kind: Kind, half_m: &V, origin: &V, direction: &V) -> Option<f64> {
    let radius_m = half_m.norm();
    let middle_m = -origin.dot(direction);
    (0..6_000)
        .map(|i| middle_m + radius_m * (f64::from(i) / 3_000.0 - 1.0))
        .find(|&t| t > 0.0 && implicit(kind, half_m, &(origin + direction * t)) < 0.0)
}

// verifies EXT-022
#[test]
fn a_ray_meets_each_solid_where_marching_along_it_comes_in() {
    let mut random = random(1);
    for kind in Kind::ALL {
        let (mut met, mut passed) = (0, 0);
        for _ in 0..3_000 {
            let body = random_body(kind, &mut random);
            let ray = random_aim(&body, 1.2, &mut random);
            let half_m = body.ln_half.map(f64::exp);
            let (origin, direction) = to_body(&body, &ray);
            let inside = march(kind, &half_m, &origin, &direction);
            match meet(kind, &body, &ray) {
                Some(Meeting { distance, normal }) => {
                    met += 1;
                    let there = origin + direction * distance;
                    assert!(implicit(kind, &half_m, &there).abs() < 1e-9, "{kind:?}: off its surface");
                    assert!(inside.is_none_or(|t| t >= distance - 1e-9), "{kind:?}: body before the meeting");
                    assert!(normal.component_div(&half_m).dot(&direction) < 0.0, "{kind:?}: seen from within");
                }
                None => {
                    passed += 1;
                    assert_eq!(inside, None, "{kind:?}: a ray through the body met nothing");
                }
            }
        }
        assert!(met > 1_000 && passed > 200, "{kind:?}: {met} met, {passed} passed");
    }
}

#[test]
fn a_normal_is_the_slope_of_the_surface() {
    let mut random = random(2);
    for kind in Kind::ALL {
        for _ in 0..500 {
            let body = random_body(kind, &mut random);
            let ray = random_aim(&body, 1.0, &mut random);
            let half_m = body.ln_half.map(f64::exp);
            let (origin, direction) = to_body(&body, &ray);
            let Some(Meeting { distance, normal }) = meet(kind, &body, &ray) else { continue };
            let normal = normal.component_div(&half_m).normalize();
            let point = origin + direction * distance;
            let slope = V::from_fn(|axis, _| {
                let mut step = V::zeros();
                step[axis] = 1e-6;
                implicit(kind, &half_m, &(point + step)) - implicit(kind, &half_m, &(point - step))
            });
            let off = (slope.normalize() - normal).norm();
            // Within a step of an edge the slope belongs to two faces.
            let near_edge = (0..16).any(|_| {
                let aside = random_direction(&mut random) * 1e-4;
                meet(kind, &body, &(ray + aside).normalize())
                    .is_none_or(|other| (other.normal.component_div(&half_m).normalize() - normal).norm() > 0.1)
            });
            assert!(off < 1e-3 || near_edge, "{kind:?}: {normal} against {slope}");
        }
    }
}

// verifies EXT-022
#[test]
fn boxes_and_balls_are_parrys() {
    let mut random = random(3);
    for kind in [Kind::Cuboid, Kind::Ellipsoid] {
        let (mut met, mut differing) = (0, 0);
        for _ in 0..3_000 {
            let mut body = random_body(kind, &mut random);
            if kind == Kind::Ellipsoid {
                body.ln_half = V::repeat(body.ln_half.x); // parry knows balls only
            }
            let half_m = body.ln_half.map(f64::exp);
            let ray = random_aim(&body, 1.3, &mut random);
            let (origin, direction) = to_body(&body, &ray);
            let single = |v: &V| Vector::new(v.x as f32, v.y as f32, v.z as f32);
            let parrys = parry3d::query::Ray::new(single(&origin), single(&direction));
            let expected = match kind {
                Kind::Cuboid => Cuboid::new(single(&half_m)).cast_local_ray(&parrys, 100.0, true),
                _ => Ball::new(half_m.x as f32).cast_local_ray(&parrys, 100.0, true),
            };
            let found = meet(kind, &body, &ray).map(|meeting| meeting.distance);
            met += usize::from(found.is_some());
            // Parry's single precision decides otherwise at the outline.
            differing += usize::from(match (found, expected) {
                (Some(found), Some(expected)) => (found - f64::from(expected)).abs() > 1e-3,
                (found, expected) => found.is_some() != expected.is_some(),
            });
        }
        assert!(met > 1_000 && differing * 500 <= met, "{kind:?}: {differing} of {met} differ");
    }
}

// verifies EXT-022
#[test]
fn the_simulator_casts_the_same_ranges_at_the_same_bodies() {
    let mut random = random(4);
    let mut stand = Stand::new(0.0);
    for kind in Kind::ALL {
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..12 {
            let mut body = random_body(kind, &mut random);
            let azimuth: f64 = random.random_range(-3.0..3.0);
            body.centre_m = V::new(8.0 * azimuth.cos(), 8.0 * azimuth.sin(), random.random_range(-2.0..0.0));
            let clusters = stand.look(kind, &body);
            for r in &clusters.returns {
                let position = V::new(r.x.into(), r.y.into(), r.z.into());
                // Positions are single; a return at the outline may be rounded off the body.
                let Some(hit) = hit_of(kind, &body, &position.normalize()) else { continue };
                hits += 1;
                let off_m = (hit.range_m - position.norm()).abs();
                let grazing = meet(kind, &body, &(position.normalize() * 0.999_999)).is_none();
                assert!(off_m < 2e-3 || grazing, "{kind:?}: {off_m} m");
            }
            for cell in clusters.cells.iter().filter(|cell| cell.kind == messages::CellKind::Miss) {
                let (sin_az, cos_az) = f64::from(cell.azimuth_rad).sin_cos();
                let (sin_el, cos_el) = f64::from(clusters.ring_elevation_rad[usize::from(cell.ring)]).sin_cos();
                misses += 1;
                let direction = V::new(cos_el * cos_az, cos_el * sin_az, sin_el);
                // A ray that just touches the body may be rounded onto it.
                let level = V::new(direction.y, -direction.x, 0.0);
                let asides = [level, -level, V::z(), -V::z()].map(|aside| (direction + aside * 1e-5).normalize());
                let deep = asides.iter().chain([&direction]).all(|there| meet(kind, &body, there).is_some());
                assert!(!deep, "{kind:?}: a miss meets the body");
            }
        }
        assert!(hits > 2_000 && misses > 500, "{kind:?}: {hits} hits, {misses} misses");
    }
}

#[test]
fn rays_along_axes_and_generators_and_through_the_apex_meet_as_geometry_says() {
    type Case = (Kind, [f64; 3], [f64; 3], Option<f64>);
    let cases: [Case; 19] = [
        (Kind::Cuboid, [-5.0, 0.5, 0.5], [1.0, 0.0, 0.0], Some(4.0)),
        (Kind::Cuboid, [-5.0, 1.5, 0.5], [1.0, 0.0, 0.0], None),
        (Kind::Cuboid, [0.0, 0.0, 9.0], [0.0, 0.0, -1.0], Some(8.0)),
        (Kind::Ellipsoid, [0.0, -3.0, 0.0], [0.0, 1.0, 0.0], Some(2.0)),
        (Kind::Ellipsoid, [0.0, -3.0, 1.1], [0.0, 1.0, 0.0], None),
        (Kind::Cylinder, [0.3, 0.2, 4.0], [0.0, 0.0, -1.0], Some(3.0)),
        (Kind::Cylinder, [0.0, 0.0, 4.0], [0.0, 0.0, -1.0], Some(3.0)),
        (Kind::Cylinder, [1.3, 0.2, 4.0], [0.0, 0.0, -1.0], None),
        (Kind::Cylinder, [0.0, 6.0, 0.9], [0.0, -1.0, 0.0], Some(5.0)),
        (Kind::Cylinder, [0.0, 6.0, 1.1], [0.0, -1.0, 0.0], None),
        (Kind::Cone, [0.3, 0.2, -4.0], [0.0, 0.0, 1.0], Some(3.0)),
        (Kind::Cone, [0.0, 0.0, -4.0], [0.0, 0.0, 1.0], Some(3.0)),
        (Kind::Cone, [0.0, 0.0, 4.0], [0.0, 0.0, -1.0], Some(3.0)),
        (Kind::Cone, [0.0, 6.0, 0.0], [0.0, -1.0, 0.0], Some(5.5)),
        (Kind::Cone, [0.0, 6.0, 1.1], [0.0, -1.0, 0.0], None),
        // In the plane x = 0 the side's generators are y = ±(1 − z)/2: beside one, and down to the base from above it.
        (Kind::Cone, [0.0, -2.0, 0.0], [0.0, 1.0, 2.0], None),
        (Kind::Cone, [0.0, 2.0, 0.0], [0.0, -1.0, 2.0], None),
        (Kind::Cone, [0.0, 3.0, -4.0], [0.0, -1.0, 2.0], None),
        (Kind::Cone, [0.0, 1.25, -3.0], [0.0, -1.0, 2.0], Some(1.0)),
    ];
    for (index, (kind, origin, direction, expected)) in cases.into_iter().enumerate() {
        let (origin, direction) = (V::from(origin), V::from(direction));
        let found = meet_unit(kind, &origin, &direction).map(|meeting| meeting.distance);
        match (found, expected) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-12, "case {index}: {found}"),
            _ => assert_eq!(found, expected, "case {index}"),
        }
    }
}

#[test]
fn a_body_behind_the_sensor_is_not_met() {
    let mut random = random(5);
    for kind in Kind::ALL {
        for _ in 0..500 {
            let body = random_body(kind, &mut random);
            let ray = random_aim(&body, 1.0, &mut random);
            assert_eq!(meet(kind, &body, &-ray), None);
        }
    }
}
