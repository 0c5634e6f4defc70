//! Sweep → one JSON line. Numbers are the shortest that read back as the same value, so equal sweeps are equal bytes.

use lidar::ObstacleClass;
use messages::{Detection, Refusal, Solid, Step};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Serialize, Serializer};

use crate::assemble::SweepRows;

/// Appends the sweep's line, its end included. Clusters are numbered by their place, which is their rank by key.
pub(crate) fn write_line(sweep: &SweepRows, line: &mut Vec<u8>) -> Result<(), serde_json::Error> {
    serde_json::to_writer(
        &mut *line,
        &Line {
            sweep: sweep.part.sweep,
            complete: sweep.complete,
            step: Some(sweep.part.step()).filter(|&step| step != Step::Nominal).map(Step::name),
            sensor_time_ns: sweep.part.sensor_time_ns,
            returns: sweep.accepted,
            refused: Refused(&sweep.refused),
            missing_sectors: sweep.missing_sectors,
            rejected_sectors: sweep.rejected_sectors,
            detections: Rows(sweep),
        },
    )?;
    line.push(b'\n');
    Ok(())
}

#[derive(Serialize)]
struct Line<'a> {
    sweep: u64,
    complete: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    step: Option<&'static str>,
    sensor_time_ns: u64,
    returns: u64,
    refused: Refused<'a>,
    #[serde(skip_serializing_if = "is_zero")]
    missing_sectors: u32,
    #[serde(skip_serializing_if = "is_zero")]
    rejected_sectors: u32,
    detections: Rows<'a>,
}

fn is_zero(count: &u32) -> bool {
    *count == 0
}

/// Reasons that occurred, in their order.
struct Refused<'a>(&'a [u64; Refusal::ALL.len()]);

impl Serialize for Refused<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (reason, &count) in Refusal::ALL.into_iter().zip(self.0) {
            if count > 0 {
                map.serialize_entry(reason.name(), &count)?;
            }
        }
        map.end()
    }
}

struct Rows<'a>(&'a SweepRows);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(sweep) = self;
        let mut rows = serializer.serialize_seq(Some(sweep.detections.len()))?;
        for (cluster, detection) in sweep.detections.iter().enumerate() {
            // Places were checked when the part was accepted.
            let solid = detection.solid_place().and_then(|place| sweep.solids.get(place));
            rows.serialize_element(&Row::new(cluster, detection, solid))?;
        }
        rows.end()
    }
}

#[derive(Serialize)]
struct Row {
    cluster: usize,
    points: u32,
    class: ObstacleClass,
    posterior: Option<Posterior>,
    centroid_m: [f32; 3],
    /// The solid's pose and size, and how well its centre is known: null without one.
    centre_m: Option<[f32; 3]>,
    size_m: Option<[f32; 3]>,
    attitude_wxyz: Option<[f32; 4]>,
    /// Row by row.
    centre_covariance_m2: Option<[f32; 9]>,
    range_m: f32,
    rings: u32,
}

impl Row {
    fn new(cluster: usize, detection: &Detection, solid: Option<&Solid>) -> Self {
        Self {
            cluster,
            points: detection.summary.points,
            class: detection.class,
            posterior: detection.class.solid_index().map(|_| Posterior::from(detection.posterior)),
            centroid_m: detection.summary.centroid_m,
            centre_m: solid.map(|solid| solid.centre_m),
            size_m: solid.map(|solid| solid.size_m),
            attitude_wxyz: solid.map(|solid| solid.attitude_wxyz),
            centre_covariance_m2: solid.map(centre_covariance_m2),
            range_m: detection.summary.range_m(),
            rings: detection.summary.rings,
        }
    }
}

fn centre_covariance_m2(solid: &Solid) -> [f32; 9] {
    std::array::from_fn(|place| solid.covariance_of(place / 3, place % 3))
}

/// Probabilities by the names of their classes.
#[derive(Serialize)]
pub(crate) struct Posterior {
    rectangular: f32,
    ellipsoidal: f32,
    cylindrical: f32,
    conical: f32,
}

