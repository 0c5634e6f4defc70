//! A `velodyne_msgs/msg/VelodyneScan` message: a header, then data packets with the host's stamps.

use crate::velodyne::{PACKET_BYTES, Packet};

/// How a message's bytes are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Common data representation of ROS 2, little-endian: fields are aligned to their size.
    Cdr,
    /// ROS 1: no header, nothing aligned.
    Ros1,
}

/// Packets of the message at hand. Its bytes are kept, so that no packet takes memory.
#[derive(Debug)]
pub(super) struct Scan {
    encoding: Encoding,
    bytes: Vec<u8>,
    at: usize,
    left: u32,
}

impl Default for Scan {
    fn default() -> Self {
        Self { encoding: Encoding::Cdr, bytes: Vec::new(), at: 0, left: 0 }
    }
}

impl Scan {
    /// Takes a message in place of the one before.
    ///
    /// # Errors
    /// It is in a byte order that is not read, or ends inside its header.
    pub(super) fn take(&mut self, encoding: Encoding, message: &[u8]) -> Result<(), &'static str> {
        self.bytes.clear();
        self.left = 0;
        let body = match encoding {
            // Representation identifier 1: plain CDR, little-endian; the other two bytes are options.
            Encoding::Cdr => message.strip_prefix(&[0, 1]).and_then(|rest| rest.get(2..)),
            Encoding::Ros1 => Some(message),
        };
        let body = body.ok_or("a message is not little-endian CDR")?;
        self.encoding = encoding;
        self.bytes.extend_from_slice(body);
        self.left = self.header().ok_or("a message ends inside its header")?;
        Ok(())
    }

    /// The next packet and its stamp [ns] since 1970, 0 where it has none; nothing after the last.
    ///
    /// # Errors
    /// The message ends before the packets that it promises.
    pub(super) fn next(&mut self, packet: &mut Packet) -> Option<Result<u64, &'static str>> {
        self.left = self.left.checked_sub(1)?;
        let found = self.packet(packet);
        if found.is_none() {
            self.left = 0;
        }
        Some(found.ok_or("a message ends before the packets that it promises"))
    }

    fn packet(&mut self, packet: &mut Packet) -> Option<u64> {
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let bytes = self.bytes.get(self.at..)?.get(..PACKET_BYTES)?;
        packet.bytes.copy_from_slice(bytes);
        self.at += PACKET_BYTES;
        Some(u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds))
    }

    /// Steps over the header and gives the number of packets.
    fn header(&mut self) -> Option<u32> {
        self.at = 0;
        if self.encoding == Encoding::Ros1 {
            self.u32()?; // a sequence number
        }
        let (_seconds, _nanoseconds) = (self.u32()?, self.u32()?);
        let frame_id = self.u32()? as usize;
        self.bytes.get(self.at..)?.get(..frame_id)?;
        self.at += frame_id;
        self.u32()
    }

    fn u32(&mut self) -> Option<u32> {
        if self.encoding == Encoding::Cdr {
            self.at = self.at.next_multiple_of(4);
        }
        let found = self.bytes.get(self.at..)?.first_chunk()?;
        self.at += 4;
        Some(u32::from_le_bytes(*found))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(encoding: Encoding, frame_id: &[u8], packets: u8) -> Vec<u8> {
        let mut bytes = if encoding == Encoding::Cdr { vec![] } else { vec![0; 4] };
        let pad = |bytes: &mut Vec<u8>| {
            if encoding == Encoding::Cdr {
                bytes.resize(bytes.len().next_multiple_of(4), 0);
            }
        };
        bytes.extend([0; 8]);
        bytes.extend((frame_id.len() as u32).to_le_bytes());
        bytes.extend(frame_id);
        pad(&mut bytes);
        bytes.extend(u32::from(packets).to_le_bytes());
        for number in 0..packets {
            pad(&mut bytes);
            bytes.extend([number, 0, 0, 0, 7, 0, 0, 0]);
            bytes.extend([number; PACKET_BYTES]);
        }
        if encoding == Encoding::Cdr { [&[0, 1, 0, 0][..], &bytes].concat() } else { bytes }
    }

    #[test]
    fn packets_come_out_of_both_encodings_whatever_the_length_of_the_frames_name() {
        for encoding in [Encoding::Cdr, Encoding::Ros1] {
            for frame_id in [&b""[..], b"a", b"ab", b"abc", b"velodyne"] {
                let mut sut = Scan::default();
                sut.take(encoding, &message(encoding, frame_id, 3)).unwrap();
                let mut packet = Packet::default();
                for number in 0..3_u8 {
                    assert_eq!(sut.next(&mut packet), Some(Ok(u64::from(number) * 1_000_000_000 + 7)));
                    assert_eq!(packet.bytes, [number; PACKET_BYTES]);
                }
                assert_eq!(sut.next(&mut packet), None);
            }
        }
    }

    #[test]
    fn a_message_cut_anywhere_gives_the_packets_before_the_cut_and_never_panics() {
        for encoding in [Encoding::Cdr, Encoding::Ros1] {
            let whole = message(encoding, b"frame", 2);
            let first = message(encoding, b"frame", 1).len();
            for cut in 0..whole.len() {
                let mut sut = Scan::default();
                let mut packet = Packet::default();
                if sut.take(encoding, &whole[..cut]).is_ok() {
                    let found = std::iter::from_fn(|| sut.next(&mut packet)).take_while(Result::is_ok).count();
                    assert_eq!(found, usize::from(cut >= first), "cut at {cut}");
                }
            }
        }
        let mut sut = Scan::default();
        assert!(sut.take(Encoding::Cdr, &[0, 0, 0, 0, 0, 0, 0, 0]).is_err(), "big-endian");
        let hostile = [&[0, 1, 0, 0][..], &[0; 8], &[0xFF; 4], &[0; 40]].concat();
        assert!(sut.take(Encoding::Cdr, &hostile).is_err(), "a name longer than any memory");
    }
}
