//! Eq. 4 against surfaces whose normals are known, and against Cramer's rule where it can be solved as it stands.

mod common;

use common::{brute_neighbours, cross, dot, least_squares_normal, minus, norm, scattered, sphere};
use extractor::{Neighbours, estimate_normals};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn normals(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut neighbours = Neighbours::new(points.len(), 4);
    neighbours.find(points);
    let mut normals = vec![[0.0; 3]; points.len()];
    estimate_normals(points, &neighbours, &mut normals);
    normals
}

fn wide(v: [f32; 3]) -> [f64; 3] {
    v.map(f64::from)
}

// verifies EXT-004
#[test]
fn a_plane_of_any_attitude_has_its_own_normal_away_from_the_sensor() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..200 {
        let direction: [f64; 3] = std::array::from_fn(|_| random.random::<f64>() * 2.0 - 1.0);
        let plane = direction.map(|c| c / norm(direction));
        let side = cross(plane, [plane[1], plane[2], plane[0]]);
        let side = side.map(|c| c / norm(side));
        let up = cross(plane, side);
        // 6 m away along the normal, 3 m aside: the surface is seen at a slant.
        let points: Vec<[f32; 3]> = (0..64)
            .map(|i| {
                let (a, b) = (3.0 + f64::from(i % 8) * 0.11, 0.5 + f64::from(i / 8) * 0.13);
                std::array::from_fn(|axis| (6.0 * plane[axis] + a * side[axis] + b * up[axis]) as f32)
            })
            .collect();
        for normal in normals(&points) {
            assert!(dot(wide(normal), plane) > 1.0 - 3e-7, "{normal:?} is not {plane:?}");
            assert!((norm(wide(normal)) - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_sphere_has_normals_close_to_its_radii_and_away_from_the_sensor() {
    let centre = [6.0, 2.0, 0.5];
    let points: Vec<[f32; 3]> = sphere(centre, 1.5, 0.72, 0.0, 1).iter().map(|r| r.position()).collect();
    assert!(points.len() > 300);
    let mut close = 0;
    for (point, normal) in points.iter().zip(normals(&points)) {
        let outward = minus(wide(*point), centre);
        // The near half of the sphere faces the sensor, so away from the sensor is inward.
        close += usize::from(-dot(outward, wide(normal)) / norm(outward) > 0.95);
        assert!(dot(wide(*point), wide(normal)) > 0.0);
    }
    assert!(close * 10 > points.len() * 8, "{close} of {}", points.len());
}

#[test]
fn scattered_points_have_the_normals_of_cramers_rule() {
    let points = scattered(400, 11, None);
    let near = brute_neighbours(&points, 4);
    for (index, normal) in normals(&points).into_iter().enumerate() {
        let hood: Vec<[f64; 3]> =
            std::iter::once(index).chain(near[index].iter().map(|&j| j as usize)).map(|j| wide(points[j])).collect();
        assert!(dot(least_squares_normal(&hood), wide(normal)) > 1.0 - 1e-6);
    }
}

// verifies EXT-005
#[test]
fn where_no_normal_is_determined_the_view_direction_stands_in() {
    let line: Vec<[f32; 3]> = (0..7).map(|i| [4.0, -0.3 + 0.1 * i as f32, 1.0]).collect();
    let radial: Vec<[f32; 3]> = (0..7).map(|i| [3.0 + 0.1 * i as f32, 0.0, 0.0]).collect();
    let through_sensor: Vec<[f32; 3]> =
        (0..25).map(|i| [3.0 + 0.1 * (i % 5) as f32, 0.1 * (i / 5) as f32, 0.0]).collect();
    let coincident = vec![[1.0, 2.0, 2.0]; 6];
    let pair = vec![[1.0, 2.0, 2.0], [1.0, 2.0, 2.1]];
    for points in [line, radial, through_sensor, coincident, pair] {
        for (point, normal) in points.iter().zip(normals(&points)) {
            let view = wide(*point).map(|c| c / norm(wide(*point)));
            assert!(norm(minus(view, wide(normal))) < 1e-6, "{normal:?} at {point:?}");
        }
    }
    assert_eq!(normals(&[[0.0; 3]; 5]), [[0.0, 0.0, 1.0]; 5]);
}

#[test]
fn a_normal_does_not_depend_on_the_points_beside_it() {
    // Points are worked on in groups; another first point shifts all groups.
    for count in [5, 8, 9, 40, 500] {
        let points = scattered(count, count as u64, Some(0.25));
        let mut shifted = vec![[-40.0, 7.0, 3.0]];
        shifted.extend(&points);
        // Far enough to be nobody's neighbour, but for the smallest clusters.
        let with_another = if count > 5 { normals(&shifted)[1..].to_vec() } else { normals(&points) };
        assert_eq!(with_another, normals(&points), "{count} points");
    }
}
