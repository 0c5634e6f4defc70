//! Which surface each firing of a sweep meets first.
//!
//! A ray is taken into the obstacle's unit frame: u = S⁻¹ Rᵀ (x − p), with p and R its centre and attitude and S half
//! its extents. Both are those of the ray's own firing time. Only a column's first firing gets an exact R; a time dt
//! later, Rᵀ y is taken for Rᵀ (y − dt ω × y). That is off by ½ (|ω| dt)² |y|: under 0.01 mm for the fastest spin of a
//! scene, a column of 160 µs and a point 5 m from the obstacle's centre.

use messages::NO_OBJECT;
use nalgebra::{Matrix3, Vector3};

use crate::ego::Ego;
use crate::obstacle::{Body, Obstacle, Pose, Shape};
use crate::solids::{Surface, UnitBall, UnitBox, UnitCone, UnitCylinder};
use crate::turn::Turn;
use crate::window::Window;

/// A sweep: when it begins, and how the sensor turns meanwhile.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) turn: &'a Turn,
    pub(crate) ego: &'a Ego,
    pub(crate) start_s: f64,
}

/// What a firing meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Distance along the ray [m]; infinite for a miss.
    pub(crate) range_m: f64,
    /// Cosine between ray and surface normal, 0 to 1.
    pub(crate) cosine: f32,
    /// Place of the obstacle in the scene, or [`NO_OBJECT`].
    pub(crate) owner: u16,
}

impl Hit {
    /// A ray that meets nothing.
    pub(crate) const MISS: Self = Self { range_m: f64::INFINITY, cosine: 0.0, owner: NO_OBJECT };
}

/// A small window of firings that holds all that can meet `obstacle` in a sweep that it begins at `start`.
pub(crate) fn window(view: View<'_>, obstacle: &Obstacle, start: &Pose) -> Window {
    let half_s = 0.5e-9 * view.turn.period_ns() as f64;
    // The ball round all places between the sweep's start and its end.
    let half_way = obstacle.motion.velocity_mps * half_s;
    let middle = start.position_m + half_way;
    let radius_m = obstacle.body.bounding_radius_m() + half_way.norm();
    if !view.ego.turns() {
        return Window::around(view.turn, &middle, radius_m);
    }
    // Half a sweep's turn takes nothing farther than the arc of the farthest place.
    let arc_m = view.ego.spin_radps.norm() * half_s * (middle.norm() + half_way.norm());
    Window::around(view.turn, &(view.ego.to_sensor(view.start_s + half_s) * middle), radius_m + arc_m)
}

/// Keeps in `hits` (column by column, in the order of rings) whatever `obstacle` shows nearer than what is there.
pub(crate) fn cast(view: View<'_>, obstacle: &Obstacle, start: &Pose, window: &Window, owner: u16, hits: &mut [Hit]) {
    let mut target = Target { view, obstacle, start, window, owner, hits };
    match &obstacle.body {
        Body::Solid { shape, size_m } => {
            let half_m = size_m * 0.5;
            match shape {
                Shape::Box => target.cast(&UnitBox, half_m),
                Shape::Ellipsoid => target.cast(&UnitBall, half_m),
                Shape::Cylinder => target.cast(&UnitCylinder, half_m),
                Shape::Cone => target.cast(&UnitCone, half_m),
            }
        }
        Body::Mesh(mesh) => target.cast(mesh.as_ref(), Vector3::repeat(1.0)),
    }
}

struct Target<'a> {
    view: View<'a>,
    obstacle: &'a Obstacle,
    start: &'a Pose,
    window: &'a Window,
    owner: u16,
    hits: &'a mut [Hit],
}

impl Target<'_> {
    fn cast(&mut self, surface: &impl Surface, scale_m: Vector3<f64>) {
        let motion = &self.obstacle.motion;
        let View { turn, ego, start_s } = self.view;
        let rings = turn.rings().len();
        let spins = motion.spin_radps != Vector3::zeros() || ego.turns();
        let (mut velocity_mps, mut spin_radps) = (motion.velocity_mps, motion.spin_radps);
        let mut to_unit = to_unit(self.start, &scale_m);
        for column in self.window.columns(turn) {
            let column_s = turn.column_s(column);
            let position_m = self.start.position_m + motion.velocity_mps * column_s;
            let mut pose = Pose { position_m, attitude: self.start.attitude };
            if spins {
                pose.attitude = motion.turned(&self.start.attitude, column_s);
            }
            if ego.turns() {
                let time_s = start_s + column_s;
                pose = ego.seen(&pose, time_s);
                velocity_mps = ego.to_sensor(time_s) * motion.velocity_mps - ego.spin_radps.cross(&pose.position_m);
                spin_radps = ego.to_sensor(time_s) * motion.spin_radps - ego.spin_radps;
            }
            if spins {
                to_unit = self::to_unit(&pose, &scale_m);
            }
            let centre_m = pose.position_m;
            let row = &mut self.hits[column * rings..(column + 1) * rings];
            for ring in self.window.rings.clone() {
                let beam_s = turn.beam_s(ring);
                let turned_on = |vector: Vector3<f64>| vector - spin_radps.cross(&vector) * beam_s;
                let origin = to_unit * turned_on(-(centre_m + velocity_mps * beam_s));
                let direction = to_unit * turned_on(turn.direction(column, ring));
                let Some(meeting) = surface.meet(&origin, &direction) else { continue };
                let hit = &mut row[ring];
                if meeting.distance < hit.range_m {
                    // A normal n of the unit frame is Aᵀ n in the sensor's, and d · Aᵀ n = A d · n.
                    let normal = to_unit.tr_mul(&meeting.normal).norm();
                    let cosine = if normal > 0.0 { direction.dot(&meeting.normal).abs() / normal } else { 1.0 };
                    *hit = Hit { range_m: meeting.distance, cosine: cosine as f32, owner: self.owner };
                }
            }
        }
    }
}

/// S⁻¹ Rᵀ.
fn to_unit(pose: &Pose, scale_m: &Vector3<f64>) -> Matrix3<f64> {
    let mut matrix = pose.attitude.to_rotation_matrix().into_inner().transpose();
    for (mut row, scale) in matrix.row_iter_mut().zip(scale_m.iter()) {
        row /= *scale;
    }
    matrix
}
