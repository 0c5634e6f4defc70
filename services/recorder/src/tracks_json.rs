//! Sweep → one JSON line of tracks. Numbers are the shortest that read back as the same value, so equal tracks are equal
//! bytes.

use lidar::ObstacleClass;
use messages::{ClosestApproach, Track, TrackState};
use serde::ser::SerializeSeq;
use serde::{Serialize, Serializer};

use crate::assemble::SweepRows;
use crate::detections_json::Posterior;

/// Appends the sweep's line, its end included. Time and tracks are null where the sweep has no table: that is no sweep
/// without obstacles.
pub(crate) fn write_line(sweep: &SweepRows, line: &mut Vec<u8>) -> Result<(), serde_json::Error> {
    let has_table = sweep.tracks_ns > 0;
    serde_json::to_writer(
        &mut *line,
        &Line {
            sweep: sweep.part.sweep,
            time_ns: has_table.then_some(sweep.tracks_ns),
            tracks: has_table.then_some(Rows(sweep)),
        },
    )?;
    line.push(b'\n');
    Ok(())
}

#[derive(Serialize)]
struct Line<'a> {
    sweep: u64,
    time_ns: Option<u64>,
    tracks: Option<Rows<'a>>,
}

struct Rows<'a>(&'a SweepRows);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.0.tracks.len()))?;
        for track in &self.0.tracks {
            rows.serialize_element(&Row::new(self.0, track))?;
        }
        rows.end()
    }
}

#[derive(Serialize)]
struct Row<'a> {
    track: u64,
    state: &'static str,
    clusters: Clusters<'a>,
    class: ObstacleClass,
    posterior: Option<Posterior>,
    position_m: [f32; 3],
    velocity_mps: [f32; 3],
    /// Row by row, like the two below.
    position_covariance_m2: [f32; 9],
    velocity_covariance_m2ps2: [f32; 9],
    /// Rows of the position, columns of the velocity.
    position_velocity_covariance_m2ps: [f32; 9],
    /// Null where no solid was ever fitted, like the two below.
    size_m: Option<[f32; 3]>,
    size_sigma_m: Option<[f32; 3]>,
    attitude_wxyz: Option<[f32; 4]>,
    /// Null where it is not observed.
    spin_radps: Option<[f32; 3]>,
    spin_sigma_radps: Option<f32>,
    age_sweeps: u32,
    last_seen_sweeps: u32,
    last_seen_ns: u64,
    valid_until_ns: u64,
    /// Null for a tentative track.
    closest_approach: Option<Approach>,
}

impl<'a> Row<'a> {
    fn new(sweep: &'a SweepRows, track: &Track) -> Self {
        // Places were checked when the part was accepted.
        let keys = sweep.keys.get(track.key_places()).unwrap_or_default();
        let block = |row: usize, column: usize| {
            std::array::from_fn(|place| track.covariance_of(row + place / 3, column + place % 3))
        };
        let is_fitted = track.size_m.iter().any(|&size| size > 0.0);
        let is_spin_seen = track.spin_sigma_radps > 0.0;
        Self {
            track: track.id,
            state: track.state.name(),
            clusters: Clusters { sweep, keys },
            class: track.class,
            posterior: track.class.solid_index().map(|_| Posterior::from(track.posterior)),
            position_m: track.position_m,
            velocity_mps: track.velocity_mps,
            position_covariance_m2: block(0, 0),
            velocity_covariance_m2ps2: block(3, 3),
            position_velocity_covariance_m2ps: block(0, 3),
            size_m: is_fitted.then_some(track.size_m),
            size_sigma_m: is_fitted.then_some(track.size_sigma_m),
            attitude_wxyz: is_fitted.then_some(track.attitude_wxyz),
            spin_radps: is_spin_seen.then_some(track.spin_radps),
            spin_sigma_radps: is_spin_seen.then_some(track.spin_sigma_radps),
            age_sweeps: track.age_sweeps,
            last_seen_sweeps: track.last_seen_sweeps,
            last_seen_ns: track.last_seen_ns,
            valid_until_ns: track.valid_until_ns,
            closest_approach: (track.state != TrackState::Tentative)
                .then(|| Approach::new(&track.approach, track.alert != 0)),
        }
    }
}

/// Numbers of clusters, as in the line of detections.
struct Clusters<'a> {
    sweep: &'a SweepRows,
    keys: &'a [u32],
}

