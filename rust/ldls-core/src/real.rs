//! The two precisions that the method runs in: single for speed, double where single cannot decide.

use bytemuck::Zeroable;
use multiversion::multiversion;
use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

/// A floating-point number.
pub trait Real:
    Copy
    + Default
    + Debug
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + Sum
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Zeroable
    + 'static
{
    /// Share of the largest seed below which a likelihood is lost in the rounding of what it competes with.
    const NEGLIGIBLE: f64;

    /// The nearest value of this precision.
    fn from_f64(x: f64) -> Self;
    /// The same value in double precision.
    fn to_f64(self) -> f64;
    /// Its magnitude.
    #[must_use]
    fn abs(self) -> Self;
    /// e to the power of each of `values`, none of them positive, in place of it.
    fn exp(values: &mut [Self]);
}

impl Real for f32 {
    const NEGLIGIBLE: f64 = 1e-12;

    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    fn exp(values: &mut [Self]) {
        exp_f32(values);
    }
}

impl Real for f64 {
    const NEGLIGIBLE: f64 = 1e-24;

    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    fn exp(values: &mut [Self]) {
        for value in values {
            *value = value.exp();
        }
    }
}

/// Powers below this are zero: the next one in single precision is not normal.
const LEAST_EXPONENT: f32 = -87.0;
/// Added to a number and taken off again, it leaves the nearest whole one.
const ROUND: f32 = 12_582_912.0;
/// ln 2 in two parts, the first of few bits.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

/// Many at once, and unlike the functions of C libraries the same bits everywhere; right to two units in the last place.
#[multiversion(targets("x86_64+avx2"))]
fn exp_f32(values: &mut [f32]) {
    for value in values {
        let exponent = if *value > LEAST_EXPONENT {
            *value
        } else {
            LEAST_EXPONENT
        };
        // e^x = 2^n e^r, where |r| is at most half of ln 2: seven terms of the series of e^r are enough
        let shifted = exponent * std::f32::consts::LOG2_E + ROUND;
        let n = shifted - ROUND;
        let r = exponent - n * LN_2[0] - n * LN_2[1];
        let mut sum = 1.0 / 5040.0;
        for term in [720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0] {
            sum = sum * r + 1.0 / term;
        }
        let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()));
        *value = if *value > LEAST_EXPONENT {
            sum * power
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_e_are_right_to_two_units_in_the_last_place() {
        for step in 0..1_000_000 {
            let exponent = -87.0 * step as f32 / 1e6;
            let mut power = [exponent];
            Real::exp(&mut power);
            let expected = f64::from(exponent).exp();
            let unit = f64::from(f32::EPSILON) * expected;
            assert!(
                (f64::from(power[0]) - expected).abs() <= 2.0 * unit,
                "{exponent}"
            );
        }
    }

    #[test]
    fn powers_at_the_ends() {
        let mut powers = [0.0, -0.0, -88.0, -1e30, f32::NEG_INFINITY];
        Real::exp(&mut powers);
        assert_eq!(powers, [1.0, 1.0, 0.0, 0.0, 0.0]);
    }
}
