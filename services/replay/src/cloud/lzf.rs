//! LZF, the compression of PCL's `binary_compressed` (Marc Lehmann's liblzf format).

/// The compressed bytes contradict themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Torn;

/// Most bytes that one compressed byte can stand for: three bytes repeat up to 264.
pub(crate) const MAX_RATIO: u64 = 88;

/// Unpacks `packed` behind what `out` holds; never beyond `limit` bytes in all. What was unpacked before a fault stays.
pub(crate) fn unpack(packed: &[u8], limit: usize, out: &mut Vec<u8>) -> Result<(), Torn> {
    let mut rest = packed.iter().copied();
    while let Some(control) = rest.next() {
        let control = usize::from(control);
        if control < 32 {
            // A literal run of control + 1 bytes.
            for _ in 0..=control {
                let byte = rest.next().ok_or(Torn)?;
                if out.len() >= limit {
                    return Err(Torn);
                }
                out.push(byte);
            }
            continue;
        }
        // A repetition: three bits of length, thirteen of distance; length 7 continues in the next byte.
        let mut length = control >> 5;
        if length == 7 {
            length += usize::from(rest.next().ok_or(Torn)?);
        }
        let distance = ((control & 0x1F) << 8 | usize::from(rest.next().ok_or(Torn)?)) + 1;
        let from = out.len().checked_sub(distance).ok_or(Torn)?;
        for i in 0..length + 2 {
            if out.len() >= limit {
                return Err(Torn);
            }
            out.push(out[from + i]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unpacked(packed: &[u8]) -> Result<Vec<u8>, Torn> {
        let mut out = Vec::new();
        unpack(packed, 1_000, &mut out).map(|()| out)
    }

    #[test]
    fn literals_and_repetitions_unpack_as_the_format_says() {
        assert_eq!(unpacked(&[]), Ok(vec![]));
        assert_eq!(unpacked(&[2, b'a', b'b', b'c']), Ok(b"abc".to_vec()));
        // "abc", then 3 bytes from 3 back.
        assert_eq!(unpacked(&[2, b'a', b'b', b'c', 1 << 5, 2]), Ok(b"abcabc".to_vec()));
        // A repetition that overlaps itself: one byte, 9 + 20 times more.
        assert_eq!(unpacked(&[0, b'z', 7 << 5, 20, 0]), Ok(vec![b'z'; 30]));
    }

    #[test]
    fn bytes_that_contradict_themselves_are_torn() {
        for packed in [&[2, b'a'][..], &[1 << 5, 0], &[0, b'a', 1 << 5], &[0, b'a', 7 << 5, 3], &[0, b'a', 1 << 5, 1]] {
            assert_eq!(unpacked(packed), Err(Torn), "{packed:?}");
        }
        let mut out = Vec::new();
        assert_eq!(unpack(&[0, b'z', 7 << 5, 255, 0], 10, &mut out), Err(Torn));
        assert_eq!(out.len(), 10);
    }
}
