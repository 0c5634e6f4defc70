//! Records of a capture file, classic (`pcap`) or next generation (`pcapng`), as draft-ietf-opsawg-pcap and
//! draft-ietf-opsawg-pcapng lay them down. Read one by one through a buffer; nothing in them is trusted.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Longest record that is read [bytes]; tcpdump's own limit.
const MAX_RECORD: usize = 262_144;
/// Interfaces kept of a section.
const MAX_INTERFACES: usize = 256;

const SECTION: u32 = 0x0A0D_0D0A;
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
const INTERFACE: u32 = 1;
const OLD_PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const ENHANCED_PACKET: u32 = 6;
const TIME_RESOLUTION: u16 = 9;
const TIME_OFFSET: u16 = 14;

/// First bytes of a classic capture: stamps in µs, in ns, and with longer records ("modified").
const MICROS: u32 = 0xa1b2_c3d4;
const NANOS: u32 = 0xa1b2_3c4d;
const MODIFIED: u32 = 0xa1b2_cd34;

/// Whether a file that begins with `head` is a capture.
pub(crate) fn is_capture(head: &[u8]) -> bool {
    let Some(magic) = head.first_chunk().copied() else { return false };
    let [little, big] = [u32::from_le_bytes(magic), u32::from_be_bytes(magic)];
    little == SECTION || [MICROS, NANOS, MODIFIED].iter().any(|&known| known == little || known == big)
}

/// Why a file cannot be read on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Torn {
    #[error("the file ends inside a record")]
    Ends,
    #[error("a record claims {0} bytes, more than {MAX_RECORD} or fewer than its own header")]
    Length(u64),
    #[error("a record's two lengths differ: {0} and {1} bytes")]
    Lengths(u32, u32),
    #[error("the file has no header of a capture")]
    Header,
    #[error("the file cannot be read on: {0}")]
    Io(#[from] io::Error),
}

/// One record.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Record<'a> {
    /// A captured frame of a link type, with its host time [ns]; 0 where the record has none.
    Frame(i32, u64, &'a [u8]),
    /// A packet of an interface that no record describes.
    Unknown,
    /// Not a packet.
    Other,
}

/// How packets of an interface are to be read.
#[derive(Clone, Copy, Debug)]
struct Interface {
    link: i32,
    /// Counts of a stamp in a second.
    per_second: u64,
    /// Added to stamps [s].
    offset_s: i64,
    /// Most bytes of a packet; 0 = all.
    snap_bytes: usize,
}

impl Interface {
    fn time_ns(&self, counts: u64) -> u64 {
        let ns = i128::from(counts) * 1_000_000_000 / i128::from(self.per_second);
        u64::try_from(ns + i128::from(self.offset_s) * 1_000_000_000).unwrap_or(0)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Length of a record's header [bytes].
    Classic(usize),
    NextGeneration,
}

/// Numbers in the file's byte order.
#[derive(Clone, Copy, Debug)]
struct Order {
    is_big: bool,
}

impl Order {
    /// Zero beyond the end of `bytes`: lengths are checked before.
    fn u32(self, bytes: &[u8], at: usize) -> u32 {
        let found = bytes.get(at..).and_then(|bytes| bytes.first_chunk()).copied().unwrap_or_default();
        if self.is_big { u32::from_be_bytes(found) } else { u32::from_le_bytes(found) }
    }