impl From<[f32; 4]> for Posterior {
    fn from([rectangular, ellipsoidal, cylindrical, conical]: [f32; 4]) -> Self {
        Self { rectangular, ellipsoidal, cylindrical, conical }
    }
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Part};

    use super::*;

    fn line(sweep: &SweepRows) -> String {
        let mut line = Vec::new();
        write_line(sweep, &mut line).unwrap();
        String::from_utf8(line).unwrap()
    }

    #[test]
    fn a_sweep_without_obstacles_has_an_empty_list() {
        let sweep = SweepRows { part: Part { sweep: 7, ..Part::default() }, complete: true, ..SweepRows::default() };
        assert_eq!(
            line(&sweep),
            "{\"sweep\":7,\"complete\":true,\"sensor_time_ns\":0,\"returns\":0,\"refused\":{},\"detections\":[]}\n"
        );
    }

    #[test]
    fn a_line_names_its_step_only_when_something_was_left_out() {
        let at = |step| {
            let part = Part { sweep: 7, step, ..Part::default() };
            line(&SweepRows { part, complete: true, ..SweepRows::default() })
        };
        assert!(!at(0).contains("step"));
        assert!(at(1).starts_with("{\"sweep\":7,\"complete\":true,\"step\":\"fewer-starts\",\"sensor_time_ns\":0,"));
    }

    #[test]
    fn every_field_of_a_line_stands_where_the_format_says() {
        let conical = Detection {
            summary: ClusterSummary {
                key: 3,
                points: 123,
                rings: 4,
                centroid_m: [3.0, -4.0, 0.1],
                ..ClusterSummary::default()
            },
            posterior: [0.01, 0.02, 0.07, 0.9],
            first_solid: 1,
            solids: 1,
            class: ObstacleClass::Conical,
            reserved: [0; 3],
        };
        let mut solid = Solid { centre_m: [3.5, -4.0, 0.2], size_m: [1.0, 1.0, 2.5], ..Solid::default() };
        // The first three rows of the triangle begin at 0, 9 and 17.
        for (place, value) in [(0, 0.01), (1, 0.02), (2, 0.03), (9, 0.04), (10, 0.05), (17, 0.06)] {
            solid.covariance[place] = value;
        }
        let unclassified = Detection {
            summary: ClusterSummary { key: 9, points: 1, rings: 1, centroid_m: [0.0, 2.0, 0.0], ..conical.summary },
            ..Detection::default()
        };
        let sweep = SweepRows {
            part: Part { sweep: 1, sensor_time_ns: 18_446_744_073_709_551_615, ..Part::default() },
            accepted: 124,
            refused: [2, 0, 1, 0, 0],
            missing_sectors: 1,
            rejected_sectors: 2,
            detections: vec![conical, unclassified],
            solids: vec![Solid::default(), solid],
            ..SweepRows::default()
        };
        let expected = concat!(
            r#"{"sweep":1,"complete":false,"sensor_time_ns":18446744073709551615,"returns":124,"#,
            r#""refused":{"not_finite":2,"too_near":1},"missing_sectors":1,"rejected_sectors":2,"detections":["#,
            r#"{"cluster":0,"points":123,"class":"conical","#,
            r#""posterior":{"rectangular":0.01,"ellipsoidal":0.02,"cylindrical":0.07,"conical":0.9},"#,
            r#""centroid_m":[3.0,-4.0,0.1],"centre_m":[3.5,-4.0,0.2],"size_m":[1.0,1.0,2.5],"attitude_wxyz":[1.0,0.0,0.0,0.0],"#,
            r#""centre_covariance_m2":[0.01,0.02,0.03,0.02,0.04,0.05,0.03,0.05,0.06],"range_m":5.001,"rings":4},"#,
            r#"{"cluster":1,"points":1,"class":"unclassified","posterior":null,"#,
            r#""centroid_m":[0.0,2.0,0.0],"centre_m":null,"size_m":null,"attitude_wxyz":null,"#,
            r#""centre_covariance_m2":null,"range_m":2.0,"rings":1}]}"#,
            "\n"
        );
        assert_eq!(line(&sweep), expected);
    }
}
