use std::collections::BTreeMap;

use messages::{SweepHeader, TrackState, TrackTable};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Time that a trail spans [ns].
pub(crate) const TRAIL_NS: u64 = 3_000_000_000;
/// Least time between two points of a trail [ns].
const STEP_NS: u64 = 150_000_000;

/// Where tracks were, sweep after sweep: what trails are drawn from.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    sweeps: BTreeMap<u32, Places>,
    turns: BTreeMap<u32, Turning>,
}

/// Those of one sweep, in order of their numbers.
#[derive(Debug)]
struct Places {
    time_ns: u64,
    tracks: Vec<(u64, [f32; 3])>,
}

/// How the sensor lay and turned at the beginning of a sweep, in an inertial frame.
#[derive(Clone, Copy, Debug)]
struct Turning {
    start_ns: u64,
    attitude: UnitQuaternion<f64>,
    spin_radps: Vector3<f64>,
}

impl Turning {
    /// None where it is not known, or is no motion: a file may hold any number.
    fn of(header: &SweepHeader) -> Option<Self> {
        let ego = header.ego.get()?;
        let [w, x, y, z] = ego.attitude_wxyz;
        let attitude = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)?;
        let is_motion = attitude.coords.iter().chain(&ego.spin_radps).all(|value| value.abs() < 1e3);
        is_motion.then(|| Self { start_ns: header.sensor_time_ns, attitude, spin_radps: ego.spin_radps.into() })
    }

    /// Rotation from the sensor's axes at a sensor time to the inertial frame.
    fn at(&self, time_ns: u64) -> UnitQuaternion<f64> {
        let since_s = time_ns.wrapping_sub(self.start_ns) as i64 as f64 * 1e-9;
        UnitQuaternion::from_scaled_axis(self.spin_radps * since_s) * self.attitude
    }
}

impl Places {
    fn of(&self, track: u64) -> Option<[f32; 3]> {
        let place = self.tracks.binary_search_by_key(&track, |(number, _)| *number).ok()?;
        self.tracks.get(place).map(|(_, at_m)| *at_m)
    }
}

impl Paths {
    /// Notes the table of a sweep. Tentative tracks leave no trail: most of them are clutter.
    pub(crate) fn note(&mut self, sweep: u32, table: &TrackTable) {
        let believed = table.tracks.iter().filter(|track| track.state != TrackState::Tentative);
        let mut tracks: Vec<_> = believed.map(|track| (track.id, track.position_m)).collect();
        tracks.sort_unstable_by_key(|(number, _)| *number);
        self.sweeps.insert(sweep, Places { time_ns: table.time_ns, tracks });
    }

    /// Notes how the sensor lay in a sweep, where that is known.
    pub(crate) fn note_turn(&mut self, sweep: u32, header: &SweepHeader) {
        if let Some(turn) = Turning::of(header) {
            self.turns.insert(sweep, turn);
        }
    }

    /// Forgets all but so many sweeps, the newest.
    pub(crate) fn keep(&mut self, sweeps: usize) {
        while self.sweeps.len() > sweeps {
            self.sweeps.pop_first();
        }
        while self.turns.len() > sweeps {
            self.turns.pop_first();
        }
    }

    /// Rotation from the sensor's axes at the end of a sweep to the inertial frame, where that is known.
    fn attitude(&self, sweep: u32, time_ns: u64) -> Option<UnitQuaternion<f64>> {
        self.turns.get(&sweep).map(|turn| turn.at(time_ns))
    }

