//! MCAP files made for tests.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use messages::{Message, Raw, Sweep};

/// How a file is packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Packing {
    Zstd,
    Lz4,
    /// Chunks that are not compressed.
    Plain,
    /// No chunks.
    Loose,
}

pub const PACKINGS: [Packing; 4] = [Packing::Zstd, Packing::Lz4, Packing::Plain, Packing::Loose];

/// A topic: name, encoding of its messages, name of its schema.
pub type Topic<'a> = (&'a str, &'a str, &'a str);

pub const RAW: Topic<'_> = ("/encke/raw/sweep", "encke", Sweep::TYPE);
pub const CLOUD: Topic<'_> = ("/points", "cdr", "sensor_msgs/msg/PointCloud2");

/// A file of messages (place of the topic, time of logging, bytes) in chunks of about `chunk_bytes`.
pub fn container(
    packing: Packing,
    chunk_bytes: u64,
    topics: &[Topic<'_>],
    messages: &[(usize, u64, Vec<u8>)],
) -> Vec<u8> {
    let options = WriteOptions::new().profile("").chunk_size(Some(chunk_bytes)).use_chunks(packing != Packing::Loose);
    let options = options.compression(match packing {
        Packing::Zstd => Some(Compression::Zstd),
        Packing::Lz4 => Some(Compression::Lz4),
        Packing::Plain | Packing::Loose => None,
    });
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let mut channels = Vec::new();
    for (topic, encoding, schema) in topics {
        let schema = writer.add_schema(schema, "", b"").unwrap();
        channels.push(writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap());
    }
    for (sequence, (topic, log_time, data)) in messages.iter().enumerate() {
        let header = MessageHeader {
            channel_id: channels[*topic],
            sequence: sequence as u32,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A sweep as it is recorded.
pub fn raw(sweep: &Sweep) -> Vec<u8> {
    let mut bytes = Vec::new();
    sweep.write_raw(&mut bytes);
    bytes
}

/// How a made PointCloud2 is written.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// The CDR of the message.
    pub is_big_endian: bool,
    /// The numbers of the points.
    pub is_data_big_endian: bool,
    /// Without CDR, with a sequence number in the header.
    pub is_ros1: bool,
    pub rows: usize,
    /// Bytes without meaning after each point, and after each row.
    pub padding: [usize; 2],
}

pub const PLAIN: Style =
    Style { is_big_endian: false, is_data_big_endian: false, is_ros1: false, rows: 1, padding: [0; 2] };

/// A field of a PointCloud2: name, datatype, and the number of each point.
pub type Field<'a> = (&'a str, u8, Vec<f64>);

/// A PointCloud2 with a stamp [s, ns].
pub fn point_cloud2(style: Style, stamp: [u32; 2], fields: &[Field<'_>]) -> Vec<u8> {
    let sizes = fields.iter().map(|(_, datatype, _)| [1, 1, 2, 2, 4, 4, 4, 8][usize::from(*datatype) - 1]);
    let offsets: Vec<usize> = sizes.clone().scan(0, |at, size| Some(std::mem::replace(at, *at + size))).collect();
    let step = sizes.sum::<usize>() + style.padding[0];
    let points = fields[0].2.len();
    let columns = points / style.rows;
    let row_bytes = columns * step + style.padding[1];

    let mut out = Vec::new();
    let put_u32 = |out: &mut Vec<u8>, value: usize| {
        while !style.is_ros1 && !out.len().is_multiple_of(4) {
            out.push(0);
        }
        let value = value as u32;
        out.extend(if style.is_big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    };
    let put_string = |out: &mut Vec<u8>, text: &str| {
        put_u32(out, text.len() + usize::from(!style.is_ros1));
        out.extend(text.bytes());
        out.extend((!style.is_ros1).then_some(0));
    };
    if style.is_ros1 {
        put_u32(&mut out, 77);
    }
    stamp.iter().for_each(|part| put_u32(&mut out, *part as usize));
    put_string(&mut out, "lidar");
    [style.rows, columns, fields.len()].into_iter().for_each(|value| put_u32(&mut out, value));
    for ((name, datatype, _), offset) in fields.iter().zip(&offsets) {
        put_string(&mut out, name);
        put_u32(&mut out, *offset);
        out.push(*datatype);
        put_u32(&mut out, 1);
    }
    out.push(u8::from(style.is_data_big_endian));
    [step, row_bytes, style.rows * row_bytes].into_iter().for_each(|value| put_u32(&mut out, value));
    for row in 0..style.rows {
        for column in 0..columns {
            for (_, datatype, numbers) in fields {
                let value = numbers[row * columns + column];
                let mut bytes = match datatype {
                    1 => (value as i8).to_le_bytes().to_vec(),
                    2 => (value as u8).to_le_bytes().to_vec(),
                    3 => (value as i16).to_le_bytes().to_vec(),
                    4 => (value as u16).to_le_bytes().to_vec(),
                    5 => (value as i32).to_le_bytes().to_vec(),
                    6 => (value as u32).to_le_bytes().to_vec(),
                    7 => (value as f32).to_le_bytes().to_vec(),
                    _ => value.to_le_bytes().to_vec(),
                };
                if style.is_data_big_endian {
                    bytes.reverse();
                }
                out.extend(bytes);
            }
            out.extend(vec![0xEE; style.padding[0]]);
        }
        out.extend(vec![0xEE; style.padding[1]]);
    }
    out.push(1);
    if style.is_ros1 { out } else { [&[0, u8::from(!style.is_big_endian), 0, 0][..], &out].concat() }
}
