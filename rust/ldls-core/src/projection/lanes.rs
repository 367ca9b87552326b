//! Sixteen numbers side by side, which instructions take two or four at a time.

use std::array::from_fn;
use std::ops::{Add, BitAnd, Div, Mul};
use wide::f64x4;

/// How many there are.
pub(super) const LANES: usize = 16;

/// Sixteen numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes([f64x4; LANES / 4]);

impl Lanes {
    #[inline(always)]
    pub(super) fn all(value: f64) -> Self {
        Self([f64x4::splat(value); LANES / 4])
    }

    #[inline(always)]
    pub(super) fn from_array(values: &[f64; LANES]) -> Self {
        let four = |at: usize| [0, 1, 2, 3].map(|lane| values[4 * at + lane]);
        Self(from_fn(|at| f64x4::from(four(at))))
    }

    #[inline(always)]
    pub(super) fn to_array(self) -> [f64; LANES] {
        let fours = self.0.map(f64x4::to_array);
        from_fn(|lane| fours[lane / 4][lane % 4])
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self(self.0.map(f64x4::abs))
    }

    /// The lesser of each two; no number may be NaN.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.zip(other, f64x4::fast_min)
    }

    /// The larger of each two; no number may be NaN.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        self.zip(other, f64x4::fast_max)
    }

    #[inline(always)]
    pub(super) fn is(self, value: f64) -> Mask {
        self.compare(value, f64x4::simd_eq)
    }

    #[inline(always)]
    pub(super) fn above(self, value: f64) -> Mask {
        self.compare(value, f64x4::simd_gt)
    }

    #[inline(always)]
    pub(super) fn up_to(self, value: f64) -> Mask {
        self.compare(value, f64x4::simd_le)
    }

    /// At least `low` and less than `high`.
    #[inline(always)]
    pub(super) fn within(self, low: f64, high: f64) -> Mask {
        self.compare(low, f64x4::simd_ge) & self.compare(high, f64x4::simd_lt)
    }

    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(f64x4, f64x4) -> f64x4) -> Self {
        Self(from_fn(|at| op(self.0[at], other.0[at])))
    }

    #[inline(always)]
    fn compare(self, value: f64, compare: impl Fn(f64x4, f64x4) -> f64x4) -> Mask {
        Mask(self.zip(Self::all(value), compare).0)
    }
}

/// What holds of which of sixteen numbers; of NaN nothing does.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mask([f64x4; LANES / 4]);

impl Mask {
    /// A bit for each, the lowest for the first.
    #[inline(always)]
    pub(super) fn bits(self) -> u32 {
        let [a, b, c, d] = self.0.map(f64x4::to_bitmask);
        a | b << 4 | c << 8 | d << 12
    }
}

impl BitAnd for Mask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(from_fn(|at| self.0[at] & other.0[at]))
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, f64x4::add)
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, f64x4::mul)
    }
}

impl Div for Lanes {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, f64x4::div)
    }
}
