//! Made-up obstacles and what the classifier would say of them. Each test file uses a part of it.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lidar::ObstacleClass;
use messages::{
    ClusterSummary, Detection, Detections, EgoMotion, Message, Part, Solid, Track, TrackState, Tracks, Verdict,
};
use nalgebra::{UnitQuaternion, Vector3};
use stage::Stage;
use tracker::{Params, Tracker};
use zerocopy::FromZeros;

/// 10 Hz.
pub(crate) const PERIOD_NS: u64 = 100_000_000;

pub(crate) fn params() -> Params {
    toml::from_str(include_str!("../../../../config/stages/tracker.toml")).unwrap()
}

/// A cluster, as seen from the sensor, and how it was fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) centre_m: [f64; 3],
    pub(crate) size_m: [f32; 3],
    pub(crate) points: u32,
    /// Share of the period at which its last return came.
    pub(crate) when: f64,
    pub(crate) class: ObstacleClass,
    pub(crate) fitted: bool,
    pub(crate) seam: u32,
}

impl Seen {
    /// An ellipsoid of 1 m, seen with 60 returns when the beam, turning clockwise from +x, passes it.
    pub(crate) fn at(x: f64, y: f64, z: f64) -> Self {
        let turned = (-y.atan2(x)).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        Self {
            centre_m: [x, y, z],
            size_m: [1.0; 3],
            points: 60,
            when: turned,
            class: ObstacleClass::Ellipsoidal,
            fitted: true,
            seam: 0,
        }
    }

    fn summary(&self, key: u32, first_member: u32) -> ClusterSummary {
        let centre = Vector3::from(self.centre_m);
        // What is visible lies before the centre.
        let half = f64::from(self.size_m.iter().sum::<f32>()) / 6.0;
        let centroid = centre - centre.normalize() * (0.65 * half);
        ClusterSummary {
            key,
            first_member,
            points: self.points,
            rings: 6,
            last_offset_ns: (self.when * PERIOD_NS as f64) as u32,
            seam: self.seam,
            centroid_m: centroid.map(|one| one as f32).into(),
        }
    }

    fn solid(&self) -> Solid {
        let mut solid =
            Solid { centre_m: self.centre_m.map(|one| one as f32), size_m: self.size_m, ..Solid::default() };
        for (row, sigma) in [0.02, 0.02, 0.02, 0.1, 0.1, 0.1, 0.03, 0.03, 0.03].into_iter().enumerate() {
            solid.covariance[row * 9 - row * (row + 1) / 2 + row] = sigma * sigma;
        }
        solid
    }
}

/// A message with those of the clusters that a test sends in one part, given by key.
pub(crate) fn message(sweep: u64, ego: EgoMotion, seen: &[(u32, Seen)]) -> Box<Detections> {
    let mut message = Detections::new_box_zeroed().unwrap();
    fill(&mut message, sweep, ego, seen);
    message
}

pub(crate) fn fill(message: &mut Detections, sweep: u64, ego: EgoMotion, seen: &[(u32, Seen)]) {
    message.clear();
    message.header.sensor_time_ns = start_ns(sweep);
    message.header.period_ns = PERIOD_NS;
    message.header.complete = 1;
    message.header.organised = 1;
    message.header.column_step_rad = 0.0126;
    message.header.ego = ego;
    for (key, one) in seen {
        let summary = one.summary(*key, message.members.len() as u32);
        message.members.resize_zeroed(message.members.len() + one.points as usize).unwrap();
        let mut detection = Detection { summary, first_solid: message.solids.len() as u32, ..Detection::default() };
        if one.fitted {
            detection.solids = 1;
            detection.class = one.class;
            detection.posterior = [0.1; 4];
            detection.posterior[one.class.solid_index().unwrap()] = 0.7;
            message.solids.push(one.solid()).unwrap();
        }
        message.detections.push(detection).unwrap();
    }
}

pub(crate) fn start_ns(sweep: u64) -> u64 {
    1_000_000_000 + sweep * PERIOD_NS
}

