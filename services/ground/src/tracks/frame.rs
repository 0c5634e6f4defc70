//! Who is there and who is claimed, sweep by sweep: what measures of identity look at.

use lidar::ObstacleClass;
use messages::{SweepHeader, Track, TrackState, Truth};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::assignment::assign_within;

/// One obstacle as it truly is when the tracks are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Actual {
    pub(crate) id: u16,
    pub(crate) class: ObstacleClass,
    /// Whether its body looks the same however far it is turned about its z axis.
    pub(crate) is_round: bool,
    /// Centre \[m\], velocity \[m/s\] and spin \[rad/s\]: relative to the sensor, along its axes at the tracks' time.
    pub(crate) centre_m: Vector3<f64>,
    pub(crate) velocity_mps: Vector3<f64>,
    pub(crate) spin_radps: Vector3<f64>,
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) size_m: [f64; 3],
    /// Returns of this sweep that lie on it.
    pub(crate) returns: u32,
}

/// One sweep: truth and tracks at the same time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Looked {
    pub(crate) actual: Vec<Actual>,
    pub(crate) tracks: Vec<Track>,
}

/// The truth of a sweep's first firing, carried on to `time_ns` at constant velocity and spin; the sensor's own turn
/// with it, where the header knows one.
pub(crate) fn actual_at(truth: &Truth, header: &SweepHeader, time_ns: u64) -> Vec<Actual> {
    let dt_s = time_ns.wrapping_sub(truth.sensor_time_ns) as i64 as f64 * 1e-9;
    // Vectors along the axes of the sweep's start, along those of its end.
    let turned = header.ego.get().map_or(UnitQuaternion::identity(), |ego| {
        let [w, x, y, z] = ego.attitude_wxyz;
        let to_inertial = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        UnitQuaternion::from_scaled_axis(to_inertial.inverse() * Vector3::from(ego.spin_radps) * dt_s).inverse()
    });
    let vector = |v: [f32; 3]| Vector3::from(v.map(f64::from));
    let objects = truth.objects.iter().map(|object| {
        let (velocity_mps, spin_radps) = (vector(object.velocity_mps), vector(object.spin_radps));
        let [w, x, y, z] = object.attitude_wxyz.map(f64::from);
        let start = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Actual {
            id: object.id,
            class: object.class,
            is_round: matches!(object.class, ObstacleClass::Cylindrical | ObstacleClass::Conical),
            centre_m: turned * (vector(object.centre_m) + velocity_mps * dt_s),
            velocity_mps: turned * velocity_mps,
            spin_radps: turned * spin_radps,
            attitude: turned * UnitQuaternion::from_scaled_axis(spin_radps * dt_s) * start,
            size_m: object.size_m.map(f64::from),
            returns: object.returns,
        }
    });
    objects.collect()
}

/// Distance of a track's centre from an obstacle's \[m\].
pub(crate) fn distance_m(actual: &Actual, track: &Track) -> f64 {
    (actual.centre_m - Vector3::from(track.position_m.map(f64::from))).norm()
}

/// Whether a track is claimed to be there: a tentative one is not.
pub(crate) fn is_believed(track: &Track) -> bool {
    track.state != TrackState::Tentative
}

/// Obstacles and tracks that count, and how far they are apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Frame {
    pub(crate) actual: Vec<u16>,
    pub(crate) claimed: Vec<u64>,
    /// Row by row: a row for each of `actual` \[m\].
    pub(crate) distance_m: Vec<f64>,
}

impl Frame {
    /// Obstacles of at least `least_returns` and the tracks that are believed, without those tracks that lie on other
    /// obstacles.
    ///
    /// Obstacles in view with fewer returns are what the MOT challenges call ignored regions: not to see them is no miss,
    /// and to see them is no false track. What counts is paired first; of the tracks left over, those within `match_m`
    /// of an obstacle that does not count are left out.
    pub(crate) fn of(looked: &Looked, least_returns: u32, match_m: f64) -> Self {
        let (counted, ignored): (Vec<_>, Vec<_>) =
            looked.actual.iter().partition(|actual| actual.returns >= least_returns);
        let mut tracks: Vec<&Track> = looked.tracks.iter().filter(|track| is_believed(track)).collect();
        let is_paired = paired(&counted, &tracks, match_m);
        let rest: Vec<_> = tracks.iter().zip(&is_paired).filter(|(_, paired)| !**paired).map(|(t, _)| *t).collect();
        let elsewhere = paired(&ignored, &rest, match_m);
        let left_out: Vec<u64> = rest.iter().zip(elsewhere).filter(|(_, paired)| *paired).map(|(t, _)| t.id).collect();
        tracks.retain(|track| !left_out.contains(&track.id));
        Self {
            actual: counted.iter().map(|actual| actual.id).collect(),
            claimed: tracks.iter().map(|track| track.id).collect(),
            distance_m: distances(&counted, &tracks),
        }
    }

