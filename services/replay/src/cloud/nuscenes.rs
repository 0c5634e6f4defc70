//! nuScenes `LIDAR_TOP` sweeps: x, y, z, intensity, ring as little-endian f32, without header.

use std::io::Read;
use std::path::Path;

use super::{Cloud, Point, intensity};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

const POINT_BYTES: usize = 20;
const RINGS: usize = 32;
/// Farther than any lidar sees [m]: to tell the format.
const FAR_M: f32 = 1_000.0;

fn values(bytes: &[u8; POINT_BYTES]) -> [f32; 5] {
    std::array::from_fn(|i| f32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]))
}

/// Whether a file begins with a column of 32 points, or what it has, with rings 0, 1, 2, …
pub(crate) fn is_nuscenes(head: &[u8]) -> bool {
    let (points, _) = head.as_chunks::<POINT_BYTES>();
    !points.is_empty()
        && points.iter().enumerate().all(|(index, bytes)| {
            let [x, y, z, intensity, ring] = values(bytes);
            let is_near = [x, y, z].iter().all(|c| c.abs() < FAR_M);
            is_near && (0.0..=255.0).contains(&intensity) && ring == (index % RINGS) as f32
        })
}

/// Time in a file's name: `…__LIDAR_TOP__1532402927647951.pcd.bin`, microseconds since 1970 [ns].
pub(crate) fn time_ns(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let stem = name.split('.').next()?;
    let digits = stem.rsplit("__").next()?;
    digits.parse::<u64>().ok()?.checked_mul(1_000)
}

/// Reads the points of `path` into `cloud`, which is empty.
pub(crate) fn read(path: &Path, cloud: &mut Cloud, faults: &mut Faults) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut file = std::io::BufReader::with_capacity(1 << 16, std::fs::File::open(path).map_err(io)?);
    cloud.has_ring = true;
    cloud.start_ns = time_ns(path);
    let mut bytes = [0; POINT_BYTES];
    let mut offset = 0;
    loop {
        let mut got = 0;
        while got < POINT_BYTES {
            match file.read(&mut bytes[got..]).map_err(io)? {
                0 => break,
                n => got += n,
            }
        }
        if got < POINT_BYTES {
            if got > 0 {
                cloud.is_torn = true;
                let what = format!("the file ends inside a point: {got} of {POINT_BYTES} bytes");
                faults.note(Fault::TornCloud, 1, path, Place::Byte(offset), what);
            }
            return Ok(());
        }
        let [x, y, z, strength, ring] = values(&bytes);
        let (intensity, fits) = intensity(f64::from(strength));
        if !fits {
            faults.note(Fault::Intensity, 1, path, Place::Byte(offset), "an intensity outside 0 to 255");
        }
        cloud.push(Point {
            position_m: [x, y, z].map(f64::from),
            key: 0.0,
            time_ns: 0,
            // 255 is no ring of any sensor.
            ring: if ring.fract() == 0.0 && (0.0..255.0).contains(&ring) { ring as u8 } else { u8::MAX },
            intensity,
        });
        offset += POINT_BYTES as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_the_last_number_of_the_name() {
        let name = "n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";
        assert_eq!(time_ns(Path::new(name)), Some(1_532_402_927_647_951_000));
        assert_eq!(time_ns(Path::new("cloud.pcd.bin")), None);
        assert_eq!(time_ns(Path::new("a__99999999999999999999.bin")), None);
    }
}
