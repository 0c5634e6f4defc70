use super::MAX_LINE_BYTES;

/// Bytes of one peer on their way to being lines.
#[derive(Default)]
pub(crate) struct Lines {
    bytes: Vec<u8>,
    /// Bytes of `bytes` that hold no end of a line.
    searched: usize,
    /// The line under way is too long: what comes is dropped up to its end.
    is_too_long: bool,
}

/// A line.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Line {
    /// As it came, without its end.
    Whole(Vec<u8>),
    /// Longer than allowed, and dropped.
    TooLong,
}

impl Lines {
    /// Takes what came.
    pub(crate) fn take(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Whether a line has begun and not ended.
    pub(crate) fn is_open(&self) -> bool {
        self.is_too_long || !self.bytes.is_empty()
    }

    /// The next line that is whole, or that has just become too long; blank lines are none.
    pub(crate) fn next(&mut self) -> Option<Line> {
        loop {
            let Some(end) = self.bytes[self.searched..].iter().position(|&byte| byte == b'\n') else {
                self.searched = self.bytes.len();
                if !self.is_too_long && self.bytes.len() < MAX_LINE_BYTES {
                    return None;
                }
                self.bytes.clear();
                self.searched = 0;
                return (!std::mem::replace(&mut self.is_too_long, true)).then_some(Line::TooLong);
            };
            let end = self.searched + end;
            let mut line: Vec<u8> = self.bytes.drain(..=end).collect();
            self.searched = 0;
            line.pop();
            if std::mem::take(&mut self.is_too_long) || line.trim_ascii().is_empty() {
                continue;
            }
            return Some(if line.len() < MAX_LINE_BYTES { Line::Whole(line) } else { Line::TooLong });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(sut: &mut Lines) -> Vec<Line> {
        std::iter::from_fn(|| sut.next()).collect()
    }

    fn whole(text: &str) -> Line {
        Line::Whole(text.as_bytes().to_vec())
    }

    #[test]
    fn lines_come_whole_however_they_arrive() {
        let text = b"one\n\n  \ntwo\nhalf";
        for size in 1..=text.len() {
            let mut sut = Lines::default();
            let mut lines = Vec::new();
            for piece in text.chunks(size) {
                sut.take(piece);
                lines.extend(all(&mut sut));
            }
            assert_eq!(lines, [whole("one"), whole("two")], "pieces of {size}");
            assert!(sut.is_open());
            sut.take(b" a line\n");
            assert_eq!(all(&mut sut), [whole("half a line")]);
            assert!(!sut.is_open());
        }
    }

    #[test]
    fn a_line_that_is_too_long_is_said_once_and_leaves_the_next_one_whole() {
        let mut sut = Lines::default();
        let mut lines = Vec::new();
        for _ in 0..40 {
            sut.take(&vec![b'x'; MAX_LINE_BYTES / 16]);
            lines.extend(all(&mut sut));
            assert!(sut.bytes.len() < MAX_LINE_BYTES, "memory is bounded");
        }
        sut.take(b"tail\nnext\n");
        lines.extend(all(&mut sut));
        assert_eq!(lines, [Line::TooLong, whole("next")]);
        sut.take(&[vec![b'y'; MAX_LINE_BYTES], b"\nnext\n".to_vec()].concat());
        assert_eq!(all(&mut sut), [Line::TooLong, whole("next")], "at one go");
    }
}
