use lidar::ObstacleClass;
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::{Bounded, Detections, Message};

/// Most obstacles that are tracked at a time.
pub const MAX_TRACKS: usize = 1_024;

/// Most clusters of a sweep that tracks are made of.
pub const MAX_TRACK_KEYS: usize = 4 * MAX_TRACKS;

/// Entries of the covariance of position and velocity: its upper triangle.
pub const TRACK_COVARIANCE: usize = 21;

/// How far a track may be believed in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(u8)]
pub enum TrackState {
    /// Seen too seldom to be believed: it may be clutter.
    #[default]
    Tentative = 0,
    /// Seen often enough, and measured in this sweep.
    Confirmed = 1,
    /// Confirmed, but what was seen in this sweep, if anything, did not tell where it is: propagated.
    Coasting = 2,
}

impl TrackState {
    /// The state's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tentative => "tentative",
            Self::Confirmed => "confirmed",
            Self::Coasting => "coasting",
        }
    }
}

/// How near an obstacle comes to the sensor within the horizon, if both go on as they do.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct ClosestApproach {
    /// When, after the time of the tracks [s]; 0 where it only goes away.
    pub time_s: f32,
    /// Distance of the obstacle's centre then [m].
    pub distance_m: f32,
    /// Standard deviation of that distance [m].
    pub distance_sigma_m: f32,
    /// Probability that own radius and obstacle touch within the horizon, 0 to 1.
    pub collision_probability: f32,
}

/// One obstacle through time, as it is at [`TrackTable::time_ns`].
///
/// Position and velocity are those relative to the sensor, along the sensor's axes at that time. They may be propagated
/// ([`Track::at`]) until the track is no longer valid, and not beyond.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Track {
    /// Its number: never given twice in a run, whatever was restarted.
    pub id: u64,
    /// Sensor time of its last detection [ns].
    pub last_seen_ns: u64,
    /// Sensor time beyond which nobody may act on it [ns].
    pub valid_until_ns: u64,
    /// Middle of the obstacle's box [m].
    pub position_m: [f32; 3],
    /// Velocity of that middle [m/s].
    pub velocity_mps: [f32; 3],
    /// Covariance of position [m] and velocity [m/s]: the upper triangle, row by row.
    pub covariance: [f32; TRACK_COVARIANCE],
    /// Full extents along the body's axes [m], as in [`crate::Solid`]; all 0 where no solid was ever fitted.
    pub size_m: [f32; 3],
    /// Standard deviations of the extents [m].
    pub size_sigma_m: [f32; 3],
    /// Rotation from body to sensor frame at the last fit, unit quaternion; the identity where there was none.
    pub attitude_wxyz: [f32; 4],
    /// Angular velocity [rad/s]; 0 where it is not observed.
    pub spin_radps: [f32; 3],
    /// Standard deviation of the angular velocity along each axis [rad/s]; 0 where it is not observed.
    pub spin_sigma_radps: f32,
    /// Probability of each of [`ObstacleClass::SOLIDS`], over all sweeps; sums to 1, or all 0 for `Unclassified`.
    pub posterior: [f32; 4],
    /// How near it comes; all 0 for a tentative track.
    pub approach: ClosestApproach,
    /// Place of its first cluster in the message's `keys`.
    pub first_key: u32,
    /// Clusters that it was seen as in this sweep: 0 where it was not seen, more than 1 where it is split.
    pub keys: u32,
    /// Sweeps since its birth; 1 in the sweep of its birth.
    pub age_sweeps: u32,
    /// Sweeps since its last detection; 0 when seen in this sweep.
    pub last_seen_sweeps: u32,
    /// How far it may be believed in.
    pub state: TrackState,
    /// The likeliest class over all sweeps.
    pub class: ObstacleClass,
    /// 1 as long as it is likelier to be met than the tracker's parameters allow.
    pub alert: u8,
    /// Fills the struct to a multiple of its alignment.
    pub reserved: u8,
}

/// Where a track is at some time, and how well that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propagated {
    /// Middle of the obstacle's box [m], sensor axes at [`TrackTable::time_ns`], relative to the sensor.
    pub position_m: [f32; 3],
    /// Covariance of that position [m²]: the upper triangle, row by row.
    pub covariance_m2: [f32; 6],
}

/// A track was asked for at a time for which it says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stale {
    /// Time that was asked for [ns].
    pub asked_ns: u64,
    /// Last time for which the track may be used [ns].
    pub valid_until_ns: u64,
}

impl std::fmt::Display for Stale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "asked for at {} ns, valid until {} ns", self.asked_ns, self.valid_until_ns)
    }
}

impl std::error::Error for Stale {}

impl Track {
    /// Places of its clusters' keys in the message's `keys`; beyond them where the track comes from elsewhere and contradicts
    /// itself.
    pub fn key_places(&self) -> std::ops::Range<usize> {
        let first = self.first_key as usize;
        first..first.saturating_add(self.keys as usize)
    }

