use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use pulp::Simd;

use super::rays::MOST_LANES;

/// Numbers of as many rays as the machine works on at once.
///
/// Every operation rounds as the same operation on one number does, and nothing is fused, so results do not depend on the
/// machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wide<S: Simd> {
    simd: S,
    values: S::f64s,
}

/// Vectors of as many rays.
pub(crate) type WideVector<S> = [Wide<S>; 3];

/// Which of the rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Which<S: Simd> {
    simd: S,
    lanes: S::m64s,
}

impl<S: Simd> Wide<S> {
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: f64) -> Self {
        Self { simd, values: simd.splat_f64s(value) }
    }

    /// The `place`th group of `values`, whose length is a multiple of the lanes.
    #[inline(always)]
    pub(crate) fn load(simd: S, values: &[f64], place: usize) -> Self {
        Self { simd, values: S::as_simd_f64s(values).0[place] }
    }

    /// Writes the lanes to the beginning of `values`.
    #[inline(always)]
    pub(crate) fn store(self, values: &mut [f64]) {
        S::as_mut_simd_f64s(values).0[0] = self.values;
    }

    /// The same number in all lanes.
    #[inline(always)]
    pub(crate) fn all(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { values: self.simd.sqrt_f64s(self.values), ..self }
    }

    /// The natural logarithm, number by number; 0 of 1.
    #[inline(always)]
    pub(crate) fn ln(self) -> Self {
        let mut lanes = [1.0; MOST_LANES];
        self.store(&mut lanes);
        for lane in &mut lanes {
            if *lane != 1.0 {
                *lane = lane.ln();
            }
        }
        Self::load(self.simd, &lanes, 0)
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        let digits = self.simd.splat_f64s(f64::from_bits(!SIGN));
        Self { values: self.simd.and_f64s(digits, self.values), ..self }
    }

    /// With the sign of `other`.
    #[inline(always)]
    pub(crate) fn copysign(self, other: Self) -> Self {
        let sign = self.simd.and_f64s(self.simd.splat_f64s(f64::from_bits(SIGN)), other.values);
        Self { values: self.simd.or_f64s(sign, self.abs().values), ..self }
    }

    /// The larger; the other one where one is no number.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        (self.less(other) | self.is_nan()).choose(other, self)
    }

    /// The smaller; the other one where one is no number.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        (self.greater(other) | self.is_nan()).choose(other, self)
    }

    #[inline(always)]
    pub(crate) fn clamp(self, low: Self, high: Self) -> Self {
        let raised = self.less(low).choose(low, self);
        raised.greater(high).choose(high, raised)
    }

    #[inline(always)]
    pub(crate) fn is_nan(self) -> Which<S> {
        !Which { simd: self.simd, lanes: self.simd.equal_f64s(self.values, self.values) }
    }

    #[inline(always)]
    pub(crate) fn less(self, other: Self) -> Which<S> {
        Which { simd: self.simd, lanes: self.simd.less_than_f64s(self.values, other.values) }
    }

    #[inline(always)]
    pub(crate) fn at_most(self, other: Self) -> Which<S> {
        Which { simd: self.simd, lanes: self.simd.less_than_or_equal_f64s(self.values, other.values) }
    }

    #[inline(always)]
    pub(crate) fn greater(self, other: Self) -> Which<S> {
        other.less(self)
    }

    #[inline(always)]
    pub(crate) fn at_least(self, other: Self) -> Which<S> {
        other.at_most(self)
    }

    #[inline(always)]
    fn with(self, values: S::f64s) -> Self {
        Self { values, ..self }
    }
}

const SIGN: u64 = 1 << 63;

impl<S: Simd> Which<S> {
    /// One number where chosen, else the other.
    #[inline(always)]
    pub(crate) fn choose(self, chosen: Wide<S>, other: Wide<S>) -> Wide<S> {
        chosen.with(self.simd.select_f64s(self.lanes, chosen.values, other.values))
    }

    /// One vector where chosen, else the other.
    #[inline(always)]
    pub(crate) fn choose_vector(self, chosen: WideVector<S>, other: WideVector<S>) -> WideVector<S> {
        [self.choose(chosen[0], other[0]), self.choose(chosen[1], other[1]), self.choose(chosen[2], other[2])]
    }

    /// Whether any is chosen.
    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        self.simd.first_true_m64s(self.lanes) < S::F64_LANES
    }
}

impl<S: Simd> BitAnd for Which<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self { lanes: self.simd.and_m64s(self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd> BitOr for Which<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self { lanes: self.simd.or_m64s(self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd> Not for Which<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self { lanes: self.simd.not_m64s(self.lanes), ..self }
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f64s(self.values, other.values))
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f64s(self.values, other.values))
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f64s(self.values, other.values))
    }
}

impl<S: Simd> Div for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(self.simd.div_f64s(self.values, other.values))
    }
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.xor_f64s(self.simd.splat_f64s(f64::from_bits(SIGN)), self.values))
    }
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> Wide<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> WideVector<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn norm<S: Simd>(v: WideVector<S>) -> Wide<S> {
    dot(v, v).sqrt()
}

/// Each component times a number.
#[inline(always)]
pub(crate) fn scale<S: Simd>([x, y, z]: WideVector<S>, by: Wide<S>) -> WideVector<S> {
    [x * by, y * by, z * by]
}

/// Each component over a number.
#[inline(always)]
pub(crate) fn shrink<S: Simd>([x, y, z]: WideVector<S>, by: Wide<S>) -> WideVector<S> {
    [x / by, y / by, z / by]
}

/// a b, axis by axis.
#[inline(always)]
pub(crate) fn times<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> WideVector<S> {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// a / b, axis by axis.
#[inline(always)]
pub(crate) fn over<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> WideVector<S> {
    [a[0] / b[0], a[1] / b[1], a[2] / b[2]]
}

#[inline(always)]
pub(crate) fn plus<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> WideVector<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn minus<S: Simd>(a: WideVector<S>, b: WideVector<S>) -> WideVector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn opposite<S: Simd>([x, y, z]: WideVector<S>) -> WideVector<S> {
    [-x, -y, -z]
}

/// Where a ray is after `distance`.
#[inline(always)]
pub(crate) fn along<S: Simd>(origin: WideVector<S>, direction: WideVector<S>, distance: Wide<S>) -> WideVector<S> {
    plus(origin, scale(direction, distance))
}
