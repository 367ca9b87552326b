//! Arrays as long as a cloud or an image, which there may be no memory for.
//!
//! Rust ends the process where an allocation fails. Arrays whose length grows with the input are therefore made here,
//! where a lack of memory is an [`Error::OutOfMemory`].

use crate::{Error, Result};
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;
use rayon::prelude::*;

/// An empty vector with room for `len` values.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn with_room<T>(len: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    let bytes = size_of::<T>().saturating_mul(len);
    values
        .try_reserve_exact(len)
        .map_err(|_| Error::OutOfMemory { bytes })?;
    Ok(values)
}

/// Appends `value`.
///
/// # Errors
/// [`Error::OutOfMemory`].
#[inline]
pub fn push<T>(values: &mut Vec<T>, value: T) -> Result<()> {
    if values.len() == values.capacity() {
        let bytes = 2 * size_of_val(values.as_slice());
        values
            .try_reserve(1)
            .map_err(|_| Error::OutOfMemory { bytes })?;
    }
    values.push(value);
    Ok(())
}

/// `len` times `value`.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn filled<T: Clone>(value: T, len: usize) -> Result<Vec<T>> {
    let mut values = with_room(len)?;
    values.resize(len, value);
    Ok(values)
}

/// `len` zeros. Memory fresh from the system is zero: nobody touches it before its user does.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn zeros<T: Zeroable>(len: usize) -> Result<Vec<T>> {
    let bytes = size_of::<T>().saturating_mul(len);
    try_zeroed_vec(len).map_err(|()| Error::OutOfMemory { bytes })
}

/// `values`, of which there are no more than they say.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn collect<T>(values: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>> {
    let mut all = with_room(values.len())?;
    all.extend(values);
    Ok(all)
}

/// What threads make, in order.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn collect_parallel<T: Send>(values: impl IndexedParallelIterator<Item = T>) -> Result<Vec<T>> {
    let mut all = with_room(values.len())?;
    values.collect_into_vec(&mut all);
    Ok(all)
}
