//! A squared distance and a position as one number, for lists of candidates that are kept sorted. Distances are in
//! single precision; near ties are left to [`super::candidates`].

/// A candidate's squared distance and position as one number that sorts as they do.
///
/// The bits of a positive `f32` sort as its value does, and so do those of an `f64`: with the distance in its
/// upper half and the position in its lower, one floating-point comparison compares both. The lowest exponent
/// is added so that it is not subnormal, which some processors take for zero.
pub(crate) type Key = f64;
const LOWEST_EXPONENT: u64 = 1 << 52;

#[inline(always)]
pub(crate) fn key(squared: f32, position: u32) -> Key {
    f64::from_bits((u64::from(squared.to_bits()) << 32 | u64::from(position)) + LOWEST_EXPONENT)
}

#[inline(always)]
pub(crate) fn squared_of(key: Key) -> f32 {
    f32::from_bits(((key.to_bits() - LOWEST_EXPONENT) >> 32) as u32)
}

#[inline(always)]
pub(crate) fn position_of(key: Key) -> u32 {
    (key.to_bits() - LOWEST_EXPONENT) as u32
}
