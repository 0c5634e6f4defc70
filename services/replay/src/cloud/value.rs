//! Numbers as clouds store them.

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// A number as it was stored: times in nanoseconds do not fit a float.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    Integer(i64),
    Float(f64),
}

impl Number {
    pub(crate) fn float(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Float(value) => value,
        }
    }
}

impl Kind {
    /// Bytes that it takes.
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number that `bytes` begin with; none if they are too short. Integers beyond 63 bits become the largest.
    pub(crate) fn number(self, bytes: &[u8], is_big_endian: bool) -> Option<Number> {
        let mut wide = [0; 8];
        let size = self.bytes();
        let stored = bytes.get(..size)?;
        if is_big_endian {
            wide.iter_mut().zip(stored.iter().rev()).for_each(|(to, from)| *to = *from);
        } else {
            wide[..size].copy_from_slice(stored);
        }
        let unsigned = u64::from_le_bytes(wide);
        let unused = 64 - 8 * size as u32;
        Some(match self {
            Self::F32 => Number::Float(f64::from(f32::from_bits(unsigned as u32))),
            Self::F64 => Number::Float(f64::from_bits(unsigned)),
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => Number::Integer((unsigned << unused) as i64 >> unused),
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => {
                Number::Integer(i64::try_from(unsigned).unwrap_or(i64::MAX))
            }
        })
    }

    /// The number that `text` is.
    pub(crate) fn parsed(self, text: &str) -> Option<Number> {
        match self {
            Self::F32 | Self::F64 => text.parse().ok().map(Number::Float),
            // Some writers put a point into every number.
            _ => text.parse().map(Number::Integer).or_else(|_| text.parse().map(Number::Float)).ok(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_kind_are_read_from_both_ends() {
        let both = |kind: Kind, bytes: &[u8]| {
            let swapped: Vec<u8> = bytes.iter().rev().copied().collect();
            assert_eq!(kind.number(bytes, false), kind.number(&swapped, true));
            assert_eq!(kind.number(&bytes[1..], false), None);
            kind.number(bytes, false).unwrap()
        };
        assert_eq!(both(Kind::F32, &1.5_f32.to_le_bytes()), Number::Float(1.5));
        assert_eq!(both(Kind::F64, &(-2.5_f64).to_le_bytes()), Number::Float(-2.5));
        assert_eq!(both(Kind::U8, &[200]), Number::Integer(200));
        assert_eq!(both(Kind::I8, &[200]), Number::Integer(-56));
        assert_eq!(both(Kind::U16, &65_535_u16.to_le_bytes()), Number::Integer(65_535));
        assert_eq!(both(Kind::I16, &(-3_i16).to_le_bytes()), Number::Integer(-3));
        assert_eq!(both(Kind::U32, &u32::MAX.to_le_bytes()), Number::Integer(i64::from(u32::MAX)));
        assert_eq!(both(Kind::I32, &(-3_i32).to_le_bytes()), Number::Integer(-3));
        assert_eq!(both(Kind::I64, &(-3_i64).to_le_bytes()), Number::Integer(-3));
        assert_eq!(both(Kind::U64, &u64::MAX.to_le_bytes()), Number::Integer(i64::MAX));
    }

    #[test]
    fn text_is_read_as_its_kind() {
        assert_eq!(Kind::U8.parsed("7"), Some(Number::Integer(7)));
        assert_eq!(Kind::U8.parsed("7.0"), Some(Number::Float(7.0)));
        assert_eq!(Kind::F32.parsed("1e2"), Some(Number::Float(100.0)));
        assert_eq!(Kind::F64.parsed("north"), None);
    }
}
