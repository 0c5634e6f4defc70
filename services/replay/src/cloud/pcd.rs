//! Point Cloud Data of PCL, version 0.7 and older: a text header, then ascii, binary or compressed values.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::value::{Kind, Number};
use super::{Cloud, Point, intensity, lzf};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// Longest line [bytes].
const MAX_LINE: u64 = 65_536;
/// Most lines of a header.
const MAX_HEADER: usize = 100;
/// Largest point [bytes].
const MAX_POINT_BYTES: usize = 4_096;

const NAMES: [&str; 5] = ["x", "y", "z", "intensity", "ring"];
const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
const INTENSITY: usize = 3;
const RING: usize = 4;

/// Whether a file begins as a PCD header does.
pub(crate) fn is_pcd(head: &[u8]) -> bool {
    let keys = ["VERSION", "FIELDS", "COLUMNS"];
    head.split(|&byte| byte == b'\n')
        .map(|line| line.trim_ascii())
        .find(|line| !line.is_empty() && !line.starts_with(b"#"))
        .is_some_and(|line| {
            keys.iter().any(|key| line.strip_prefix(key.as_bytes()).is_some_and(|rest| rest.starts_with(b" ")))
        })
}

/// A field that is used.
#[derive(Clone, Copy, Debug)]
struct Field {
    kind: Kind,
    /// Offset in a binary point [bytes].
    offset: usize,
    /// Offset in an ascii point [values].
    value: usize,
    /// Bytes of all its values in a point; the first is used.
    stride: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

struct Header {
    fields: [Option<Field>; NAMES.len()],
    point_bytes: usize,
    points: u64,
    encoding: Encoding,
    /// Where the points begin [bytes].
    end: u64,
    lines: u64,
}

/// Reads the points of `path` into `cloud`, which is empty. `memory` is memory to use again.
pub(crate) fn read(
    path: &Path,
    cloud: &mut Cloud,
    memory: &mut Memory,
    faults: &mut Faults,
) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut file = BufReader::with_capacity(1 << 16, File::open(path).map_err(io)?);
    let header = Header::read(path, &mut file)?;
    cloud.has_ring = header.fields[RING].is_some();
    match header.encoding {
        Encoding::Ascii => read_ascii(path, &mut file, &header, cloud, memory, faults),
        Encoding::Binary => read_binary(path, &mut file, &header, cloud, memory, faults),
        Encoding::Compressed => read_compressed(path, &mut file, &header, cloud, memory, faults),
    }
}

/// Memory that is used again from file to file.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    bytes: Vec<u8>,
    unpacked: Vec<u8>,
}

