//! The two precisions that the method runs in: single for speed, double where single cannot decide.

use bytemuck::Zeroable;
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
    /// e to the power of this value.
    #[must_use]
    fn exp(self) -> Self;
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
    fn exp(self) -> Self {
        self.exp()
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
    fn exp(self) -> Self {
        self.exp()
    }
}