impl Serialize for Clusters<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.keys.iter().filter_map(|&key| self.sweep.cluster_of(key)))
    }
}

#[derive(Serialize)]
struct Approach {
    time_s: f32,
    distance_m: f32,
    distance_sigma_m: f32,
    collision_probability: f32,
    alert: bool,
}

impl Approach {
    fn new(approach: &ClosestApproach, alert: bool) -> Self {
        let ClosestApproach { time_s, distance_m, distance_sigma_m, collision_probability } = *approach;
        Self { time_s, distance_m, distance_sigma_m, collision_probability, alert }
    }
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Detection, Part};

    use super::*;

    fn line(sweep: &SweepRows) -> String {
        let mut line = Vec::new();
        write_line(sweep, &mut line).unwrap();
        String::from_utf8(line).unwrap()
    }

    #[test]
    fn a_sweep_without_a_table_is_not_one_without_obstacles() {
        let mut sweep = SweepRows { part: Part { sweep: 7, ..Part::default() }, ..SweepRows::default() };
        assert_eq!(line(&sweep), "{\"sweep\":7,\"time_ns\":null,\"tracks\":null}\n");
        sweep.tracks_ns = 5;
        assert_eq!(line(&sweep), "{\"sweep\":7,\"time_ns\":5,\"tracks\":[]}\n");
    }

    #[test]
    fn every_field_of_a_track_stands_where_the_format_says() {
        let mut track = Track {
            id: 7,
            last_seen_ns: 90,
            valid_until_ns: 600,
            position_m: [1.0, 2.0, 3.0],
            velocity_mps: [0.5, 0.0, -0.5],
            size_m: [1.0, 1.0, 2.5],
            size_sigma_m: [0.1, 0.1, 0.2],
            attitude_wxyz: [1.0, 0.0, 0.0, 0.0],
            posterior: [0.01, 0.02, 0.07, 0.9],
            first_key: 1,
            keys: 2,
            age_sweeps: 4,
            last_seen_sweeps: 0,
            state: TrackState::Confirmed,
            class: ObstacleClass::Conical,
            alert: 1,
            ..Track::default()
        };
        // Rows of the triangle begin at 0, 6, 11, 15, 18, 20.
        for (place, value) in [(0, 0.01), (1, 0.02), (3, 0.5), (9, 0.75), (15, 0.04), (20, 0.06)] {
            track.covariance[place] = value;
        }
        track.approach =
            ClosestApproach { time_s: 2.5, distance_m: 1.5, distance_sigma_m: 0.25, collision_probability: 0.125 };
        let of_key = |key| Detection { summary: ClusterSummary { key, ..Default::default() }, ..Detection::default() };
        let sweep = SweepRows {
            part: Part { sweep: 3, ..Part::default() },
            detections: [2, 5, 9].map(of_key).to_vec(),
            tracks_ns: 100,
            tracks: vec![track],
            keys: vec![2, 5, 9],
            ..SweepRows::default()
        };
        let expected = concat!(
            r#"{"sweep":3,"time_ns":100,"tracks":[{"track":7,"state":"confirmed","clusters":[1,2],"class":"conical","#,
            r#""posterior":{"rectangular":0.01,"ellipsoidal":0.02,"cylindrical":0.07,"conical":0.9},"#,
            r#""position_m":[1.0,2.0,3.0],"velocity_mps":[0.5,0.0,-0.5],"#,
            r#""position_covariance_m2":[0.01,0.02,0.0,0.02,0.0,0.0,0.0,0.0,0.0],"#,
            r#""velocity_covariance_m2ps2":[0.04,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.06],"#,
            r#""position_velocity_covariance_m2ps":[0.5,0.0,0.0,0.0,0.75,0.0,0.0,0.0,0.0],"#,
            r#""size_m":[1.0,1.0,2.5],"size_sigma_m":[0.1,0.1,0.2],"attitude_wxyz":[1.0,0.0,0.0,0.0],"#,
            r#""spin_radps":null,"spin_sigma_radps":null,"age_sweeps":4,"last_seen_sweeps":0,"last_seen_ns":90,"#,
            r#""valid_until_ns":600,"closest_approach":{"time_s":2.5,"distance_m":1.5,"distance_sigma_m":0.25,"#,
            r#""collision_probability":0.125,"alert":true}}]}"#,
            "\n"
        );
        assert_eq!(line(&sweep), expected);
    }
}