    fn u16(self, bytes: &[u8], at: usize) -> u16 {
        let found = bytes.get(at..).and_then(|bytes| bytes.first_chunk()).copied().unwrap_or_default();
        if self.is_big { u16::from_be_bytes(found) } else { u16::from_le_bytes(found) }
    }
}

/// Reads a capture from its first byte.
pub(crate) struct Records<R> {
    file: R,
    kind: Kind,
    order: Order,
    /// Offset of the next record [bytes].
    offset: u64,
    bytes: Vec<u8>,
    interfaces: Vec<Interface>,
}

impl Records<BufReader<File>> {
    pub(crate) fn open(path: &Path) -> Result<Self, Torn> {
        Self::new(BufReader::with_capacity(1 << 16, File::open(path)?))
    }
}

impl<R: Read> Records<R> {
    /// Reads the header.
    pub(crate) fn new(file: R) -> Result<Self, Torn> {
        let bytes = Vec::with_capacity(MAX_RECORD);
        let order = Order { is_big: false };
        let mut sut = Self { file, kind: Kind::NextGeneration, order, offset: 0, bytes, interfaces: Vec::new() };
        if !sut.read(4)? || !is_capture(&sut.bytes) {
            return Err(Torn::Header);
        }
        let magic = sut.order.u32(&sut.bytes, 0);
        if magic == SECTION {
            // Type, length and byte order; the block itself is read with the others.
            let is_section = sut.read_on(8)? && sut.take_order();
            return if is_section { Ok(sut) } else { Err(Torn::Header) };
        }
        sut.order.is_big = ![MICROS, NANOS, MODIFIED].contains(&magic);
        let magic = sut.order.u32(&sut.bytes, 0);
        if !sut.read_on(20)? {
            return Err(Torn::Header);
        }
        sut.kind = Kind::Classic(if magic == MODIFIED { 24 } else { 16 });
        let per_second = if magic == NANOS { 1_000_000_000 } else { 1_000_000 };
        // The upper bits of the link type say how long a frame's check sequence is.
        let link = (sut.order.u32(&sut.bytes, 20) & 0x0FFF_FFFF) as i32;
        sut.interfaces.push(Interface { link, per_second, offset_s: 0, snap_bytes: 0 });
        sut.offset = 24;
        sut.bytes.clear();
        Ok(sut)
    }

    /// Offset of the record to come [bytes].
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// The next record; none at the end of the file.
    pub(crate) fn next(&mut self) -> Result<Option<Record<'_>>, Torn> {
        match self.kind {
            Kind::Classic(header) => self.next_classic(header),
            Kind::NextGeneration => self.next_block(),
        }
    }

