use std::ops::{Add, Div, Mul, Sub};

/// Numbers side by side.
pub(crate) const LANES: usize = 8;

/// Eight numbers that are worked on side by side: each operation is a loop that compilers turn into vector instructions.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    #[inline(always)]
    pub(crate) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }

    #[inline(always)]
    pub(crate) fn map(self, mut of: impl FnMut(f64) -> f64) -> Self {
        let mut result = self;
        for lane in 0..LANES {
            result.0[lane] = of(self.0[lane]);
        }
        result
    }

    #[inline(always)]
    fn zip(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let mut result = self;
        for lane in 0..LANES {
            result.0[lane] = of(self.0[lane], other.0[lane]);
        }
        result
    }

    /// Whether each is greater than the other.
    #[inline(always)]
    pub(crate) fn greater(self, other: Self) -> [bool; LANES] {
        std::array::from_fn(|lane| self.0[lane] > other.0[lane])
    }

    /// Whether each is neither 0, nor so small that its digits are fewer, nor infinite, nor no number.
    #[inline(always)]
    pub(crate) fn is_normal(self) -> [bool; LANES] {
        self.0.map(|value| (f64::MIN_POSITIVE..f64::INFINITY).contains(&value))
    }

    /// These where chosen, else the others.
    #[inline(always)]
    pub(crate) fn or(self, chosen: [bool; LANES], other: Self) -> Self {
        let mut result = other;
        for ((result, own), chosen) in result.0.iter_mut().zip(self.0).zip(chosen) {
            *result = if chosen { own } else { *result };
        }
        result
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}