    /// Covariance of two of position (0 to 2) and velocity (3 to 5); 0 for one that is none.
    pub fn covariance_of(&self, one: usize, other: usize) -> f32 {
        let (row, column) = (one.min(other), one.max(other));
        if column >= 6 {
            return 0.0;
        }
        self.covariance[row * 6 - row * (row + 1) / 2 + column]
    }

    /// Where it is at `at_ns`, propagated from `time_ns` of its table at constant velocity; an error for a time at which
    /// it is no longer valid. Times before the table's are answered, too.
    pub fn at(&self, time_ns: u64, at_ns: u64) -> Result<Propagated, Stale> {
        if at_ns > self.valid_until_ns {
            return Err(Stale { asked_ns: at_ns, valid_until_ns: self.valid_until_ns });
        }
        let dt_s = (at_ns as i64).wrapping_sub(time_ns as i64) as f32 * 1e-9;
        let position_m = std::array::from_fn(|axis| self.position_m[axis] + dt_s * self.velocity_mps[axis]);
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let covariance_m2 = pairs.map(|(row, column)| {
            let mixed = self.covariance_of(row, column + 3) + self.covariance_of(row + 3, column);
            self.covariance_of(row, column) + dt_s * mixed + dt_s * dt_s * self.covariance_of(row + 3, column + 3)
        });
        Ok(Propagated { position_m, covariance_m2 })
    }
}

/// The obstacles through time, at the end of a sweep.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct TrackTable {
    /// Sensor time that the tracks are propagated to: the end of the sweep [ns]; 0 where there is no table.
    pub time_ns: u64,
    /// The tracks: most dangerous first, then in order of their numbers.
    pub tracks: Bounded<Track, MAX_TRACKS>,
    /// Keys of the clusters that tracks were seen as: track after track, of each track in order.
    pub keys: Bounded<u32, MAX_TRACK_KEYS>,
}

impl TrackTable {
    /// Keys of the clusters that one of its tracks was seen as.
    pub fn keys_of(&self, track: &Track) -> &[u32] {
        self.keys.get(track.key_places()).unwrap_or_default()
    }
}

impl Message for TrackTable {
    const TYPE: &'static str = "encke.TrackTable.1";

    fn clear(&mut self) {
        self.time_ns = 0;
        self.tracks.clear();
        self.keys.clear();
    }
}

/// Detections of a sweep, and with its last part the obstacles through time.
#[derive(Debug, FromZeros, Immutable, KnownLayout)]
#[repr(C)]
pub struct Tracks {
    /// As the classifier gave them.
    pub detections: Detections,
    /// Empty in parts before a sweep's last.
    pub table: TrackTable,
}

impl Message for Tracks {
    const TYPE: &'static str = "encke.Tracks.1";

    fn clear(&mut self) {
        self.detections.clear();
        self.table.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving() -> Track {
        let mut track = Track { position_m: [1.0, 2.0, 3.0], velocity_mps: [10.0, 0.0, -1.0], ..Track::default() };
        track.covariance = std::array::from_fn(|place| place as f32);
        track.valid_until_ns = 5_500_000_000;
        track
    }

    #[test]
    fn a_track_is_propagated_with_all_of_its_covariance() {
        let there = moving().at(5_000_000_000, 5_500_000_000).unwrap();
        assert_eq!(there.position_m, [6.0, 2.0, 2.5]);
        // P(0,0) + 2·½·P(0,3) + ¼·P(3,3), by the places of the triangle.
        assert_eq!(there.covariance_m2[0], 0.0 + 3.0 + 0.25 * 15.0);
        // P(0,2) + ½·(P(0,5) + P(2,3)) + ¼·P(3,5).
        assert_eq!(there.covariance_m2[2], 2.0 + 0.5 * (5.0 + 12.0) + 0.25 * 17.0);
    }

    #[test]
    fn nobody_learns_where_a_track_is_after_it_went_stale() {
        let asked_ns = 5_500_000_001;
        assert_eq!(moving().at(5_000_000_000, asked_ns), Err(Stale { asked_ns, valid_until_ns: 5_500_000_000 }));
    }

    #[test]
    fn keys_that_no_table_can_hold_are_none() {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        table.keys.push(7).unwrap();
        let keys = |first_key, keys| table.keys_of(&Track { first_key, keys, ..Track::default() }).to_vec();
        assert_eq!(keys(0, 1), [7]);
        for (first, count) in [(0, 2), (1, 1), (u32::MAX, 1), (1, u32::MAX), (u32::MAX, u32::MAX)] {
            assert!(keys(first, count).is_empty(), "{count} from {first}");
        }
    }

    #[test]
    fn the_triangle_holds_every_pair_once() {
        let track = moving();
        let mut seen = [false; TRACK_COVARIANCE];
        for row in 0..6 {
            for column in row..6 {
                let place = track.covariance_of(row, column);
                assert_eq!(place, track.covariance_of(column, row));
                assert!(!std::mem::replace(&mut seen[place as usize], true));
            }
        }
        assert!(seen.iter().all(|&one| one));
        assert_eq!(track.covariance_of(0, 6), 0.0);
    }
}
