//! Returns → `foxglove.PointCloud`. Points are written as they lie in memory, behind a header that is encoded once.

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud, Pose, Quaternion, Vector3};
use lidar::{ObstacleClass, Return};
use messages::{Detection, Sweep};
use prost::Message;
use zerocopy::{Immutable, IntoBytes};

use crate::colours::{UNCLASSIFIED, colour};
use crate::stamps::timestamp;

/// The frame of all geometry: the sensor's.
pub const FRAME_ID: &str = "lidar";
/// The number of a return that is in no cluster that came.
pub const NO_CLUSTER: i32 = -1;
/// Protobuf's key of `PointCloud.data`: field 6, length-delimited.
const DATA_KEY: u8 = 6 << 3 | 2;
/// How opaque a return without a cluster is, of 255.
const FAINT: u8 = 96;

/// Fields of a [`Return`].
const RETURN_FIELDS: [(&str, u32, NumericType); 6] = [
    ("x", 0, NumericType::Float32),
    ("y", 4, NumericType::Float32),
    ("z", 8, NumericType::Float32),
    ("column", 12, NumericType::Uint16),
    ("ring", 14, NumericType::Uint8),
    ("intensity", 15, NumericType::Uint8),
];

/// Fields of a [`ClusterPoint`] after those of its return.
const CLUSTER_FIELDS: [(&str, u32, NumericType); 6] = [
    ("cluster", 16, NumericType::Int32),
    ("red", 20, NumericType::Uint8),
    ("green", 21, NumericType::Uint8),
    ("blue", 22, NumericType::Uint8),
    ("alpha", 23, NumericType::Uint8),
    ("class", 24, NumericType::Uint8),
];

/// A return and what became of it.
#[derive(Clone, Copy, IntoBytes, Immutable)]
#[repr(C)]
struct ClusterPoint {
    echo: Return,
    cluster: i32,
    rgba: [u8; 4],
    class: u8,
    reserved: [u8; 3],
}

/// Writes point clouds. Keeps its memory.
#[derive(Default)]
pub struct Clouds {
    points: Vec<ClusterPoint>,
}

impl Clouds {
    /// Appends the accepted returns of a whole sweep: x, y, z [m, sensor frame], column, ring, intensity; 16 bytes each.
    pub fn sweep(&self, sweep: &Sweep, out: &mut Vec<u8>) {
        put(sweep.header.sensor_time_ns, size_of::<Return>(), &[&RETURN_FIELDS], sweep.returns.as_bytes(), out);
    }

    /// Appends the same returns with the number of their cluster (its place in `detections`, [`NO_CLUSTER`] where it
    /// did not come), its class (the number of [`ObstacleClass`]) and colour; 28 bytes each.
    ///
    /// `recorded_index` is that of the sweep, `detections` are all of the sweep in order of key, with places in
    /// `members`. False, with nothing of use appended, where a member is no return of the sweep.
    pub fn clusters(&mut self, of: &Clustered<'_>, out: &mut Vec<u8>) -> bool {
        let [r, g, b] = UNCLASSIFIED;
        let loose = |&echo: &Return| ClusterPoint {
            echo,
            cluster: NO_CLUSTER,
            rgba: [r, g, b, FAINT],
            class: ObstacleClass::Unclassified as u8,
            reserved: [0; 3],
        };
        self.points.clear();
        self.points.extend(of.returns.iter().map(loose));
        for (number, detection) in of.detections.iter().enumerate() {
            let first = detection.summary.first_member as usize;
            let Some(members) = of.members.get(first..).and_then(|rest| rest.get(..detection.summary.points as usize))
            else {
                return false;
            };
            let [r, g, b] = colour(detection.class);
            for &index in members {
                let Some(point) = of.place(index).and_then(|place| self.points.get_mut(place)) else { return false };
                (point.cluster, point.rgba, point.class) = (number as i32, [r, g, b, 255], detection.class as u8);
            }
        }
        let fields = [&RETURN_FIELDS[..], &CLUSTER_FIELDS];
        put(of.sensor_time_ns, size_of::<ClusterPoint>(), &fields, self.points.as_bytes(), out);
        true
    }
}

/// A whole sweep with its detections.
#[derive(Clone, Copy, Debug)]
pub struct Clustered<'a> {
    /// Sensor time of the sweep's first firing [ns].
    pub sensor_time_ns: u64,
    /// As in the sweep.
    pub returns: &'a [Return],
    /// As in the sweep: rising, or empty where none was refused.
    pub recorded_index: &'a [u32],
    /// Of the whole sweep, in order of key.
    pub detections: &'a [Detection],
    /// What the detections' places point into.
    pub members: &'a [u32],
}

impl Clustered<'_> {
    /// Place in `returns` of the return with an index in the sweep.
    fn place(&self, index: u32) -> Option<usize> {
        if self.recorded_index.is_empty() {
            return Some(index as usize);
        }
        self.recorded_index.binary_search(&index).ok()
    }
}