    /// Where each track of a sweep's table was before [m], relative to the sensor, the latest first; back to where the track
    /// began, was not known, or the sensor's clock was set. Along the axes that the sensor has now, so that what goes
    /// straight leaves a straight trail, however the sensor turns; where now's are not known, along those of then.
    pub(crate) fn trails(&self, sweep: u32, table: &TrackTable) -> Vec<Vec<[f32; 3]>> {
        let now = self.attitude(sweep, table.time_ns);
        let mut before = Vec::new();
        let (mut last_ns, mut shown_ns) = (table.time_ns, table.time_ns);
        for (&number, places) in self.sweeps.range(..sweep).rev() {
            if places.time_ns >= last_ns || table.time_ns - places.time_ns > TRAIL_NS {
                break;
            }
            last_ns = places.time_ns;
            let then = self.attitude(number, places.time_ns);
            let turn = match (now, then) {
                (Some(now), Some(then)) => now.inverse() * then,
                // A place along axes of which nobody knows how they lay is none.
                (Some(_), None) => continue,
                (None, _) => UnitQuaternion::identity(),
            };
            if shown_ns - last_ns >= STEP_NS {
                shown_ns = last_ns;
                before.push((places, turn.cast::<f32>()));
            }
        }
        let trail = |track: u64| {
            let places = before.iter().map_while(|(places, turn)| places.of(track).map(|at_m| (at_m, turn)));
            places.map(|(at_m, turn)| (turn * Vector3::from(at_m)).into()).collect()
        };
        table.tracks.iter().map(|track| trail(track.id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use messages::{EgoMotion, Track};
    use zerocopy::FromZeros;

    use super::*;

    fn table(time_ms: u64, tracks: &[(u64, f32)]) -> Box<TrackTable> {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        table.time_ns = time_ms * 1_000_000;
        for &(id, x) in tracks {
            let track = Track { id, position_m: [x, 0.0, 0.0], state: TrackState::Confirmed, ..Track::default() };
            table.tracks.push(track).unwrap();
        }
        table
    }

    /// The trails' x.
    fn trails(sut: &Paths, sweep: u32, table: &TrackTable) -> Vec<Vec<f32>> {
        let xs = |trail: Vec<[f32; 3]>| trail.into_iter().map(|[x, ..]| x).collect();
        sut.trails(sweep, table).into_iter().map(xs).collect()
    }

    #[test]
    fn a_trail_goes_back_three_seconds_in_steps_and_each_track_has_its_own() {
        let mut sut = Paths::default();
        let at = |sweep: u32| table(1_000 + 100 * u64::from(sweep), &[(9, sweep as f32), (2, -1.0)]);
        (0..=40).for_each(|sweep| sut.note(sweep, &at(sweep)));
        let [first, second] = &trails(&sut, 40, &at(40))[..] else { panic!("two tracks") };
        assert_eq!(first[..], (5..20).rev().map(|place| 2.0 * place as f32).collect::<Vec<_>>());
        assert_eq!(second[..], [-1.0; 15]);
        sut.keep(3);
        assert_eq!(trails(&sut, 40, &at(40))[0], [38.0]);
    }

    #[test]
    fn a_trail_ends_where_its_track_was_not_there_and_where_the_clock_was_set() {
        let mut sut = Paths::default();
        sut.note(0, &table(1_000, &[(7, 0.0)]));
        sut.note(1, &table(1_200, &[]));
        sut.note(2, &table(1_400, &[(7, 2.0)]));
        assert_eq!(trails(&sut, 3, &table(1_600, &[(7, 3.0), (8, 0.0)])), [vec![2.0], vec![]]);
        assert_eq!(trails(&sut, 3, &table(900, &[(7, 3.0)])), [vec![0.0; 0]], "the clock was set back");
        assert_eq!(trails(&sut, 3, &table(90_000, &[(7, 3.0)])), [vec![0.0; 0]], "or on");
    }

    #[test]
    fn tentative_tracks_leave_no_trail() {
        let mut sut = Paths::default();
        let mut early = table(1_000, &[(7, 0.0)]);
        early.tracks[0].state = TrackState::Tentative;
        sut.note(0, &early);
        assert_eq!(trails(&sut, 1, &table(1_200, &[(7, 1.0)])), [vec![0.0; 0]]);
    }

    /// A sensor that turns about z by 0.5 rad/s, at a sensor time; not known before the second second.
    fn turning(time_ms: u64) -> SweepHeader {
        let half_rad = 0.25 * time_ms as f64 * 1e-3;
        let ego = EgoMotion {
            attitude_wxyz: [half_rad.cos(), 0.0, 0.0, half_rad.sin()],
            spin_radps: [0.0, 0.0, 0.5],
            known: u64::from(time_ms >= 2_000),
            ..EgoMotion::default()
        };
        SweepHeader { sensor_time_ns: time_ms * 1_000_000, ego, ..SweepHeader::default() }
    }

    #[test]
    fn what_goes_straight_leaves_a_straight_trail_however_the_sensor_turns() {
        let mut sut = Paths::default();
        // Along x of the inertial frame, as the sensor sees it at the end of its sweep.
        let at = |time_ms: u64| {
            let (sin, cos) = (0.5e-3 * time_ms as f32).sin_cos();
            let mut table = table(time_ms, &[(7, 0.0)]);
            let x_m = time_ms as f32 * 1e-3;
            table.tracks[0].position_m = [x_m * cos + 9.0 * sin, 9.0 * cos - x_m * sin, 0.5];
            table
        };
        for sweep in 0..50_u32 {
            let time_ms = 100 * u64::from(sweep);
            sut.note_turn(sweep, &turning(time_ms));
            sut.note(sweep, &at(time_ms + 100));
        }
        let now = at(5_000);
        let trail = &sut.trails(49, &now)[0];
        assert_eq!(trail.len(), 14, "sweeps 47, 45, … 21: before, nobody knew how the sensor lay");
        let (sin, cos) = 2.5_f32.sin_cos();
        for (place, [x_m, y_m, z_m]) in trail.iter().enumerate() {
            // Back in the inertial frame.
            let [back_x_m, back_y_m] = [x_m * cos - y_m * sin, x_m * sin + y_m * cos];
            assert!((back_x_m - (4.8 - 0.2 * place as f32)).abs() < 1e-4, "{place}: {back_x_m}");
            assert!((back_y_m - 9.0).abs() < 1e-4 && *z_m == 0.5, "{place}: {back_y_m}");
        }
        sut.keep(1);
        assert_eq!((sut.sweeps.len(), sut.turns.len()), (1, 1));
    }

    #[test]
    fn a_motion_that_is_none_counts_as_not_known() {
        let good = turning(3_000);
        assert!(Turning::of(&good).is_some());
        for (attitude_wxyz, spin_radps) in [
            ([0.0; 4], [0.0; 3]),
            ([f64::NAN; 4], [0.0; 3]),
            ([f64::INFINITY, 0.0, 0.0, 0.0], [0.0; 3]),
            (good.ego.attitude_wxyz, [0.0, f64::NAN, 0.0]),
            (good.ego.attitude_wxyz, [1e300, 0.0, 0.0]),
        ] {
            let ego = EgoMotion { attitude_wxyz, spin_radps, ..good.ego };
            assert!(Turning::of(&SweepHeader { ego, ..good }).is_none(), "{attitude_wxyz:?} {spin_radps:?}");
        }
    }
}