pub(crate) fn part(sweep: u64, sector: u32, sectors: u32) -> Part {
    let ordinal = sweep * u64::from(sectors) + u64::from(sector);
    Part { ordinal, sweep, sector, sectors, sensor_time_ns: start_ns(sweep), step: 0, attempt: 0 }
}

/// A room that is sent whole sweeps.
pub(crate) struct Played {
    pub(crate) room: Tracker,
    pub(crate) sweep: u64,
    pub(crate) output: Box<Tracks>,
    pub(crate) verdict: Verdict,
}

impl Played {
    pub(crate) fn new(params: Params) -> Self {
        let room = Tracker::init(params).unwrap();
        Self { room, sweep: 0, output: Tracks::new_box_zeroed().unwrap(), verdict: Verdict::Complete }
    }

    /// Sends the next sweep; clusters have their places as keys.
    pub(crate) fn sweep(&mut self, seen: &[Seen]) -> &[Track] {
        let keyed: Vec<(u32, Seen)> = seen.iter().enumerate().map(|(key, one)| (key as u32, *one)).collect();
        self.send(&message(self.sweep, EgoMotion::default(), &keyed))
    }

    /// Sends a message as the next sweep.
    pub(crate) fn send(&mut self, input: &Detections) -> &[Track] {
        self.output.clear();
        self.verdict = self.room.process(part(self.sweep, 0, 1), input, &mut self.output);
        self.sweep += 1;
        &self.output.table.tracks
    }

    /// The only track.
    pub(crate) fn only(&self) -> &Track {
        assert_eq!(self.output.table.tracks.len(), 1, "{:?}", self.output.table.tracks);
        &self.output.table.tracks[0]
    }

    pub(crate) fn keys(&self, track: usize) -> &[u32] {
        self.output.table.keys_of(&self.output.table.tracks[track])
    }

    pub(crate) fn states(&self) -> Vec<TrackState> {
        self.output.table.tracks.iter().map(|track| track.state).collect()
    }
}

/// Where something that moves evenly is when the beam passes it in a sweep.
pub(crate) fn moving(from: [f64; 3], velocity: [f64; 3], sweep: u64) -> Seen {
    let at = |t: f64| std::array::from_fn::<f64, 3, _>(|axis| from[axis] + velocity[axis] * t);
    let start = sweep as f64 * 0.1;
    let [x, y, z] = at(start);
    let first = Seen::at(x, y, z);
    let [x, y, z] = at(start + first.when * 0.1);
    Seen { when: first.when, ..Seen::at(x, y, z) }
}

/// The sensor's motion at the start of a sweep: from a place, evenly, turning evenly about an axis.
pub(crate) fn ego(sweep: u64, velocity_mps: [f64; 3], spin_radps: [f64; 3]) -> EgoMotion {
    let t = sweep as f64 * 0.1;
    let turned = UnitQuaternion::from_scaled_axis(Vector3::from(spin_radps) * t);
    EgoMotion {
        position_m: velocity_mps.map(|one| one * t),
        attitude_wxyz: [turned.w, turned.i, turned.j, turned.k],
        velocity_mps,
        spin_radps,
        known: 1,
    }
}

/// A place of the inertial frame as the sensor sees it that moves so, when its beam passes it.
pub(crate) fn seen_from(place: [f64; 3], sweep: u64, velocity_mps: [f64; 3], spin_radps: [f64; 3]) -> Seen {
    let at = |when: f64| {
        let t = (sweep as f64 + when) * 0.1;
        let turned = UnitQuaternion::from_scaled_axis(Vector3::from(spin_radps) * t);
        turned.inverse() * (Vector3::from(place) - Vector3::from(velocity_mps) * t)
    };
    let mut seen = Seen::at(1.0, 0.0, 0.0);
    for _ in 0..5 {
        let place = at(seen.when);
        seen = Seen::at(place.x, place.y, place.z);
    }
    seen
}