type Fields = [(&'static str, u32, NumericType)];

fn put(sensor_time_ns: u64, stride: usize, fields: &[&Fields], points: &[u8], out: &mut Vec<u8>) {
    let field = |&(name, offset, kind): &(&str, u32, NumericType)| PackedElementField {
        name: name.into(),
        offset,
        r#type: kind as i32,
    };
    let head = PointCloud {
        timestamp: Some(timestamp(sensor_time_ns)),
        frame_id: FRAME_ID.into(),
        pose: Some(Pose { position: Some(Vector3::default()), orientation: Some(identity()) }),
        point_stride: stride as u32,
        fields: fields.iter().flat_map(|fields| fields.iter().map(field)).collect(),
        data: Default::default(),
    };
    out.reserve(head.encoded_len() + points.len() + 16);
    // Fails only where a buffer cannot grow; a vector does.
    let _ = head.encode(out);
    if !points.is_empty() {
        out.push(DATA_KEY);
        let _ = prost::encode_length_delimiter(points.len(), out);
        out.extend_from_slice(points);
    }
}

fn identity() -> Quaternion {
    Quaternion { w: 1.0, ..Quaternion::default() }
}

#[cfg(test)]
mod tests {
    use messages::ClusterSummary;
    use zerocopy::FromZeros;

    use super::*;

    fn echo(x: f32) -> Return {
        Return { x, column: 0x0201, ring: 3, intensity: 4, ..Return::default() }
    }

    fn detection(first_member: u32, points: u32, class: ObstacleClass) -> Detection {
        Detection {
            summary: ClusterSummary { first_member, points, ..Default::default() },
            class,
            ..Default::default()
        }
    }

    fn decoded(bytes: &[u8]) -> PointCloud {
        PointCloud::decode(bytes).unwrap()
    }

    #[test]
    fn a_sweep_is_a_cloud_of_its_returns_as_they_lie_in_memory() {
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        sweep.header.sensor_time_ns = 5_000_000_001;
        sweep.returns.extend_from_slice(&[echo(1.0), echo(2.0)]).unwrap();
        let mut out = Vec::new();
        Clouds::default().sweep(&sweep, &mut out);
        let cloud = decoded(&out);
        assert_eq!(&cloud.data[..], sweep.returns.as_bytes());
        assert_eq!((cloud.point_stride, cloud.frame_id.as_str(), cloud.fields.len()), (16, "lidar", 6));
        assert_eq!(cloud.timestamp, Some(timestamp(5_000_000_001)));
    }

    #[test]
    fn a_sweep_without_returns_is_an_empty_cloud() {
        let mut out = Vec::new();
        Clouds::default().sweep(&Sweep::new_box_zeroed().unwrap(), &mut out);
        assert!(decoded(&out).data.is_empty());
    }

    #[test]
    fn a_return_has_the_number_class_and_colour_of_its_cluster_and_loose_ones_are_faint() {
        let returns = [echo(1.0), echo(2.0), echo(3.0)];
        let detections = [detection(0, 1, ObstacleClass::Conical), detection(1, 1, ObstacleClass::Rectangular)];
        for (recorded_index, members) in [(&[][..], [2, 0]), (&[4, 6, 9][..], [9, 4])] {
            let of = Clustered {
                sensor_time_ns: 0,
                returns: &returns,
                recorded_index,
                detections: &detections,
                members: &members,
            };
            let mut out = Vec::new();
            assert!(Clouds::default().clusters(&of, &mut out));
            let cloud = decoded(&out);
            let points: Vec<&[u8]> = cloud.data.chunks_exact(28).collect();
            let told = |point: &[u8]| (i32::from_le_bytes(point[16..20].try_into().unwrap()), point[20..25].to_vec());
            assert_eq!(told(points[0]), (1, vec![86, 180, 233, 255, 1]));
            assert_eq!(told(points[1]), (-1, vec![190, 190, 190, 96, 0]));
            assert_eq!(told(points[2]), (0, vec![213, 94, 0, 255, 4]));
            assert_eq!(&points[2][..16], echo(3.0).as_bytes());
        }
    }

    #[test]
    fn members_that_are_no_returns_of_the_sweep_are_refused() {
        let returns = [echo(1.0)];
        for (recorded_index, members, detection) in [
            (&[][..], &[1][..], detection(0, 1, ObstacleClass::Conical)),
            (&[5][..], &[0][..], detection(0, 1, ObstacleClass::Conical)),
            (&[][..], &[0][..], detection(0, 2, ObstacleClass::Conical)),
            (&[][..], &[0][..], detection(u32::MAX, u32::MAX, ObstacleClass::Conical)),
        ] {
            let of =
                Clustered { sensor_time_ns: 0, returns: &returns, recorded_index, detections: &[detection], members };
            assert!(!Clouds::default().clusters(&of, &mut Vec::new()));
        }
    }
}