impl Header {
    fn read(path: &Path, file: &mut impl BufRead) -> Result<Self, ReplayError> {
        let (mut names, mut sizes, mut letters) = (Vec::new(), Vec::new(), Vec::new());
        let mut counts: Option<Vec<usize>> = None;
        let (mut width, mut height, mut points) = (None, None, None);
        let (mut end, mut lines) = (0, 0);
        let mut line = Vec::new();
        let encoding = loop {
            let malformed =
                |what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Line(lines + 1), what };
            line.clear();
            let length = file
                .take(MAX_LINE)
                .read_until(b'\n', &mut line)
                .map_err(|source| ReplayError::Io { path: path.to_owned(), source })?;
            if length == 0 || lines as usize >= MAX_HEADER {
                return Err(malformed("the header has no line DATA ascii, binary or binary_compressed".to_owned()));
            }
            end += length as u64;
            let text = String::from_utf8_lossy(&line);
            let mut words = text.split_whitespace();
            let key = words.next().unwrap_or("#");
            let words: Vec<&str> = words.collect();
            let number = || words.first().and_then(|word| word.parse::<u64>().ok());
            let numbers = || words.iter().map(|word| word.parse::<usize>().ok()).collect::<Option<Vec<_>>>();
            let bad = |must: &str| malformed(format!("{key} is \"{}\", must be {must}", words.join(" ")));
            match key {
                "FIELDS" | "COLUMNS" => names = words.iter().map(|&word| word.to_owned()).collect(),
                "SIZE" => sizes = numbers().ok_or_else(|| bad("one number of bytes a field"))?,
                "TYPE" => letters = words.iter().map(|word| word.as_bytes()[0]).collect(),
                "COUNT" => counts = Some(numbers().ok_or_else(|| bad("one number of values a field"))?),
                "WIDTH" => width = Some(number().ok_or_else(|| bad("a number of points"))?),
                "HEIGHT" => height = Some(number().ok_or_else(|| bad("a number of rows"))?),
                "POINTS" => points = Some(number().ok_or_else(|| bad("a number of points"))?),
                "DATA" => {
                    break match words.first() {
                        Some(&"ascii") => Encoding::Ascii,
                        Some(&"binary") => Encoding::Binary,
                        Some(&"binary_compressed") => Encoding::Compressed,
                        _ => return Err(bad("ascii, binary or binary_compressed")),
                    };
                }
                _ => {} // VERSION, VIEWPOINT, comments
            }
            lines += 1;
        };
        let malformed =
            |what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Line(lines + 1), what };
        let counts = counts.unwrap_or_else(|| vec![1; names.len()]);
        if [sizes.len(), letters.len(), counts.len()].iter().any(|&len| len != names.len()) {
            let found = [names.len(), sizes.len(), letters.len(), counts.len()];
            return Err(malformed(format!("FIELDS, SIZE, TYPE, COUNT have {found:?} words, must have as many each")));
        }
        let mut fields = [None; NAMES.len()];
        let (mut offset, mut value) = (0_usize, 0_usize);
        for (index, name) in names.iter().enumerate() {
            let Some(kind) = kind(letters[index], sizes[index]) else {
                let letter = char::from(letters[index]);
                let must = "F with 4 or 8, or I or U with 1, 2, 4 or 8";
                return Err(malformed(format!("field {name} is {letter} with {} bytes, must be {must}", sizes[index])));
            };
            if counts[index] == 0 {
                return Err(malformed(format!("COUNT of field {name} is 0, must be at least 1")));
            }
            let stride = kind.bytes().saturating_mul(counts[index]);
            if let Some(place) = NAMES.iter().position(|known| known == name) {
                fields[place] = Some(Field { kind, offset, value, stride });
            }
            offset = offset.saturating_add(stride);
            value = value.saturating_add(counts[index]);
            if offset > MAX_POINT_BYTES {
                return Err(malformed(format!("a point has {offset} bytes, must have at most {MAX_POINT_BYTES}")));
            }
        }
        if fields[X].is_none() || fields[Y].is_none() || fields[Z].is_none() {
            return Err(malformed(format!("FIELDS are \"{}\", must name x, y and z", names.join(" "))));
        }
        let area = width.zip(height).map(|(width, height)| width.saturating_mul(height)).or(width);
        let Some(points) = points.or(area) else {
            return Err(malformed("the header has neither POINTS nor WIDTH and HEIGHT".to_owned()));
        };
        if area.is_some_and(|area| area != points) {
            let what = format!("POINTS is {points}, must be WIDTH times HEIGHT, {}", area.unwrap_or(0));
            return Err(malformed(what));
        }
        Ok(Self { fields, point_bytes: offset, points, encoding, end, lines: lines + 1 })
    }

    fn point(&self, value: impl Fn(&Field) -> Option<f64>) -> Option<(Point, bool)> {
        let number = |name: usize| self.fields[name].as_ref().map(&value);
        let position_m = [number(X)??, number(Y)??, number(Z)??];
        let (intensity, fits) = match number(INTENSITY) {
            Some(strength) => intensity(strength?),
            None => (0, true),
        };
        let ring = match number(RING) {
            Some(ring) => Some(ring?).filter(|ring| ring.fract() == 0.0 && (0.0..255.0).contains(ring)),
            None => None,
        };
        let ring = ring.map_or(u8::MAX, |ring| ring as u8);
        Some((Point { position_m, key: 0.0, time_ns: 0, ring, intensity }, fits))
    }
}

/// The kind of a TYPE and SIZE.
fn kind(letter: u8, bytes: usize) -> Option<Kind> {
    Some(match (letter, bytes) {
        (b'F', 4) => Kind::F32,
        (b'F', 8) => Kind::F64,
        (b'I', 1) => Kind::I8,
        (b'I', 2) => Kind::I16,
        (b'I', 4) => Kind::I32,
        (b'I', 8) => Kind::I64,
        (b'U', 1) => Kind::U8,
        (b'U', 2) => Kind::U16,
        (b'U', 4) => Kind::U32,
        (b'U', 8) => Kind::U64,
        _ => return None,
    })
}

fn float(field: &Field, bytes: &[u8]) -> Option<f64> {
    field.kind.number(bytes, false).map(Number::float)
}

/// Keeps the numbering of the file's points.
const UNREADABLE: Point = Point { position_m: [f64::NAN; 3], key: 0.0, time_ns: 0, ring: u8::MAX, intensity: 0 };

fn keep(found: Option<(Point, bool)>, cloud: &mut Cloud, path: &Path, place: Place, faults: &mut Faults) {
    let (point, fits) = found.unwrap_or_else(|| {
        faults.note(Fault::BadRow, 1, path, place, "a point that cannot be read");
        (UNREADABLE, true)
    });
    if !fits {
        faults.note(Fault::Intensity, 1, path, place, "an intensity outside 0 to 255");
    }
    cloud.push(point);
}

fn torn(header: &Header, got: u64, cloud: &mut Cloud, path: &Path, at: Place, faults: &mut Faults) {
    if got < header.points {
        let what = format!("the file ends after {got} of the {} points that its header promises", header.points);
        cloud.is_torn = true;
        faults.note(Fault::TornCloud, header.points - got, path, at, what);
    }
}

