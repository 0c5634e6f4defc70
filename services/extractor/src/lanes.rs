use std::ops::{Add, Div, Mul, Sub};

use pulp::Simd;

/// Numbers that are worked on side by side: one vector or several, as wide as the machine has them.
pub(crate) const LANES: usize = 8;

/// [`LANES`] numbers in memory, beginning where a cache line does.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Row<T>(pub(crate) [T; LANES]);

/// One vector of numbers. Each operation is one instruction, and exact as IEEE 754 has it, so results are the same
/// whatever the width.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    value: S::f64s,
}

impl<S: Simd> Lanes<S> {
    /// Vectors of a row.
    pub(crate) const OF_ROW: usize = LANES / S::F64_LANES;

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self { simd, value: simd.splat_f64s(value) }
    }

    /// One of a row's vectors.
    #[inline(always)]
    pub(crate) fn load(simd: S, row: &Row<f64>, place: usize) -> Self {
        Self { simd, value: S::as_simd_f64s(&row.0).0[place] }
    }

    /// Writes one of a row's vectors.
    #[inline(always)]
    pub(crate) fn store(self, row: &mut Row<f64>, place: usize) {
        S::as_mut_simd_f64s(&mut row.0).0[place] = self.value;
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f64s(self.value), ..self }
    }

    /// Where this is less than the other, `then`, else `otherwise`.
    #[inline(always)]
    pub(crate) fn if_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        let less = self.simd.less_than_f64s(self.value, other.value);
        Self { value: self.simd.select_f64s(less, then.value, otherwise.value), ..self }
    }

    /// `then` where each is neither 0, nor so small that its digits are fewer, nor infinite, nor no number; else
    /// `otherwise`.
    #[inline(always)]
    pub(crate) fn if_normal(self, then: Self, otherwise: Self) -> Self {
        let least = self.simd.splat_f64s(f64::MIN_POSITIVE);
        let enough = self.simd.less_than_or_equal_f64s(least, self.value);
        let then = Self { value: self.simd.select_f64s(enough, then.value, otherwise.value), ..self };
        self.if_less(Self::splat(self.simd, f64::INFINITY), then, otherwise)
    }

    /// Whether any is less than the other.
    #[inline(always)]
    pub(crate) fn any_less(self, other: Self) -> bool {
        self.simd.first_true_m64s(self.simd.less_than_f64s(self.value, other.value)) < S::F64_LANES
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.simd.add_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.simd.sub_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { value: self.simd.mul_f64s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Div for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self { value: self.simd.div_f64s(self.value, other.value), ..self }
    }
}
