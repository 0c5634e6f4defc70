//! Values of ROS messages, in CDR (ROS 2) or one after the other (ROS 1).

/// Reads values in their order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Values<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
    /// Numbers lie at multiples of their size.
    is_aligned: bool,
}

impl<'a> Values<'a> {
    /// CDR, which begins with how it is written; none if that is not known. Neither version 1 nor 2 differs in messages
    /// without numbers of eight bytes.
    pub(super) fn cdr(bytes: &'a [u8]) -> Option<Self> {
        let (&[high, low, _, _], bytes) = bytes.split_first_chunk::<4>()?;
        let is_known = high == 0 && matches!(low, 0 | 1 | 6 | 7);
        is_known.then_some(Self { bytes, at: 0, is_big_endian: low % 2 == 0, is_aligned: true })
    }

    /// ROS 1: little-endian, nothing between the values.
    pub(super) fn ros1(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, is_big_endian: false, is_aligned: false }
    }

    pub(super) fn is_ros1(&self) -> bool {
        !self.is_aligned
    }

    /// The bytes before the next value.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(length)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        if self.is_aligned {
            self.at = self.at.checked_next_multiple_of(4)?;
        }
        let bytes = self.take(4)?.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// A string without the zero that ends it.
    pub(super) fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        std::str::from_utf8(bytes).ok().map(|text| text.trim_end_matches('\0'))
    }

    /// Bytes with their number before them: as many as there are, and how many there should be.
    pub(super) fn bytes(&mut self) -> Option<(&'a [u8], usize)> {
        let length = self.u32()? as usize;
        let rest = &self.bytes[self.at.min(self.bytes.len())..];
        let taken = &rest[..length.min(rest.len())];
        self.at += taken.len();
        Some((taken, length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_in_cdr_only() {
        let body = [2, 0, 0, 0, b'a', 0, 9, 9, 7, 0, 0, 0];
        let mut sut = Values::cdr(&[0, 1, 0, 0, 2, 0, 0, 0, b'a', 0, 9, 9, 7, 0, 0, 0]).unwrap();
        assert_eq!((sut.string(), sut.u32(), sut.u8()), (Some("a"), Some(7), None));
        let mut sut = Values::ros1(&body);
        assert_eq!((sut.string(), sut.u8(), sut.u8(), sut.u32()), (Some("a"), Some(9), Some(9), Some(7)));
        let mut sut = Values::cdr(&[0, 0, 0, 0, 0, 0, 0, 7]).unwrap();
        assert_eq!(sut.u32(), Some(7));
        assert!(Values::cdr(&[0, 3, 0, 0]).is_none());
    }
}