    fn next_classic(&mut self, header: usize) -> Result<Option<Record<'_>>, Torn> {
        if !self.read(header)? {
            return Ok(None);
        }
        let [seconds, fraction, captured] = [0, 4, 8].map(|at| self.order.u32(&self.bytes, at));
        if captured as usize > MAX_RECORD - header {
            return Err(Torn::Length(u64::from(captured)));
        }
        if !self.read_on(captured as usize)? {
            return Err(Torn::Ends);
        }
        self.offset += (header + captured as usize) as u64;
        let Some(interface) = self.interfaces.first() else { return Ok(Some(Record::Unknown)) };
        let ns_per_count = 1_000_000_000 / interface.per_second;
        let host_ns = u64::from(seconds) * 1_000_000_000 + u64::from(fraction) * ns_per_count;
        Ok(Some(Record::Frame(interface.link, host_ns, &self.bytes[header..])))
    }

    fn next_block(&mut self) -> Result<Option<Record<'_>>, Torn> {
        // Of the file's first block the beginning has been read already.
        if self.offset > 0 || self.bytes.len() != 12 {
            if !self.read(8)? {
                return Ok(None);
            }
            if self.order.u32(&self.bytes, 0) == SECTION {
                if !self.read_on(4)? {
                    return Err(Torn::Ends);
                }
                if !self.take_order() {
                    return Err(Torn::Header);
                }
            }
        }
        let (kind, length) = (self.order.u32(&self.bytes, 0), self.order.u32(&self.bytes, 4));
        let whole = length as usize;
        let is_used = [SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, ENHANCED_PACKET].contains(&kind);
        if whole < self.bytes.len() + 4 || !whole.is_multiple_of(4) || (is_used && whole > MAX_RECORD) {
            return Err(Torn::Length(u64::from(length)));
        }
        if !is_used {
            // Names, statistics and others' blocks, of any length.
            let rest = u64::from(length) - self.bytes.len() as u64;
            if io::copy(&mut (&mut self.file).take(rest), &mut io::sink())? < rest {
                return Err(Torn::Ends);
            }
            self.offset += u64::from(length);
            return Ok(Some(Record::Other));
        }
        if !self.read_on(whole - self.bytes.len())? {
            return Err(Torn::Ends);
        }
        let again = self.order.u32(&self.bytes, whole - 4);
        if again != length {
            return Err(Torn::Lengths(length, again));
        }
        self.offset += u64::from(length);
        match kind {
            SECTION => self.interfaces.clear(),
            INTERFACE => self.describe(whole - 4),
            _ => return Ok(Some(self.packet(kind, whole - 4))),
        }
        Ok(Some(Record::Other))
    }

    /// Each section has its own byte order, by the word after its length; false if that says none.
    fn take_order(&mut self) -> bool {
        self.order.is_big = self.bytes[8..12] == BYTE_ORDER.to_be_bytes();
        self.order.u32(&self.bytes, 8) == BYTE_ORDER
    }

    /// Takes note of an interface; its options begin at byte 16 of the block.
    fn describe(&mut self, end: usize) {
        let (order, bytes) = (self.order, &self.bytes[..end]);
        let mut interface = Interface {
            link: i32::from(order.u16(bytes, 8)),
            per_second: 1_000_000,
            offset_s: 0,
            snap_bytes: order.u32(bytes, 12) as usize,
        };
        let mut at = 16;
        while let Some(option) = bytes.get(at..).filter(|option| option.len() >= 4) {
            let (code, length) = (order.u16(option, 0), usize::from(order.u16(option, 2)));
            let Some(value) = option.get(4..4 + length) else { break };
            match (code, value) {
                (TIME_RESOLUTION, &[resolution, ..]) => {
                    let exponent = u32::from(resolution & 0x7F);
                    let base: u64 = if resolution & 0x80 == 0 { 10 } else { 2 };
                    interface.per_second = base.checked_pow(exponent).unwrap_or(interface.per_second);
                }
                (TIME_OFFSET, &[a, b, c, d, e, f, g, h, ..]) => {
                    let found = [a, b, c, d, e, f, g, h];
                    interface.offset_s =
                        if order.is_big { i64::from_be_bytes(found) } else { i64::from_le_bytes(found) };
                }
                _ => {}
            }
            at += 4 + length.next_multiple_of(4);
        }
        if self.interfaces.len() < MAX_INTERFACES {
            self.interfaces.push(interface);
        }
    }

    fn packet(&self, kind: u32, end: usize) -> Record<'_> {
        let (order, bytes) = (self.order, &self.bytes[..end]);
        let number = match kind {
            ENHANCED_PACKET => order.u32(bytes, 8) as usize,
            OLD_PACKET => usize::from(order.u16(bytes, 8)),
            _ => 0,
        };
        let Some(interface) = self.interfaces.get(number) else { return Record::Unknown };
        if kind == SIMPLE_PACKET {
            let snap_bytes = if interface.snap_bytes == 0 { usize::MAX } else { interface.snap_bytes };
            let length = (order.u32(bytes, 8) as usize).min(snap_bytes);
            let data = bytes.get(12..).unwrap_or_default();
            return Record::Frame(interface.link, 0, data.get(..length).unwrap_or(data));
        }
        let counts = u64::from(order.u32(bytes, 12)) << 32 | u64::from(order.u32(bytes, 16));
        let captured = order.u32(bytes, 20) as usize;
        let data = bytes.get(28..).unwrap_or_default();
        Record::Frame(interface.link, interface.time_ns(counts), data.get(..captured).unwrap_or(data))
    }

    /// Reads `count` bytes in place of those before; false if the file has ended.
    fn read(&mut self, count: usize) -> Result<bool, Torn> {
        self.bytes.clear();
        let is_read = self.read_on(count)?;
        if !is_read && !self.bytes.is_empty() {
            return Err(Torn::Ends);
        }
        Ok(is_read)
    }

    /// Reads `count` more bytes; false if there are fewer.
    fn read_on(&mut self, count: usize) -> Result<bool, Torn> {
        let got = (&mut self.file).take(count as u64).read_to_end(&mut self.bytes)?;
        Ok(got == count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All records as link type, time and frame.
    fn frames(bytes: &[u8]) -> Vec<(i32, u64, Vec<u8>)> {
        let mut records = Records::new(bytes).unwrap();
        let mut frames = Vec::new();
        while let Some(record) = records.next().unwrap() {
            if let Record::Frame(link, host_ns, data) = record {
                frames.push((link, host_ns, data.to_vec()));
            }
        }
        assert_eq!(records.offset(), bytes.len() as u64);
        frames
    }

    fn words(words: &[u32], is_big: bool) -> Vec<u8> {
        words.iter().flat_map(|word| if is_big { word.to_be_bytes() } else { word.to_le_bytes() }).collect()
    }

    #[test]
    fn classic_captures_are_read_in_both_byte_orders_and_all_kinds_of_stamps() {
        for is_big in [false, true] {
            for (magic, fraction_ns, extra) in [(MICROS, 7_000, 0), (NANOS, 7, 0), (MODIFIED, 7_000, 2)] {
                let mut bytes = words(&[magic, 4 << 16 | 2, 0, 0, 65_535, 0xF000_0071], is_big);
                for length in [3_u8, 0] {
                    bytes.extend(words(&[5, 7, u32::from(length), 60], is_big));
                    bytes.extend(words(&vec![9; extra], is_big));
                    bytes.extend(vec![length; usize::from(length)]);
                }
                let time_ns = 5_000_000_000 + fraction_ns;
                assert_eq!(frames(&bytes), [(113, time_ns, vec![3; 3]), (113, time_ns, vec![])]);
            }
        }
    }

    /// A block of a next-generation capture.
    fn block(kind: u32, body: &[u8], is_big: bool) -> Vec<u8> {
        let length = body.len().next_multiple_of(4) as u32 + 12;
        let padding = vec![0; body.len().next_multiple_of(4) - body.len()];
        [words(&[kind, length], is_big), body.to_vec(), padding, words(&[length], is_big)].concat()
    }

    fn section(is_big: bool) -> Vec<u8> {
        block(SECTION, &words(&[BYTE_ORDER, 1, u32::MAX, u32::MAX], is_big), is_big)
    }

    fn interface(link: u16, options: &[u8], is_big: bool) -> Vec<u8> {
        let link = if is_big { link.to_be_bytes() } else { link.to_le_bytes() };
        block(INTERFACE, &[&link[..], &[0; 2], &words(&[0], is_big), options].concat(), is_big)
    }

    #[test]
    fn next_generation_captures_are_read_section_by_section() {
        let mut bytes = Vec::new();
        for is_big in [false, true] {
            let option = |code: u16, value: &[u8]| {
                let head = [code, value.len() as u16].map(|n| if is_big { n.to_be_bytes() } else { n.to_le_bytes() });
                [head.concat(), value.to_vec(), vec![0; value.len().next_multiple_of(4) - value.len()]].concat()
            };
            bytes.extend(section(is_big));
            bytes.extend(interface(1, &[], is_big));
            let offset = if is_big { 10_i64.to_be_bytes() } else { 10_i64.to_le_bytes() };
            let options =
                [option(TIME_RESOLUTION, &[0x80 | 10]), option(TIME_OFFSET, &offset), option(0, &[])].concat();
            bytes.extend(interface(101, &options, is_big));
            bytes.extend(block(5, &[1; 5], is_big)); // statistics
            let enhanced = |number, counts, data: &[u8]| {
                let head = words(&[number, 0, counts, data.len() as u32, 99], is_big);
                block(ENHANCED_PACKET, &[&head, data].concat(), is_big)
            };
            bytes.extend(enhanced(0, 3, &[1, 2, 3]));
            bytes.extend(enhanced(1, 512, &[4]));
            bytes.extend(enhanced(2, 0, &[5])); // nobody described it
            bytes.extend(block(SIMPLE_PACKET, &[&words(&[2], is_big)[..], &[6, 7]].concat(), is_big));
        }
        let expected = [(1, 3_000, vec![1, 2, 3]), (101, 10_500_000_000, vec![4]), (1, 0, vec![6, 7])];
        assert_eq!(frames(&bytes), [expected.clone(), expected].concat());
    }

    #[test]
    fn a_length_that_cannot_be_ends_the_file_there() {
        let torn = |bytes: &[u8]| {
            let mut records = Records::new(bytes).unwrap();
            while let Ok(Some(_)) = records.next() {}
            (records.offset(), records.next().is_err() || records.next().is_err())
        };
        let head = section(false);
        for length in [0_u32, 4, 8, 11, 13, u32::MAX, MAX_RECORD as u32 + 4] {
            let bytes = [&head[..], &words(&[ENHANCED_PACKET, length, 0, 0], false)].concat();
            let mut records = Records::new(&bytes[..]).unwrap();
            assert_eq!(records.next().unwrap(), Some(Record::Other));
            assert!(records.next().is_err(), "length {length}");
            assert_eq!(records.offset(), head.len() as u64);
        }
        let mut differing = [head.clone(), interface(1, &[], false)].concat();
        let end = differing.len() - 4;
        differing[end] ^= 4;
        assert_eq!(torn(&differing).0, head.len() as u64);
        assert!(matches!(Records::new(&b"\xd4\xc3\xb2\xa1\0"[..]), Err(Torn::Header)));
        assert!(matches!(Records::new(&b"GIF89a"[..]), Err(Torn::Header)));
    }
}