fn read_ascii(
    path: &Path,
    file: &mut impl BufRead,
    header: &Header,
    cloud: &mut Cloud,
    memory: &mut Memory,
    faults: &mut Faults,
) -> Result<(), ReplayError> {
    let (mut got, mut line) = (0, header.lines);
    while got < header.points {
        memory.bytes.clear();
        let length = file
            .take(MAX_LINE)
            .read_until(b'\n', &mut memory.bytes)
            .map_err(|source| ReplayError::Io { path: path.to_owned(), source })?;
        if length == 0 {
            break;
        }
        line += 1;
        if memory.bytes.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let text = std::str::from_utf8(&memory.bytes).ok();
        let point =
            text.and_then(|text| header.point(|field| text.split_ascii_whitespace().nth(field.value)?.parse().ok()));
        keep(point, cloud, path, Place::Line(line), faults);
        got += 1;
    }
    torn(header, got, cloud, path, Place::Line(line), faults);
    Ok(())
}

fn read_binary(
    path: &Path,
    file: &mut impl Read,
    header: &Header,
    cloud: &mut Cloud,
    memory: &mut Memory,
    faults: &mut Faults,
) -> Result<(), ReplayError> {
    memory.bytes.clear();
    memory.bytes.resize(header.point_bytes, 0);
    let mut got = 0;
    while got < header.points {
        match file.read_exact(&mut memory.bytes) {
            Ok(()) => {}
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => break,
            Err(source) => return Err(ReplayError::Io { path: path.to_owned(), source }),
        }
        let offset = header.end + got * header.point_bytes as u64;
        let point = header.point(|field| float(field, memory.bytes.get(field.offset..)?));
        keep(point, cloud, path, Place::Byte(offset), faults);
        got += 1;
    }
    torn(header, got, cloud, path, Place::Byte(header.end + got * header.point_bytes as u64), faults);
    Ok(())
}

/// Compressed points stand field by field: all x, then all y.
fn read_compressed(
    path: &Path,
    file: &mut impl Read,
    header: &Header,
    cloud: &mut Cloud,
    memory: &mut Memory,
    faults: &mut Faults,
) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let malformed =
        |at: u64, what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Byte(at), what };
    let mut sizes = [0; 8];
    file.read_exact(&mut sizes).map_err(|_| malformed(header.end, "the file ends before its sizes".to_owned()))?;
    let [a, b, c, d, e, f, g, h] = sizes;
    let packed = u64::from(u32::from_le_bytes([a, b, c, d]));
    let whole = u64::from(u32::from_le_bytes([e, f, g, h]));
    let expected = header.points.saturating_mul(header.point_bytes as u64);
    if whole != expected {
        let what = format!("{whole} bytes when unpacked, must be {expected} for {} points", header.points);
        return Err(malformed(header.end + 4, what));
    }
    memory.bytes.clear();
    file.take(packed).read_to_end(&mut memory.bytes).map_err(io)?;
    if whole > memory.bytes.len() as u64 * lzf::MAX_RATIO {
        let what = format!("{} bytes cannot hold {whole} bytes compressed; the file is cut off", memory.bytes.len());
        return Err(malformed(header.end + 8, what));
    }
    memory.unpacked.clear();
    let is_whole = lzf::unpack(&memory.bytes, whole as usize, &mut memory.unpacked).is_ok();
    if !is_whole || (memory.unpacked.len() as u64) < whole {
        // Field by field: a point is whole only if its last field is, so nothing short of nearly all of it is of use.
        let at = Place::Byte(header.end + 8 + packed.min(memory.bytes.len() as u64));
        faults.note(Fault::TornCloud, 1, path, at, "the compressed points are cut off or torn");
    }
    for index in 0..header.points {
        let point = header.point(|field| {
            let column = header.points as usize * field.offset;
            float(field, memory.unpacked.get(column + index as usize * field.stride..)?)
        });
        if point.is_none() {
            torn(header, index, cloud, path, Place::Byte(header.end + 8), faults);
            break;
        }
        keep(point, cloud, path, Place::Byte(header.end + 8), faults);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_a_letter_and_a_size() {
        assert_eq!(kind(b'F', 4), Some(Kind::F32));
        assert_eq!(kind(b'U', 1), Some(Kind::U8));
        assert_eq!((kind(b'F', 2), kind(b'U', 9)), (None, None));
    }

    #[test]
    fn a_header_is_known_by_its_first_word() {
        assert!(is_pcd(b"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"));
        assert!(is_pcd(b"VERSION .7\r\nFIELDS x y z\r\n"));
        assert!(!is_pcd(b"# a comment\nx,y,z\n"));
        assert!(!is_pcd(b""));
    }
}
