use messages::{Detections, Track, TrackTable};

use crate::columns::Columns;

/// What places, speeds and extents of tracks are rounded to [m, m/s].
const UNIT: f64 = 0.001;
/// What the points of a trail, and the distance and time of an approach are rounded to [m, s].
const COARSE_UNIT: f64 = 0.01;
/// What the parts of a quaternion are rounded to.
const TURN_UNIT: f64 = 1e-4;
/// What probabilities of classes are rounded to, and of collisions.
const PROBABILITY_UNIT: f64 = 1e-3;
const COLLISION_UNIT: f64 = 1e-6;
/// Bits of a track's number in the lower of its two columns.
const LOW_BITS: u32 = 24;

/// Adds the tracks of a sweep in their order, and the trail of each: `t_…` of each track, `r_…` of each point of a trail,
/// trail after trail. `t_cluster` is the number of the first cluster that it was seen as, −1 where it was not seen.
pub(crate) fn put(
    table: &TrackTable,
    detections: Option<&Detections>,
    trails: &[Vec<[f32; 3]>],
    columns: &mut Columns,
) {
    let all = || table.tracks.iter();
    columns.integers("t_high", all().map(|track| (track.id >> LOW_BITS) as i32));
    columns.integers("t_low", all().map(|track| (track.id & ((1 << LOW_BITS) - 1)) as i32));
    columns.integers("t_state", all().map(|track| track.state as i32));
    columns.integers("t_class", all().map(|track| track.class as i32));
    columns.integers("t_alert", all().map(|track| track.alert.into()));
    columns.integers("t_age", all().map(|track| track.age_sweeps as i32));
    columns.integers("t_seen", all().map(|track| track.last_seen_sweeps as i32));
    columns.integers("t_cluster", all().map(|track| cluster(track, table, detections)));
    columns.integers("t_trail", trails.iter().map(|trail| trail.len() as i32));
    let mut put = |name, unit, value: &dyn Fn(&Track) -> f32| {
        columns.reals(name, unit, all().map(|track| value(track).into()));
    };
    put("t_p", PROBABILITY_UNIT, &|track| track.class.solid_index().map_or(0.0, |place| track.posterior[place]));
    for (axis, name) in ["t_x", "t_y", "t_z"].into_iter().enumerate() {
        put(name, UNIT, &|track| track.position_m[axis]);
    }
    for (axis, name) in ["t_u", "t_v", "t_w"].into_iter().enumerate() {
        put(name, UNIT, &|track| track.velocity_mps[axis]);
    }
    for (axis, name) in ["t_a", "t_b", "t_c"].into_iter().enumerate() {
        put(name, UNIT, &|track| track.size_m[axis]);
    }
    for (part, name) in ["t_qw", "t_qx", "t_qy", "t_qz"].into_iter().enumerate() {
        put(name, TURN_UNIT, &|track| track.attitude_wxyz[part]);
    }
    put("t_sigma", UNIT, &|track| sigma(track, 0));
    put("t_speed_sigma", UNIT, &|track| sigma(track, 3));
    put("t_time", COARSE_UNIT, &|track| track.approach.time_s);
    put("t_near", COARSE_UNIT, &|track| track.approach.distance_m);
    put("t_near_sigma", COARSE_UNIT, &|track| track.approach.distance_sigma_m);
    put("t_met", COLLISION_UNIT, &|track| track.approach.collision_probability);
    for (axis, name) in ["r_x", "r_y", "r_z"].into_iter().enumerate() {
        columns.reals(name, COARSE_UNIT, trails.iter().flatten().map(|at_m| at_m[axis].into()));
    }
}

/// Standard deviation of the three entries of its state from this one on, together.
fn sigma(track: &Track, from: usize) -> f32 {
    (from..from + 3).map(|entry| track.covariance_of(entry, entry)).sum::<f32>().max(0.0).sqrt()
}

