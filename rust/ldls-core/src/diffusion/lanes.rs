//! The values of a group of lanes at a point, and arithmetic with all of them at once.
//!
//! Compilers turn loops over the lanes of one group into vector instructions, but those of several groups into slow ones. So
//! what a step computes is said in vectors: registers where the processor has AVX2 and fused multiply-add, arrays elsewhere,
//! which round products once more.

#![expect(
    unsafe_code,
    reason = "vector instructions, and zeros as the allocator has them"
)]

use crate::Real;
use bytemuck::Zeroable;
use std::ops::{Deref, DerefMut};

/// Lanes of a group in single precision.
pub(super) const WIDTH_F32: usize = 8;
/// The same in double precision.
pub(super) const WIDTH_F64: usize = 4;

/// Values of a group of lanes at a point, none of which lies across two lines of the cache.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Lanes<T, const WIDTH: usize>([T; WIDTH]);

// SAFETY: an array of what zero bytes are a value of
unsafe impl<T: Zeroable, const WIDTH: usize> Zeroable for Lanes<T, WIDTH> {}

impl<T, const WIDTH: usize> Deref for Lanes<T, WIDTH> {
    type Target = [T; WIDTH];

    #[inline(always)]
    fn deref(&self) -> &[T; WIDTH] {
        &self.0
    }
}

impl<T, const WIDTH: usize> DerefMut for Lanes<T, WIDTH> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; WIDTH] {
        &mut self.0
    }
}

/// A number of which `WIDTH` make a group.
pub(super) trait Lane<const WIDTH: usize>: Real {
    /// A group in a register of a processor with AVX2 and fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    type Register: Vector<Self, WIDTH>;
}

/// The values of a group, to compute with.
pub(super) trait Vector<T, const WIDTH: usize>: Copy {
    fn zero() -> Self;
    fn splat(value: T) -> Self;
    fn load(values: &Lanes<T, WIDTH>) -> Self;
    fn store(self, values: &mut Lanes<T, WIDTH>);
    fn plus(self, other: Self) -> Self;
    /// `one` times `other` added, rounded once or twice.
    fn plus_product(self, one: Self, other: Self) -> Self;
    /// Zero for what is not larger in magnitude than `least`.
    fn or_zero(self, least: Self) -> Self;
}

impl<T: Real, const WIDTH: usize> Vector<T, WIDTH> for Lanes<T, WIDTH> {
    #[inline(always)]
    fn zero() -> Self {
        Self::zeroed()
    }

    #[inline(always)]
    fn splat(value: T) -> Self {
        Self([value; WIDTH])
    }

    #[inline(always)]
    fn load(values: &Self) -> Self {
        *values
    }

    #[inline(always)]
    fn store(self, values: &mut Self) {
        *values = self;
    }

    #[inline(always)]
    fn plus(mut self, other: Self) -> Self {
        for lane in 0..WIDTH {
            self[lane] += other[lane];
        }
        self
    }

    #[inline(always)]
    fn plus_product(mut self, one: Self, other: Self) -> Self {
        for lane in 0..WIDTH {
            self[lane] += one[lane] * other[lane];
        }
        self
    }

    #[inline(always)]
    fn or_zero(mut self, least: Self) -> Self {
        for lane in 0..WIDTH {
            if !(self[lane].abs() > least[lane]) {
                self[lane] = T::default();
            }
        }
        self
    }
}

/// Registers of AVX2.
///
/// SAFETY: only what runs on processors with AVX2 and fused multiply-add asks for them, and lanes lie where they may be loaded
/// from and stored to.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::{Lane, Lanes, Vector, WIDTH_F32, WIDTH_F64};
    #[allow(
        clippy::wildcard_imports,
        reason = "the names of some twenty instructions"
    )]
    use std::arch::x86_64::*;

    macro_rules! vector {
        ($number:ty, $width:ident, $register:ty, $zero:ident, $splat:ident, $load:ident, $store:ident, $add:ident,
            $add_product:ident, $compare:ident, $and:ident, $and_not:ident) => {
            impl Lane<$width> for $number {
                type Register = $register;
            }

            impl Vector<$number, $width> for $register {
                #[inline(always)]
                fn zero() -> Self {
                    // SAFETY: as the module says
                    unsafe { $zero() }
                }

                #[inline(always)]
                fn splat(value: $number) -> Self {
                    // SAFETY: as the module says
                    unsafe { $splat(value) }
                }

                #[inline(always)]
                fn load(values: &Lanes<$number, $width>) -> Self {
                    // SAFETY: as the module says
                    unsafe { $load(values.as_ptr()) }
                }

                #[inline(always)]
                fn store(self, values: &mut Lanes<$number, $width>) {
                    // SAFETY: as the module says
                    unsafe { $store(values.as_mut_ptr(), self) }
                }

                #[inline(always)]
                fn plus(self, other: Self) -> Self {
                    // SAFETY: as the module says
                    unsafe { $add(self, other) }
                }

                #[inline(always)]
                fn plus_product(self, one: Self, other: Self) -> Self {
                    // SAFETY: as the module says
                    unsafe { $add_product(one, other, self) }
                }

                #[inline(always)]
                fn or_zero(self, least: Self) -> Self {
                    // SAFETY: as the module says
                    unsafe {
                        let magnitude = $and_not($splat(-0.0), self);
                        $and(self, $compare::<_CMP_GT_OQ>(magnitude, least))
                    }
                }
            }
        };
    }

    vector!(
        f32,
        WIDTH_F32,
        __m256,
        _mm256_setzero_ps,
        _mm256_set1_ps,
        _mm256_load_ps,
        _mm256_store_ps,
        _mm256_add_ps,
        _mm256_fmadd_ps,
        _mm256_cmp_ps,
        _mm256_and_ps,
        _mm256_andnot_ps
    );
    vector!(
        f64,
        WIDTH_F64,
        __m256d,
        _mm256_setzero_pd,
        _mm256_set1_pd,
        _mm256_load_pd,
        _mm256_store_pd,
        _mm256_add_pd,
        _mm256_fmadd_pd,
        _mm256_cmp_pd,
        _mm256_and_pd,
        _mm256_andnot_pd
    );
}

#[cfg(not(target_arch = "x86_64"))]
impl Lane<WIDTH_F32> for f32 {}
#[cfg(not(target_arch = "x86_64"))]
impl Lane<WIDTH_F64> for f64 {}
