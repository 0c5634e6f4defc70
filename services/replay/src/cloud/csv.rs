//! Comma-separated values: a header line that names columns, then a return a line.

use std::io::{BufRead, Read};
use std::path::Path;

use super::{Cloud, Point, intensity};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// Longest line [bytes]; a longer one is no table.
const MAX_LINE: u64 = 65_536;

const NAMES: [&str; 7] = ["x", "y", "z", "intensity", "ring", "azimuth_deg", "time_ns"];
const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
const INTENSITY: usize = 3;
const RING: usize = 4;
const AZIMUTH: usize = 5;
const TIME: usize = 6;

/// Whether a file begins with a line that names x, y and z.
pub(crate) fn is_csv(head: &[u8]) -> bool {
    let line = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    header(line).is_some_and(|places| places[..=Z].iter().all(Option::is_some))
}

/// A line without byte order mark and ends, as text.
fn text(line: &[u8]) -> Option<&str> {
    let line = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line);
    std::str::from_utf8(line).ok().map(str::trim)
}

/// Place of each of [`NAMES`] in a line; none if it is no text.
fn header(line: &[u8]) -> Option<[Option<usize>; NAMES.len()]> {
    let line = text(line)?;
    Some(NAMES.map(|name| line.split(',').position(|column| column.trim() == name)))
}

/// Reads the returns of `path` into `cloud`, which is empty. `line` is memory to use again.
pub(crate) fn read(path: &Path, cloud: &mut Cloud, line: &mut Vec<u8>, faults: &mut Faults) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut file = std::io::BufReader::with_capacity(1 << 16, std::fs::File::open(path).map_err(io)?);
    let mut number = 0;
    let mut next = |line: &mut Vec<u8>| -> Result<Option<u64>, ReplayError> {
        line.clear();
        number += 1;
        let length = (&mut file).take(MAX_LINE).read_until(b'\n', line).map_err(io)?;
        let is_cut = length as u64 == MAX_LINE && line.last() != Some(&b'\n');
        if is_cut {
            // The rest of it is passed over.
            loop {
                let buffer = file.fill_buf().map_err(io)?;
                let end = buffer.iter().position(|&byte| byte == b'\n');
                let used = end.map_or(buffer.len(), |end| end + 1);
                let is_end = end.is_some() || buffer.is_empty();
                file.consume(used);
                if is_end {
                    break;
                }
            }
            line.clear();
            line.push(b'?');
        }
        Ok((length > 0).then_some(number))
    };

    let malformed = |what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Line(1), what };
    if next(line)?.is_none() {
        return Err(malformed("the file is empty, must begin with a header naming x,y,z".to_owned()));
    }
    let places = header(line).ok_or_else(|| malformed("the header is no text, must name x,y,z".to_owned()))?;
    for name in X..=Z {
        if places[name].is_none() {
            return Err(malformed(format!("the header lacks column {}, must name x,y,z", NAMES[name])));
        }
    }
    let unknown = || text(line).unwrap_or_default().split(',').map(str::trim).filter(|name| !NAMES.contains(name));
    if unknown().next().is_some() {
        let what = format!("columns that mean nothing here: {}", unknown().collect::<Vec<_>>().join(", "));
        faults.note(Fault::UnknownColumn, unknown().count() as u64, path, Place::Line(1), what);
    }
    cloud.has_ring = places[RING].is_some();
    cloud.has_key = places[AZIMUTH].is_some();
    cloud.has_time = places[TIME].is_some();

    while let Some(number) = next(line)? {
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let row = text(line).and_then(|line| row(line, &places));
        let (point, fits) = row.unwrap_or_else(|| {
            let what = "a row that cannot be read: numbers must stand in all named columns";
            faults.note(Fault::BadRow, 1, path, Place::Line(number), what);
            (UNREADABLE, true)
        });
        if !fits {
            faults.note(Fault::Intensity, 1, path, Place::Line(number), "an intensity outside 0 to 255");
        }
        if cloud.has_time && point.position_m[0].is_finite() {
            cloud.start_ns = Some(cloud.start_ns.map_or(point.time_ns, |start| start.min(point.time_ns)));
        }
        cloud.push(point);
    }
    Ok(())
}

/// Keeps the numbering of the file's rows.
const UNREADABLE: Point = Point { position_m: [f64::NAN; 3], key: f64::NAN, time_ns: 0, ring: u8::MAX, intensity: 0 };

/// The point of a row and whether its intensity fits; none if a number is missing or no number.
fn row(line: &str, places: &[Option<usize>; NAMES.len()]) -> Option<(Point, bool)> {
    let mut fields = [None; NAMES.len()];
    for (place, field) in line.split(',').enumerate() {
        for (found, _) in fields.iter_mut().zip(places).filter(|(_, at)| **at == Some(place)) {
            *found = Some(field.trim());
        }
    }
    // Absent from the header is a default, absent from the row is not.
    let number = |name: usize, default: f64| match places[name] {
        None => Some(default),
        Some(_) => fields[name]?.parse::<f64>().ok(),
    };
    let position_m = [number(X, 0.0)?, number(Y, 0.0)?, number(Z, 0.0)?];
    let ring = match places[RING] {
        None => u8::MAX,
        Some(_) => fields[RING]?.parse::<u8>().ok()?,
    };
    let time_ns = match places[TIME] {
        None => 0,
        Some(_) => fields[TIME]?.parse::<u64>().ok()?,
    };
    let (intensity, fits) = intensity(number(INTENSITY, 0.0)?);
    Some((Point { position_m, key: number(AZIMUTH, 0.0)?, time_ns, ring, intensity }, fits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_known_in_any_order_with_spaces_and_byte_order_mark() {
        assert!(is_csv(b"x,y,z\n1,2,3\n"));
        assert!(is_csv(b"\xEF\xBB\xBFtime_ns, z , y,x\r\n"));
        assert!(!is_csv(b"x,y\n"));
        assert!(!is_csv(b"1,2,3\n"));
        assert!(!is_csv(b""));
        assert!(!is_csv(b"x,y,\xFFz\n"));
    }
}
