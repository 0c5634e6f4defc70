//! `foxglove.PointCloud` in protobuf: the fields of its schema that are used here. Its pose is not: geometry stays in the
//! sensor's frame.

use prost::Message;

use crate::cloud::packed::{Field, Packed};
use crate::cloud::value::Kind;

/// Most fields of a point.
const MAX_FIELDS: usize = 256;

#[derive(Clone, PartialEq, Message)]
struct Timestamp {
    #[prost(int64, tag = "1")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    nanos: i32,
}

#[derive(Clone, PartialEq, Message)]
struct PackedElementField {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(fixed32, tag = "2")]
    offset: u32,
    #[prost(int32, tag = "3")]
    r#type: i32,
}

/// A cloud as it was sent.
#[derive(Clone, PartialEq, Message)]
pub(super) struct PointCloud {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(fixed32, tag = "4")]
    point_stride: u32,
    #[prost(message, repeated, tag = "5")]
    fields: Vec<PackedElementField>,
    #[prost(bytes = "vec", tag = "6")]
    data: Vec<u8>,
}

impl PointCloud {
    /// Reads the next cloud into this one, whose memory is used again.
    pub(super) fn read(&mut self, message: &[u8]) -> Result<(), String> {
        self.clear();
        self.merge(message).map_err(|error| error.to_string())
    }

    /// The points.
    pub(super) fn packed(&self) -> Result<Packed<'_>, String> {
        if self.fields.len() > MAX_FIELDS {
            return Err(format!("the cloud has {} fields, must have at most {MAX_FIELDS}", self.fields.len()));
        }
        let mut fields = Vec::new();
        for PackedElementField { name, offset, r#type } in &self.fields {
            let kind = match r#type {
                1 => Kind::U8,
                2 => Kind::I8,
                3 => Kind::U16,
                4 => Kind::I16,
                5 => Kind::U32,
                6 => Kind::I32,
                7 => Kind::F32,
                8 => Kind::F64,
                other => return Err(format!("field {name} has type {other}, must be 1 to 8")),
            };
            fields.push(Field { name, kind, offset: *offset as usize });
        }
        let step = self.point_stride as usize;
        // The points are as many as there is room for; a rest is a point that is cut off.
        let points = self.data.len().div_ceil(step.max(1));
        let start_ns = self.timestamp.as_ref().map_or(0, |at| {
            u64::try_from(at.seconds)
                .unwrap_or(0)
                .saturating_mul(1_000_000_000)
                .saturating_add(u64::try_from(at.nanos).unwrap_or(0))
        });
        Packed::checked(fields, [1, points], [step, 0], false, &self.data, start_ns)
    }
}
