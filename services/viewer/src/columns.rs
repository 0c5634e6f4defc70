use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

/// Numbers as the page reads them: columns of integers, each the differences of neighbours, folded so that small ones of
/// either sign are small (zigzag), and laid out byte plane by byte plane, so that what is alike stands together. Then
/// deflated, which every browser undoes by itself.
///
/// Uncompressed: length of the head (u32, little-endian), the head as JSON, then the planes of each column.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    heads: Vec<Head>,
    planes: Vec<u8>,
}

#[derive(Debug, Serialize)]
struct Head {
    name: &'static str,
    /// Numbers in the column.
    n: usize,
    /// Byte planes.
    bytes: u32,
    /// What an integer 1 stands for.
    unit: f64,
}

impl Columns {
    /// Adds a column of integers.
    pub(crate) fn integers(&mut self, name: &'static str, values: impl Iterator<Item = i32>) {
        self.put(name, 1.0, values);
    }

    /// Adds a column of reals, rounded to multiples of `unit`. What is not finite or beyond 2³¹ units is drawn in.
    pub(crate) fn reals(&mut self, name: &'static str, unit: f64, values: impl Iterator<Item = f64>) {
        self.put(name, unit, values.map(|value| (value / unit).round() as i32));
    }

    fn put(&mut self, name: &'static str, unit: f64, values: impl Iterator<Item = i32>) {
        let mut before = 0i32;
        let folded: Vec<u32> = values
            .map(|value| {
                let step = value.wrapping_sub(before);
                before = value;
                ((step << 1) ^ (step >> 31)) as u32
            })
            .collect();
        let bits = u32::BITS - folded.iter().fold(0, |all, value| all | value).leading_zeros();
        let bytes = bits.div_ceil(8);
        for plane in 0..bytes {
            self.planes.extend(folded.iter().map(|value| (value >> (8 * plane)) as u8));
        }
        self.heads.push(Head { name, n: folded.len(), bytes, unit });
    }

    /// All of it, deflated (zlib).
    pub(crate) fn finish(self) -> std::io::Result<Vec<u8>> {
        let head = serde_json::to_vec(&self.heads)?;
        let mut out = ZlibEncoder::new(Vec::new(), Compression::new(6));
        out.write_all(&(head.len() as u32).to_le_bytes())?;
        out.write_all(&head)?;
        out.write_all(&self.planes)?;
        out.finish()
    }
}

/// What the page's decoder makes of it: name and values of each column. The mirror of `page/decode.js`.
#[cfg(test)]
pub(crate) fn decode(deflated: &[u8]) -> std::collections::BTreeMap<String, Vec<f64>> {
    use std::io::Read;
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(deflated).read_to_end(&mut bytes).unwrap();
    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
    let heads: Vec<serde_json::Value> = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
    let mut at = 4 + length;
    let mut columns = std::collections::BTreeMap::new();
    for head in heads {
        let [n, planes] = ["n", "bytes"].map(|key| head[key].as_u64().unwrap() as usize);
        let mut sum = 0i32;
        let values = (0..n).map(|place| {
            let folded =
                (0..planes).fold(0, |all, plane| all | u32::from(bytes[at + plane * n + place]) << (8 * plane));
            sum = sum.wrapping_add((folded >> 1) as i32 ^ -((folded & 1) as i32));
            f64::from(sum) * head["unit"].as_f64().unwrap()
        });
        columns.insert(head["name"].as_str().unwrap().to_owned(), values.collect());
        at += n * planes;
    }
    assert_eq!(at, bytes.len());
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_every_size_and_sign_come_back() {
        let values = [0, 1, -1, 127, -128, 70_000, i32::MAX, i32::MIN, -5, i32::MIN, i32::MAX];
        let mut columns = Columns::default();
        columns.integers("a", values.into_iter());
        columns.integers("none", std::iter::empty());
        columns.integers("alike", [7; 300].into_iter());
        let back = decode(&columns.finish().unwrap());
        assert_eq!(back["a"], values.map(f64::from));
        assert!(back["none"].is_empty());
        assert_eq!(back["alike"], [7.0; 300]);
    }

    #[test]
    fn reals_come_back_within_half_a_unit_and_what_is_none_is_drawn_in() {
        let values = [0.0, 1.0009, -3.4567, 120.0];
        let mut columns = Columns::default();
        columns.reals("a", 0.002, values.into_iter());
        columns.reals("odd", 1.0, [f64::NAN, f64::INFINITY, -1e300].into_iter());
        let back = decode(&columns.finish().unwrap());
        for (was, is) in values.iter().zip(&back["a"]) {
            assert!((was - is).abs() <= 0.001 + 1e-12, "{was} {is}");
        }
        assert_eq!(back["odd"], [0.0, f64::from(i32::MAX), f64::from(i32::MIN)]);
    }
}
