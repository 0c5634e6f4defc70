use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::Ray;
use super::rays::thin;
use super::start::view;

/// Frames found by [`Frames::find`].
pub(crate) const FRAMES: usize = 5;

/// Frames that [`turned`] adds.
pub(crate) const TURNED: usize = 4;

/// Most points that normals are taken of; more are thinned.
pub(crate) const MOST_POINTS: usize = 64;

/// Memory for the search of frames.
#[derive(Debug)]
pub(crate) struct Frames {
    hits: Vec<Ray>,
    points: Vec<Vector3<f64>>,
    order: Vec<(f64, u8)>,
    windows: Vec<Window>,
    near: Vec<[u8; MOST_WINDOW]>,
    normals: Vec<Vector3<f64>>,
}

const MOST_WINDOW: usize = 25;

#[derive(Clone, Copy, Debug)]
struct Window {
    normal: Vector3<f64>,
    values: [f64; 3],
}

impl Frames {
    pub(crate) fn new() -> Self {
        Self {
            hits: Vec::with_capacity(MOST_POINTS),
            points: Vec::with_capacity(MOST_POINTS),
            order: Vec::with_capacity(MOST_POINTS),
            windows: Vec::with_capacity(MOST_POINTS),
            near: Vec::with_capacity(MOST_POINTS),
            normals: Vec::with_capacity(MOST_POINTS),
        }
    }

    /// Frames from at most [`MOST_POINTS`] hits: principal axes, dominant normal, scatter of normals, the same about
    /// their mean (a cone's axis), and one that looks at the body over an edge.
    pub(crate) fn find(&mut self, hits: &[Ray]) -> [Matrix3<f64>; FRAMES] {
        thin(hits, MOST_POINTS, &mut self.hits);
        self.points.clear();
        self.points.extend(self.hits.iter().map(Ray::end_m));
        self.find_normals();
        let count = self.points.len() as f64;
        let mean: Vector3<f64> = self.points.iter().sum::<Vector3<f64>>() / count;
        let scatter: Matrix3<f64> = self.points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let principal = axes(&scatter).0;
        let normal_scatter: Matrix3<f64> = self.normals.iter().map(|n| n * n.transpose()).sum();
        let mean_normal: Vector3<f64> = self.normals.iter().sum::<Vector3<f64>>() / count;
        let centred: Matrix3<f64> =
            self.normals.iter().map(|n| (n - mean_normal) * (n - mean_normal).transpose()).sum();
        [
            principal,
            self.dominant(&principal),
            axes(&normal_scatter).0,
            axes(&centred).0,
            over_an_edge(&view(&mean, hits)),
        ]
    }

