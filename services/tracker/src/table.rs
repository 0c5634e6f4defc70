use messages::{ClosestApproach, MAX_TRACKS, TRACK_COVARIANCE, Track, TrackTable};
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3};

use crate::danger::{Body, foresee};
use crate::frame::Pose;
use crate::spin::{Observed, SpinEstimate};
use crate::tracked::Tracked;
use crate::tracking::Sweep;

/// The clusters that tracks were seen as: pairs of a track's place and a cluster's key, in order.
pub(crate) type Seen = Vec<(u32, u32)>;

/// Where tracks are put in order before they are written; all memory is taken at once.
#[derive(Debug)]
pub(crate) struct Order(Vec<(Track, u32)>);

impl Order {
    pub(crate) fn new() -> Self {
        Self(Vec::with_capacity(MAX_TRACKS))
    }

    /// Writes the tracks as they are at the end of a sweep: the most dangerous first, then in order of their numbers.
    pub(crate) fn write(&mut self, tracks: &[Tracked], seen: &Seen, sweep: &Sweep<'_>, table: &mut TrackTable) {
        let pose = sweep.frame.at(sweep.end_ns);
        self.0.clear();
        for (place, track) in tracks.iter().enumerate() {
            self.0.push((said(track, sweep, &pose), place as u32));
        }
        self.0.sort_unstable_by(|(a, _), (b, _)| {
            let danger = |track: &Track| track.approach.collision_probability;
            danger(b).total_cmp(&danger(a)).then(a.id.cmp(&b.id))
        });
        table.time_ns = sweep.end_ns;
        for (track, place) in &self.0 {
            let from = seen.partition_point(|pair| pair.0 < *place);
            let to = seen.partition_point(|pair| pair.0 <= *place);
            let first_key = table.keys.len() as u32;
            for &(_, key) in &seen[from..to] {
                // Cannot overflow: MAX_SIGHTINGS and MAX_TRACKS together are as many.
                let _ = table.keys.push(key);
            }
            let keys = table.keys.len() as u32 - first_key;
            // Cannot overflow: there are no more tracks.
            let _ = table.tracks.push(Track { first_key, keys, ..*track });
        }
    }
}

/// What the message says of a track, but for its keys.
fn said(track: &Tracked, sweep: &Sweep<'_>, pose: &Pose) -> Track {
    let Sweep { end_ns, params, .. } = *sweep;
    let to_sensor = pose.attitude.inverse();
    let position = to_sensor * (track.expected_m(end_ns) - pose.position_m);
    let velocity = to_sensor * (track.filter.velocity_mps() - sweep.frame.velocity_mps);
    let covariance = turned(&track.kinematic(end_ns, params), &to_sensor);
    let (age_sweeps, last_seen_sweeps) = track.life.ages(sweep.number);
    let (size_m, size_sigma_m, attitude) = extents(track, &to_sensor);
    let state = track.life.state(sweep.number);
    let spin = track.spin.map(|spin| spin.estimate(&params.spin)).unwrap_or_default();
    let approach = match track.life.is_confirmed() {
        true => {
            let body = body(track, sweep, &to_sensor, &spin, size_sigma_m.map(f64::from));
            foresee(&position, &velocity, &covariance, &body, params.danger.own_radius_m, params.danger.horizon_s)
        }
        false => ClosestApproach::default(),
    };
    let alert = age_sweeps >= params.danger.alert_age_sweeps
        && f64::from(approach.collision_probability) >= params.danger.alert_probability;
    Track {
        id: track.id,
        last_seen_ns: track.seen_ns,
        valid_until_ns: end_ns.saturating_add((params.lifecycle.valid_s * 1e9) as u64),
        position_m: position.map(|one| one as f32).into(),
        velocity_mps: velocity.map(|one| one as f32).into(),
        covariance: triangle(&covariance),
        size_m,
        size_sigma_m,
        attitude_wxyz: attitude,
        spin_radps: (to_sensor * spin.radps).map(|one| one as f32).into(),
        spin_sigma_radps: spin.sigma_radps as f32,
        posterior: track.belief.posterior().map(|one| one as f32),
        approach,
        age_sweeps,
        last_seen_sweeps,
        state,
        class: track.belief.class(),
        alert: u8::from(alert && track.life.is_confirmed()),
        ..Track::default()
    }
}

