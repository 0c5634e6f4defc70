//! The text header of a PLY file: elements in the order of the file, and their properties.

use std::io::{BufRead, Read};
use std::path::Path;

use super::value::Kind;
use crate::error::{Place, ReplayError};

/// Longest line [bytes].
pub(crate) const MAX_LINE: u64 = 65_536;
/// Most lines of a header.
const MAX_LINES: u64 = 2_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A property of an element.
#[derive(Clone, Debug)]
pub(crate) struct Property {
    pub(crate) name: String,
    /// Kind of a list's length, where it is one.
    pub(crate) list: Option<Kind>,
    pub(crate) kind: Kind,
}

#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: u64,
    pub(crate) properties: Vec<Property>,
}

impl Element {
    /// Bytes that each takes in a binary file, where that is fixed.
    pub(crate) fn bytes(&self) -> Option<u64> {
        let is_fixed = self.properties.iter().all(|property| property.list.is_none());
        is_fixed.then(|| self.properties.iter().map(|property| property.kind.bytes() as u64).sum())
    }
}

#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) encoding: Encoding,
    pub(crate) elements: Vec<Element>,
    /// Where the elements begin [bytes].
    pub(crate) end: u64,
    /// Lines before that.
    pub(crate) lines: u64,
}

fn kind(word: &str) -> Option<Kind> {
    Some(match word {
        "char" | "int8" => Kind::I8,
        "uchar" | "uint8" => Kind::U8,
        "short" | "int16" => Kind::I16,
        "ushort" | "uint16" => Kind::U16,
        "int" | "int32" => Kind::I32,
        "uint" | "uint32" => Kind::U32,
        "float" | "float32" => Kind::F32,
        "double" | "float64" => Kind::F64,
        "int64" => Kind::I64,
        "uint64" => Kind::U64,
        _ => return None,
    })
}

impl Header {
    /// Reads the header with which `file` begins.
    pub(crate) fn read(path: &Path, file: &mut impl BufRead) -> Result<Self, ReplayError> {
        let (mut end, mut lines) = (0, 0);
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut line = Vec::new();
        loop {
            let malformed =
                |what: String| ReplayError::Malformed { path: path.to_owned(), place: Place::Line(lines + 1), what };
            line.clear();
            let length = (&mut *file)
                .take(MAX_LINE)
                .read_until(b'\n', &mut line)
                .map_err(|source| ReplayError::Io { path: path.to_owned(), source })?;
            if line.last() != Some(&b'\n') || lines >= MAX_LINES {
                return Err(malformed("the header has no line end_header".to_owned()));
            }
            end += length as u64;
            let text = String::from_utf8_lossy(&line);
            let words: Vec<&str> = text.split_whitespace().collect();
            let bad = |must: &str| malformed(format!("\"{}\" must be {must}", words.join(" ")));
            match words.as_slice() {
                ["format", word, _version] => {
                    encoding = Some(match *word {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(bad("format ascii, binary_little_endian or binary_big_endian, and 1.0")),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| bad("element, a name and a number"))?;
                    elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                }
                ["property", rest @ ..] => {
                    let property = match rest {
                        ["list", length, item, name] => {
                            kind(length).zip(kind(item)).map(|(list, kind)| (name, Some(list), kind))
                        }
                        [word, name] => kind(word).map(|kind| (name, None, kind)),
                        _ => None,
                    };
                    let (name, list, kind) = property.ok_or_else(|| bad("property [list KIND] KIND NAME"))?;
                    if list.is_some_and(|list| matches!(list, Kind::F32 | Kind::F64)) {
                        return Err(bad("a list whose length is an integer"));
                    }
                    let element = elements.last_mut().ok_or_else(|| bad("below an element"))?;
                    element.properties.push(Property { name: (*name).to_owned(), list, kind });
                }
                ["end_header"] => break,
                ["ply"] if lines == 0 => {}
                ["comment" | "obj_info", ..] | [] => {}
                _ => return Err(bad("format, element, property, comment, obj_info or end_header")),
            }
            lines += 1;
        }
        let malformed = |what: &str| ReplayError::Malformed {
            path: path.to_owned(),
            place: Place::Line(lines + 1),
            what: what.into(),
        };
        let encoding = encoding.ok_or_else(|| malformed("the header has no line format"))?;
        Ok(Self { encoding, elements, end, lines: lines + 1 })
    }
}