    /// Normals of planes through windows of neighbours; each point takes that of the flattest window it is in.
    fn find_normals(&mut self) {
        let count = self.points.len();
        let width = count.min((count / 5).clamp(7, MOST_WINDOW));
        self.windows.clear();
        self.near.clear();
        for (place, point) in self.points.iter().enumerate() {
            self.order.clear();
            self.order
                .extend(self.points.iter().enumerate().map(|(other, p)| ((p - point).norm_squared(), other as u8)));
            self.order[place].0 = -1.0;
            if width < count {
                self.order.select_nth_unstable_by(width - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            }
            let mut near = [0; MOST_WINDOW];
            let mut mean = Vector3::zeros();
            for (slot, &(_, other)) in near.iter_mut().zip(&self.order[..width]) {
                *slot = other;
                mean += self.points[usize::from(other)];
            }
            mean /= width as f64;
            let scatter: Matrix3<f64> = near[..width]
                .iter()
                .map(|&other| {
                    let offset = self.points[usize::from(other)] - mean;
                    offset * offset.transpose()
                })
                .sum();
            let (frame, values) = axes(&scatter);
            let normal: Vector3<f64> = frame.column(2).into();
            let normal = if normal.dot(point) > 0.0 { -normal } else { normal };
            self.windows.push(Window { normal, values });
            self.near.push(near);
        }
        self.normals.clear();
        self.normals.extend(self.windows.iter().map(|window| window.normal));
        self.order.clear();
        self.order.extend(self.windows.iter().map(|window| (window.values[2], 0)));
        for (window, near) in self.windows.iter().zip(&self.near) {
            if window.values[1] <= 0.05 * window.values[0] {
                continue;
            }
            for &other in &near[..width] {
                let other = usize::from(other);
                if window.values[2] < self.order[other].0 {
                    self.order[other].0 = window.values[2];
                    self.normals[other] = window.normal;
                }
            }
        }
    }

    /// The mean of the largest bundle of like normals, and the largest across it.
    fn dominant(&self, principal: &Matrix3<f64>) -> Matrix3<f64> {
        let first = bundle(self.normals.iter()).unwrap_or_else(Vector3::z);
        let across = || self.normals.iter().filter(|n| n.dot(&first).abs() < 0.4);
        let second = if across().nth(2).is_some() { bundle(across()) } else { None };
        let second = second.unwrap_or_else(|| principal.column(0).into());
        let second = second - first * first.dot(&second);
        let second = if second.norm() < 1e-6 { first.cross(&principal.column(1).into_owned()) } else { second };
        let second = second.try_normalize(1e-12).unwrap_or_else(|| any_across(&first));
        Matrix3::from_columns(&[first, second, first.cross(&second)])
    }
}

/// The first two frames turned by 45°: a box seen over an edge has its principal axes half-way between its faces.
pub(crate) fn turned(frames: &[Matrix3<f64>; FRAMES]) -> [Matrix3<f64>; TURNED] {
    let eighth = |frame: &Matrix3<f64>, about: usize| {
        let (i, j) = ((about + 1) % 3, (about + 2) % 3);
        let (a, b) = (frame.column(i).into_owned(), frame.column(j).into_owned());
        let mut turned = *frame;
        turned.set_column(i, &((a + b) * FRAC_1_SQRT_2));
        turned.set_column(j, &((b - a) * FRAC_1_SQRT_2));
        turned
    };
    [eighth(&frames[0], 0), eighth(&frames[0], 1), eighth(&frames[0], 2), eighth(&frames[1], 0)]
}

/// The mean direction of the largest set of normals within 18° of one of them; none where there are none.
fn bundle<'a>(normals: impl Iterator<Item = &'a Vector3<f64>> + Clone) -> Option<Vector3<f64>> {
    let mut best: Option<(usize, Vector3<f64>)> = None;
    for normal in normals.clone() {
        let (mut count, mut sum) = (0, Vector3::zeros());
        for other in normals.clone() {
            if other.dot(normal) > 0.95 {
                count += 1;
                sum += other;
            }
        }
        if best.is_none_or(|(most, _)| count > most) {
            best = Some((count, sum));
        }
    }
    best.and_then(|(_, sum)| sum.try_normalize(1e-12))
}

/// Eigenvectors by falling eigenvalue, right-handed.
fn axes(scatter: &Matrix3<f64>) -> (Matrix3<f64>, [f64; 3]) {
    let eigen = SymmetricEigen::new(*scatter);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let first: Vector3<f64> = eigen.eigenvectors.column(order[0]).into();
    let second: Vector3<f64> = eigen.eigenvectors.column(order[1]).into();
    (Matrix3::from_columns(&[first, second, first.cross(&second)]), order.map(|place| eigen.eigenvalues[place]))
}

/// All three near faces turned to the sensor alike.
fn over_an_edge(view: &Vector3<f64>) -> Matrix3<f64> {
    let right = view.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(|| any_across(view));
    let up = view.cross(&right);
    let third = (view * 0.6 + right * 0.57 + up * 0.56).normalize();
    let first = view * 0.6 - right * 0.57 + up * 0.56;
    let first = (first - third * third.dot(&first)).normalize();
    Matrix3::from_columns(&[first, third.cross(&first), third])
}

pub(crate) fn any_across(direction: &Vector3<f64>) -> Vector3<f64> {
    let helper = if direction.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    direction.cross(&helper).normalize()
}