    pub(crate) fn distance_m(&self, row: usize, column: usize) -> f64 {
        self.distance_m[row * self.claimed.len() + column]
    }
}

pub(crate) fn distances(actual: &[&Actual], tracks: &[&Track]) -> Vec<f64> {
    actual.iter().flat_map(|actual| tracks.iter().map(|track| distance_m(actual, track))).collect()
}

/// Which of the tracks are paired with one of the obstacles.
fn paired(actual: &[&Actual], tracks: &[&Track], match_m: f64) -> Vec<bool> {
    let mut is_paired = vec![false; tracks.len()];
    for (_, column) in assign_within(&distances(actual, tracks), actual.len(), tracks.len(), match_m) {
        is_paired[column] = true;
    }
    is_paired
}

#[cfg(test)]
pub(crate) mod tests {
    use messages::{EgoMotion, TruthObject};
    use zerocopy::FromZeros;

    use super::*;

    /// An obstacle at rest with so many returns.
    pub(crate) fn actual(id: u16, at_m: [f64; 3], returns: u32) -> Actual {
        Actual {
            id,
            class: ObstacleClass::Rectangular,
            is_round: false,
            centre_m: at_m.into(),
            velocity_mps: Vector3::zeros(),
            spin_radps: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
            size_m: [1.0; 3],
            returns,
        }
    }

    /// A confirmed track at rest, of covariance 1.
    pub(crate) fn track(id: u64, at_m: [f64; 3]) -> Track {
        let mut track = Track { id, state: TrackState::Confirmed, ..Track::default() };
        track.position_m = at_m.map(|one| one as f32);
        for place in [0, 6, 11, 15, 18, 20] {
            track.covariance[place] = 1.0;
        }
        track
    }

    #[test]
    fn small_obstacles_are_neither_missed_nor_false() {
        let mut looked = Looked {
            actual: vec![actual(1, [5.0, 0.0, 0.0], 40), actual(2, [9.0, 0.0, 0.0], 4), actual(3, [0.0, 9.0, 0.0], 0)],
            tracks: vec![
                track(11, [5.1, 0.0, 0.0]),
                track(12, [9.5, 0.0, 0.0]),
                track(13, [-7.0, 0.0, 0.0]),
                track(14, [5.2, 0.0, 0.0]),
            ],
        };
        looked.tracks[2].state = TrackState::Coasting;
        let frame = Frame::of(&looked, 5, 2.0);
        assert_eq!((&frame.actual[..], &frame.claimed[..]), (&[1][..], &[11, 13, 14][..]));
        assert!((frame.distance_m(0, 1) - 12.0).abs() < 1e-6);
        looked.tracks[2].state = TrackState::Tentative;
        assert_eq!(Frame::of(&looked, 5, 2.0).claimed, [11, 14], "nobody believes in it");
        assert_eq!(Frame::of(&looked, 1, 2.0).actual, [1, 2]);
    }

    #[test]
    fn what_counts_is_paired_before_what_does_not() {
        // Nearer to the hidden obstacle than to the one that is seen.
        let looked = Looked {
            actual: vec![actual(1, [5.0, 0.0, 0.0], 40), actual(2, [6.0, 0.0, 0.0], 0)],
            tracks: vec![track(11, [5.9, 0.0, 0.0])],
        };
        assert_eq!(Frame::of(&looked, 5, 2.0).claimed, [11]);
    }

    #[test]
    fn truth_is_carried_on_to_the_time_of_the_tracks() {
        let mut truth = Truth::new_box_zeroed().unwrap();
        truth.sensor_time_ns = 1_000_000_000;
        let object = TruthObject {
            centre_m: [10.0, 0.0, 1.0],
            velocity_mps: [0.0, 1.0, 0.0],
            spin_radps: [0.0, 0.0, 1.0],
            attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
            ..TruthObject::default()
        };
        truth.objects.push(object).unwrap();
        let mut header = SweepHeader::default();
        let [at] = &actual_at(&truth, &header, 1_500_000_000)[..] else { panic!("one obstacle") };
        assert!((at.centre_m - Vector3::new(10.0, 0.5, 1.0)).norm() < 1e-6);
        assert!((at.attitude.angle() - 0.5).abs() < 1e-6);
        // The sensor turns a quarter to its left: what was before it is to its right.
        let half = std::f64::consts::FRAC_PI_2;
        header.ego =
            EgoMotion { attitude_wxyz: [1.0, 0.0, 0.0, 0.0], spin_radps: [0.0, 0.0, half], ..EgoMotion::default() };
        header.ego.known = 1;
        let [at] = &actual_at(&truth, &header, 2_000_000_000)[..] else { panic!("one obstacle") };
        assert!((at.centre_m - Vector3::new(1.0, -10.0, 1.0)).norm() < 1e-6, "{}", at.centre_m);
        assert!((at.velocity_mps - Vector3::new(1.0, 0.0, 0.0)).norm() < 1e-6);
    }
}