/// How the obstacle turns from the end of the sweep on. Of what is not observed of its spin no more is known than before
/// the first fit.
fn body(
    track: &Tracked,
    sweep: &Sweep<'_>,
    to_sensor: &UnitQuaternion<f64>,
    spin: &SpinEstimate,
    size_sigma_m: [f64; 3],
) -> Body {
    let params = &sweep.params.spin;
    let fitted = track.solid.map_or_else(UnitQuaternion::identity, |solid| solid.attitude);
    let since_s = sweep.end_ns.saturating_sub(track.seen_ns) as f64 * 1e-9;
    let attitude = to_sensor * UnitQuaternion::from_scaled_axis(spin.radps * since_s) * fitted;
    let axis = attitude * Vector3::z();
    let (known, unknown) = (spin.sigma_radps.powi(2), params.prior_radps.powi(2));
    let spin_covariance = match spin.observed {
        Observed::Nothing => Matrix3::from_diagonal_element(unknown),
        Observed::AcrossAxis => Matrix3::from_diagonal_element(known) + axis * axis.transpose() * unknown,
        Observed::Whole => Matrix3::from_diagonal_element(known),
    };
    Body {
        class: track.belief.class(),
        size_m: reckoned_m(track),
        size_sigma_m,
        attitude,
        spin_radps: to_sensor * spin.radps,
        spin_covariance,
        spin_wander_radps: params.wander_radps,
    }
}

/// Extents along the body's axes that danger is reckoned with [m]: those expected where none were measured.
fn reckoned_m(track: &Tracked) -> [f64; 3] {
    let order = track.solid.map_or([0, 1, 2], |solid| solid.order);
    let mut size_m = [0.0; 3];
    for (rank, &axis) in order.iter().enumerate() {
        size_m[axis] = track.filter.size_m()[rank].max(0.0);
    }
    size_m
}

/// Extents along the axes of the body of the last fit, their standard deviations, and that body's attitude.
fn extents(track: &Tracked, to_sensor: &UnitQuaternion<f64>) -> ([f32; 3], [f32; 3], [f32; 4]) {
    let Some(solid) = track.solid else { return ([0.0; 3], [0.0; 3], [1.0, 0.0, 0.0, 0.0]) };
    let (size, covariance) = (track.filter.size_m(), track.filter.size_covariance());
    let (mut size_m, mut sigma_m) = ([0.0; 3], [0.0; 3]);
    for (rank, &axis) in solid.order.iter().enumerate() {
        size_m[axis] = size[rank].max(0.0) as f32;
        sigma_m[axis] = covariance[(rank, rank)].max(0.0).sqrt() as f32;
    }
    let attitude = to_sensor * solid.attitude;
    (size_m, sigma_m, [attitude.w, attitude.i, attitude.j, attitude.k].map(|one| one as f32))
}

/// A covariance of position and velocity along other axes.
fn turned(covariance: &Matrix6<f64>, turn: &UnitQuaternion<f64>) -> Matrix6<f64> {
    let turn = turn.to_rotation_matrix();
    let block = |row, column| turn.matrix() * covariance.fixed_view::<3, 3>(row, column) * turn.matrix().transpose();
    let mut all = Matrix6::zeros();
    for (row, column) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
        let turned: Matrix3<f64> = block(row, column);
        all.fixed_view_mut::<3, 3>(row, column).copy_from(&turned);
    }
    all
}

fn triangle(covariance: &Matrix6<f64>) -> [f32; TRACK_COVARIANCE] {
    let mut entries = [0.0; TRACK_COVARIANCE];
    let places = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    for (entry, place) in entries.iter_mut().zip(places) {
        *entry = covariance[place] as f32;
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_covariance_belongs_to_turned_errors() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.9);
        let root = Matrix6::from_fn(|row, column| ((row * 7 + column * 3) % 5) as f64 - 1.5);
        let covariance = root * root.transpose();
        let mut both = Matrix6::zeros();
        for at in [0, 3] {
            both.fixed_view_mut::<3, 3>(at, at).copy_from(turn.to_rotation_matrix().matrix());
        }
        assert!((turned(&covariance, &turn) - both * covariance * both.transpose()).abs().max() < 1e-12);
    }

    #[test]
    fn the_triangle_is_written_as_the_message_reads_it() {
        let covariance = Matrix6::from_fn(|row, column| (row.min(column) * 10 + row.max(column)) as f64);
        let track = Track { covariance: triangle(&covariance), ..Track::default() };
        for row in 0..6 {
            for column in 0..6 {
                assert_eq!(f64::from(track.covariance_of(row, column)), covariance[(row, column)]);
            }
        }
    }
}
