//! KITTI sweeps: x, y, z, reflectance (0 to 1) as little-endian f32, without header; axes x forward, y left, z up.

use std::io::Read;
use std::path::Path;

use super::organise::wrapped;
use super::{Cloud, Point, intensity};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

const POINT_BYTES: usize = 16;
/// Fewest points by which the format is told.
const FEWEST: usize = 16;
/// Ranges between which every point lies that tells the format [m].
const RANGES_M: [f32; 2] = [0.5, 150.0];
/// Elevations between which it lies [deg]: the HDL-64E sees −24.8 to +2, its corrected clouds and its kin somewhat more.
const ELEVATIONS_DEG: [f32; 2] = [-40.0, 20.0];
/// Azimuth within which points follow one another along a ring [rad].
const NEAR_RAD: f64 = 0.12;

fn values(bytes: &[u8; POINT_BYTES]) -> [f32; 4] {
    std::array::from_fn(|i| f32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]))
}

/// Whether a file begins with points that a spinning sensor could have seen one after the other, each with a reflectance.
pub(crate) fn is_kitti(head: &[u8]) -> bool {
    let (points, _) = head.as_chunks::<POINT_BYTES>();
    let mut before_deg = f32::NAN;
    let mut near = 0;
    let is_seen = points.iter().all(|bytes| {
        let [x, y, z, reflectance] = values(bytes);
        let range_m = (x * x + y * y + z * z).sqrt();
        let (azimuth_deg, elevation_deg) = (y.atan2(x).to_degrees(), z.atan2(x.hypot(y)).to_degrees());
        near += usize::from(wrapped((azimuth_deg - before_deg).to_radians().into()).abs() < NEAR_RAD);
        before_deg = azimuth_deg;
        // False for NaN too.
        (RANGES_M[0]..RANGES_M[1]).contains(&range_m)
            && (ELEVATIONS_DEG[0]..ELEVATIONS_DEG[1]).contains(&elevation_deg)
            && (0.0..=1.0).contains(&reflectance)
    });
    points.len() >= FEWEST && is_seen && 4 * near >= 3 * (points.len() - 1)
}

/// Reads the points of `path` into `cloud`, which is empty.
pub(crate) fn read(path: &Path, cloud: &mut Cloud, faults: &mut Faults) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut file = std::io::BufReader::with_capacity(1 << 16, std::fs::File::open(path).map_err(io)?);
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
        let [x, y, z, reflectance] = values(&bytes);
        let (intensity, fits) = intensity(f64::from(reflectance) * 255.0);
        if !fits {
            faults.note(Fault::Intensity, 1, path, Place::Byte(offset), "a reflectance outside 0 to 1");
        }
        cloud.push(Point { position_m: [x, y, z].map(f64::from), key: 0.0, time_ns: 0, ring: u8::MAX, intensity });
        offset += POINT_BYTES as u64;
    }
}
