//! Solids as lines: in space for a view, and as a footprint seen from above.

use std::f64::consts::TAU;

use messages::{SolidKind, TruthObject};

/// A solid's edges and circles as lines through space \[m\], sensor frame. A mesh shows its box.
pub(crate) fn lines(object: &TruthObject) -> Vec<Vec<[f64; 3]>> {
    let [a, b, c] = object.size_m.map(|size| 0.5 * f64::from(size));
    let circle = |radius: f64, height: f64| -> Vec<[f64; 3]> {
        round(|angle| [radius * angle.cos(), radius * angle.sin(), height])
    };
    let body = match object.kind {
        SolidKind::Box | SolidKind::Mesh => cuboid([a, b, c]),
        SolidKind::Ellipsoid => vec![
            round(|angle| [a * angle.cos(), b * angle.sin(), 0.0]),
            round(|angle| [a * angle.cos(), 0.0, c * angle.sin()]),
            round(|angle| [0.0, b * angle.cos(), c * angle.sin()]),
        ],
        SolidKind::Cylinder => {
            let mut lines = vec![circle(a, -c), circle(a, c)];
            lines.extend(quarters(a).map(|[x, y]| vec![[x, y, -c], [x, y, c]]));
            lines
        }
        SolidKind::Cone => {
            let mut lines = vec![circle(a, -c)];
            lines.extend(quarters(a).map(|[x, y]| vec![[x, y, -c], [0.0, 0.0, c]]));
            lines
        }
    };
    body.into_iter().map(|line| line.into_iter().map(|point| placed(object, point)).collect()).collect()
}

/// The solid's outline seen along z: a convex polygon \[m\], x and y of the sensor frame.
pub(crate) fn footprint(object: &TruthObject) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = lines(object).into_iter().flatten().map(|[x, y, _]| [x, y]).collect();
    if object.kind == SolidKind::Ellipsoid {
        // Circles of latitude: three great circles leave corners out.
        let [a, b, c] = object.size_m.map(|size| 0.5 * f64::from(size));
        for step in 1..12 {
            let latitude = TAU * f64::from(step) / 24.0 - TAU / 4.0;
            let (height, width) = latitude.sin_cos();
            let ring = round(|angle| [a * width * angle.cos(), b * width * angle.sin(), c * height]);
            points.extend(ring.into_iter().map(|point| placed(object, point)).map(|[x, y, _]| [x, y]));
        }
    }
    hull(points)
}

/// Convex hull, counter-clockwise, by Andrew's monotone chain; fewer than three points as they are.
pub(crate) fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|p, q| p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while let [.., o, a] = chain[..] {
                let turn = (a[0] - o[0]) * (p[1] - o[1]) - (a[1] - o[1]) * (p[0] - o[0]);
                if turn > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut chain = half(&mut points.iter().copied());
    chain.extend(half(&mut points.iter().rev().copied()));
    chain
}

fn round(point: impl Fn(f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    (0..=48).map(|step| point(TAU * f64::from(step) / 48.0)).collect()
}

fn quarters(radius: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..8).map(move |step| {
        let (sin, cos) = (TAU * f64::from(step) / 8.0).sin_cos();
        [radius * cos, radius * sin]
    })
}

fn cuboid(half: [f64; 3]) -> Vec<Vec<[f64; 3]>> {
    let corner = |bits: usize| std::array::from_fn(|axis| if bits >> axis & 1 == 1 { half[axis] } else { -half[axis] });
    let edges = (0..8_usize).flat_map(|from| (0..3).map(move |axis| (from, from | 1 << axis)));
    edges.filter(|(from, to)| from != to).map(|(from, to)| vec![corner(from), corner(to)]).collect()
}

/// A point of the body in the sensor frame.
fn placed(object: &TruthObject, point: [f64; 3]) -> [f64; 3] {
    let [w, x, y, z] = object.attitude_wxyz.map(f64::from);
    let axis = [x, y, z];
    // p + 2 w (q × p) + 2 q × (q × p).
    let once = cross(axis, point);
    let twice = cross(axis, once);
    std::array::from_fn(|i| f64::from(object.centre_m[i]) + point[i] + 2.0 * (w * once[i] + twice[i]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(kind: SolidKind, attitude_wxyz: [f32; 4]) -> TruthObject {
        TruthObject {
            kind,
            attitude_wxyz,
            size_m: [2.0, 4.0, 6.0],
            centre_m: [10.0, 0.0, 0.0],
            ..TruthObject::default()
        }
    }

    #[test]
    fn a_box_has_twelve_edges_and_turns_with_its_attitude() {
        assert_eq!(lines(&object(SolidKind::Box, [1.0, 0.0, 0.0, 0.0])).len(), 12);
        // A quarter turn about x: the 6 m lie along y.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let footprint = footprint(&object(SolidKind::Box, [half, half, 0.0, 0.0]));
        assert_eq!(footprint.len(), 4);
        assert!(footprint.iter().all(|[x, y]| ((x - 10.0).abs() - 1.0).abs() < 1e-6 && (y.abs() - 3.0).abs() < 1e-6));
    }

    #[test]
    fn a_footprint_reaches_as_far_as_its_solid() {
        for kind in [SolidKind::Ellipsoid, SolidKind::Box] {
            let footprint = footprint(&object(kind, [1.0, 0.0, 0.0, 0.0]));
            let reach = footprint.iter().map(|[_, y]| *y).fold(0.0, f64::max);
            assert!((reach - 2.0).abs() < 1e-6, "{kind:?}");
        }
    }

    #[test]
    fn a_hull_leaves_out_what_lies_inside_or_on_an_edge() {
        let points = vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0], [0.0, 0.0]];
        assert_eq!(hull(points), [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert_eq!(hull(vec![[1.0, 1.0], [1.0, 1.0]]).len(), 1);
    }
}
