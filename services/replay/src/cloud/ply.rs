//! Polygon file format: a text header, then ascii or binary elements, of which the vertices are the points.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use super::fields::{Meanings, UNREADABLE};
use super::ply_header::{Element, Encoding, Header, MAX_LINE};
use super::value::Number;
use super::{Cloud, Point};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// Whether a file begins as a PLY header does.
pub(crate) fn is_ply(head: &[u8]) -> bool {
    head.strip_prefix(b"ply").is_some_and(|rest| rest.starts_with(b"\n") || rest.starts_with(b"\r\n"))
}

/// Memory that is used again from file to file.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    line: Vec<u8>,
    numbers: Vec<Number>,
}

/// Reads the vertices of `path` into `cloud`, which is empty. Other elements are passed over. `memory` is memory to use
/// again.
pub(crate) fn read(
    path: &Path,
    cloud: &mut Cloud,
    memory: &mut Memory,
    faults: &mut Faults,
) -> Result<(), ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut file = BufReader::with_capacity(1 << 16, File::open(path).map_err(io)?);
    let header = Header::read(path, &mut file)?;
    let malformed =
        |what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Line(header.lines), what };
    let place = header.elements.iter().position(|element| element.name == "vertex");
    let Some((before, vertex)) = place.map(|place| (&header.elements[..place], &header.elements[place])) else {
        return Err(malformed("the header has no element vertex, must have one with properties x, y and z".to_owned()));
    };
    let scalars = vertex.properties.iter().map(|property| if property.list.is_none() { &property.name } else { "" });
    let meanings = Meanings::of(scalars);
    if let Some(missing) = meanings.missing() {
        return Err(malformed(format!("element vertex has no property {missing}, must have x, y and z")));
    }
    cloud.has_ring = meanings.has_ring();
    cloud.has_key = meanings.has_column();
    cloud.has_time = meanings.has_time();

    let mut rows = Rows { file, encoding: header.encoding, offset: header.end, line: header.lines };
    let mut got = 0;
    let mut end = before.iter().try_for_each(|element| rows.pass_over(element, memory));
    while got < vertex.count && end.is_ok() {
        let place = rows.place();
        let found = match rows.next(vertex, memory) {
            Ok(is_read) => is_read,
            Err(error) => {
                end = Err(error);
                break;
            }
        };
        let found = if found { meanings.point(0, |field| memory.numbers.get(field).copied()) } else { None };
        keep(found, cloud, path, place, faults);
        got += 1;
    }
    match end {
        Err(error) if error.kind() != io::ErrorKind::UnexpectedEof && error.kind() != io::ErrorKind::InvalidData => {
            return Err(io_error(path, error));
        }
        Err(error) => {
            let what = format!("{error} after {got} of the {} points that its header promises", vertex.count);
            cloud.is_torn = true;
            faults.note(Fault::TornCloud, vertex.count - got, path, rows.place(), what);
        }
        Ok(()) => {}
    }
    if cloud.has_time {
        cloud.start_ns = cloud.points.iter().map(|point| point.time_ns).min();
    }
    Ok(())
}

fn io_error(path: &Path, source: io::Error) -> ReplayError {
    ReplayError::Io { path: path.to_owned(), source }
}

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

/// The elements of a file, one after the other.
struct Rows<R> {
    file: R,
    encoding: Encoding,
    /// Bytes before the next binary element.
    offset: u64,
    /// Lines before the next ascii element.
    line: u64,
}

impl<R: BufRead> Rows<R> {
    fn place(&self) -> Place {
        match self.encoding {
            Encoding::Ascii => Place::Line(self.line + 1),
            Encoding::LittleEndian | Encoding::BigEndian => Place::Byte(self.offset),
        }
    }

    /// Passes over all of an element.
    fn pass_over(&mut self, element: &Element, memory: &mut Memory) -> io::Result<()> {
        if let (Some(bytes), true) = (element.bytes(), self.encoding != Encoding::Ascii) {
            return self.skip(element.count.saturating_mul(bytes));
        }
        (0..element.count).try_for_each(|_| self.next(element, memory).map(|_| ()))
    }

    /// Reads the numbers of the next row, 0 in the place of a list; false if they cannot be read but the next can.
    /// At the end of the file [`io::ErrorKind::UnexpectedEof`].
    fn next(&mut self, element: &Element, memory: &mut Memory) -> io::Result<bool> {
        memory.numbers.clear();
        match self.encoding {
            Encoding::Ascii => {
                self.next_line(&mut memory.line)?;
                let text = std::str::from_utf8(&memory.line).unwrap_or_default();
                Ok(parse(text, element, &mut memory.numbers).is_some())
            }
            Encoding::LittleEndian | Encoding::BigEndian => {
                self.next_binary(element, &mut memory.numbers).map(|()| true)
            }
        }
    }

    /// The next line that is not empty.
    fn next_line(&mut self, line: &mut Vec<u8>) -> io::Result<()> {
        loop {
            line.clear();
            if (&mut self.file).take(MAX_LINE).read_until(b'\n', line)? == 0 {
                return Err(torn());
            }
            self.line += 1;
            if !line.iter().all(u8::is_ascii_whitespace) {
                return Ok(());
            }
        }
    }

    fn next_binary(&mut self, element: &Element, numbers: &mut Vec<Number>) -> io::Result<()> {
        let is_big_endian = self.encoding == Encoding::BigEndian;
        let mut bytes = [0; 8];
        for property in &element.properties {
            let kind = property.list.unwrap_or(property.kind);
            let bytes = &mut bytes[..kind.bytes()];
            self.file.read_exact(bytes).map_err(|error| if is_end(&error) { torn() } else { error })?;
            self.offset += bytes.len() as u64;
            let number = kind.number(bytes, is_big_endian).unwrap_or(Number::Integer(0));
            if property.list.is_none() {
                numbers.push(number);
                continue;
            }
            let Number::Integer(items @ 0..) = number else {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "a list has a negative length"));
            };
            self.skip((items as u64).saturating_mul(property.kind.bytes() as u64))?;
            numbers.push(Number::Integer(0));
        }
        Ok(())
    }

    fn skip(&mut self, bytes: u64) -> io::Result<()> {
        let skipped = io::copy(&mut (&mut self.file).take(bytes), &mut io::sink())?;
        self.offset += skipped;
        if skipped < bytes { Err(torn()) } else { Ok(()) }
    }
}

fn torn() -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, "the file ends")
}

fn is_end(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::UnexpectedEof
}

/// The numbers of an ascii row, 0 in the place of a list; none if one is missing or none.
fn parse(text: &str, element: &Element, numbers: &mut Vec<Number>) -> Option<()> {
    let mut words = text.split_ascii_whitespace();
    for property in &element.properties {
        let kind = property.list.unwrap_or(property.kind);
        let number = kind.parsed(words.next()?)?;
        match (property.list, number) {
            (None, number) => numbers.push(number),
            (Some(_), Number::Integer(items)) => {
                // What is not there cannot be passed over: a list may claim any length.
                for _ in 0..usize::try_from(items).ok()? {
                    words.next()?;
                }
                numbers.push(Number::Integer(0));
            }
            (Some(_), Number::Float(_)) => return None,
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_known_by_its_first_line() {
        assert!(is_ply(b"ply\nformat ascii 1.0\n"));
        assert!(is_ply(b"ply\r\nformat ascii 1.0\r\n"));
        assert!(!is_ply(b"plywood\n"));
        assert!(!is_ply(b"ply"));
    }
}