/// A file may hold any place, so none is believed.
fn cluster(track: &Track, table: &TrackTable, detections: Option<&Detections>) -> i32 {
    let key = table.keys.get(track.first_key as usize).filter(|_| track.keys > 0);
    let number = key
        .zip(detections)
        .and_then(|(key, found)| found.detections.binary_search_by_key(key, |detection| detection.summary.key).ok());
    number.map_or(-1, |number| number as i32)
}

#[cfg(test)]
mod tests {
    use lidar::ObstacleClass;
    use messages::{ClosestApproach, ClusterSummary, Detection, TrackState};
    use zerocopy::FromZeros;

    use super::*;
    use crate::columns::decode;

    fn table() -> Box<TrackTable> {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        let mut seen = Track {
            id: (5 << LOW_BITS) + 3,
            position_m: [1.0005, -2.0, 300.0],
            velocity_mps: [0.25, 0.0, -1.0],
            size_m: [1.0, 1.0, 2.5],
            attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
            posterior: [0.0, 0.0, 0.0, 0.75],
            approach: ClosestApproach {
                time_s: 7.5,
                distance_m: 2.25,
                distance_sigma_m: 0.5,
                collision_probability: 1e-5,
            },
            keys: 1,
            age_sweeps: 12,
            state: TrackState::Confirmed,
            class: ObstacleClass::Conical,
            alert: 1,
            ..Track::default()
        };
        (seen.covariance[0], seen.covariance[15]) = (0.04, 0.0025);
        table.tracks.push(seen).unwrap();
        let lost = Track { id: 2, last_seen_sweeps: 4, state: TrackState::Coasting, ..Track::default() };
        table.tracks.push(lost).unwrap();
        table.keys.push(30).unwrap();
        table
    }

    fn detections() -> Box<Detections> {
        let mut found = Detections::new_box_zeroed().unwrap();
        for key in [10, 30] {
            let summary = ClusterSummary { key, points: 1, ..ClusterSummary::default() };
            found.detections.push(Detection { summary, ..Detection::default() }).unwrap();
        }
        found
    }

    #[test]
    fn tracks_come_in_their_order_with_their_clusters_and_trails() {
        let mut columns = Columns::default();
        let trails = [vec![[1.0, 2.0, 3.0], [0.5, 2.0, 3.0]], vec![]];
        put(&table(), Some(&detections()), &trails, &mut columns);
        let back = decode(&columns.finish().unwrap());
        let number = |place: usize| back["t_high"][place] * f64::from(1 << LOW_BITS) + back["t_low"][place];
        assert_eq!([number(0), number(1)], [f64::from((5 << LOW_BITS) + 3), 2.0]);
        for (name, values) in [
            ("t_state", [1.0, 2.0]),
            ("t_class", [4.0, 0.0]),
            ("t_alert", [1.0, 0.0]),
            ("t_seen", [0.0, 4.0]),
            ("t_cluster", [1.0, -1.0]),
            ("t_trail", [2.0, 0.0]),
        ] {
            assert_eq!(back[name], values, "{name}");
        }
        for (name, value) in [
            ("t_p", 0.75),
            ("t_x", 1.0005),
            ("t_z", 300.0),
            ("t_w", -1.0),
            ("t_c", 2.5),
            ("t_sigma", 0.2),
            ("t_speed_sigma", 0.05),
            ("t_time", 7.5),
            ("t_near", 2.25),
            ("t_met", 1e-5),
        ] {
            assert!((back[name][0] - value).abs() <= UNIT / 2.0 + 1e-6, "{name}: {}", back[name][0]);
        }
        assert_eq!(back["r_x"], [1.0, 0.5]);
    }

    #[test]
    fn keys_that_are_none_belong_to_no_cluster() {
        for spoil in [|track: &mut Track| track.first_key = u32::MAX, |track: &mut Track| track.keys = 0] {
            let mut table = table();
            spoil(&mut table.tracks[0]);
            assert_eq!(cluster(&table.tracks[0], &table, Some(&detections())), -1);
        }
        assert_eq!(cluster(&table().tracks[0], &table(), None), -1);
    }
}
