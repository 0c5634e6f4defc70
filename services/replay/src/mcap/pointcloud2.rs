//! `sensor_msgs/PointCloud2` of ROS 1 and 2.

use super::cdr::Values;
use crate::cloud::packed::{Field, Packed};
use crate::cloud::value::Kind;

/// Most fields of a point.
const MAX_FIELDS: u32 = 256;

/// The cloud in `message`. What is wrong is said with its place in the message.
pub(super) fn parse(message: &[u8], is_ros1: bool) -> Result<Packed<'_>, String> {
    let mut values = match is_ros1 {
        true => Values::ros1(message),
        false => Values::cdr(message).ok_or("the message begins with no known kind of CDR")?,
    };
    read(&mut values).map_err(|what| format!("{what}, at byte {} of the message", values.at()))?
}

/// What ends early is an error at its place; what is there and wrong comes as the inner one.
fn read<'a>(values: &mut Values<'a>) -> Result<Result<Packed<'a>, String>, &'static str> {
    const SHORT: &str = "the message ends";
    if values.is_ros1() {
        values.u32().ok_or(SHORT)?; // sequence
    }
    let (seconds, nanoseconds) = (values.u32().ok_or(SHORT)?, values.u32().ok_or(SHORT)?);
    values.string().ok_or("the frame's name cannot be read")?;
    let (height, width) = (values.u32().ok_or(SHORT)?, values.u32().ok_or(SHORT)?);
    let count = values.u32().ok_or(SHORT)?;
    if count > MAX_FIELDS {
        return Err("there are more than 256 fields");
    }
    let mut fields = Vec::new();
    for _ in 0..count {
        let name = values.string().ok_or("a field's name cannot be read")?;
        let offset = values.u32().ok_or(SHORT)? as usize;
        let datatype = values.u8().ok_or(SHORT)?;
        values.u32().ok_or(SHORT)?; // values of the field; the first is used
        let kind = match datatype {
            1 => Kind::I8,
            2 => Kind::U8,
            3 => Kind::I16,
            4 => Kind::U16,
            5 => Kind::I32,
            6 => Kind::U32,
            7 => Kind::F32,
            8 => Kind::F64,
            _ => return Err("a field's datatype is none of 1 to 8"),
        };
        fields.push(Field { name, kind, offset });
    }
    let is_big_endian = values.u8().ok_or(SHORT)? != 0;
    let (point_step, row_step) = (values.u32().ok_or(SHORT)? as usize, values.u32().ok_or(SHORT)? as usize);
    let (data, _) = values.bytes().ok_or(SHORT)?;
    let start_ns = u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds);
    let promised = [height, width].map(|size| size as usize);
    Ok(Packed::checked(fields, promised, [point_step, row_step], is_big_endian, data, start_ns))
}
