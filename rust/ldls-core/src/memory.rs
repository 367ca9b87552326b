//! Arrays as long as a cloud or an image, which there may be no memory for.
//!
//! Rust ends the process where an allocation fails. Arrays whose length grows with the input are therefore made here,
//! where a lack of memory is an [`Error::OutOfMemory`]. The system clears memory when it is first written to, half a
//! second a gigabyte and more: long arrays are written block by block, and the flag is looked at before each.

use crate::{Cancel, Error, Result};
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;
use rayon::prelude::*;

/// Bytes written between two looks at the flag.
const BLOCK_BYTES: usize = 8 << 20;
/// Least bytes for a task of the thread pool.
const TASK_BYTES: usize = 16 << 10;

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

/// `len` zeros.
///
/// # Errors
/// [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn zeros<T: Zeroable + Copy + Send + Sync>(len: usize, cancel: &Cancel) -> Result<Vec<T>> {
    if len > block::<T>() {
        return filled(T::zeroed(), len, cancel);
    }
    // an allocator knows of some memory that it is zero
    let bytes = size_of::<T>().saturating_mul(len);
    try_zeroed_vec(len).map_err(|()| Error::OutOfMemory { bytes })
}

/// `len` times `value`.
///
/// # Errors
/// [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn filled<T: Copy + Send + Sync>(value: T, len: usize, cancel: &Cancel) -> Result<Vec<T>> {
    tabulate(len, |_| value, cancel)
}

/// The value of `at` at each index below `len`, by the threads of the pool.
///
/// # Errors
/// [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn tabulate<T: Send>(
    len: usize,
    at: impl Fn(usize) -> T + Sync,
    cancel: &Cancel,
) -> Result<Vec<T>> {
    let mut values = with_room(len)?;
    while values.len() < len {
        cancel.check()?;
        let indices = values.len()..len.min(values.len() + block::<T>());
        let indices = indices
            .into_par_iter()
            .with_min_len(TASK_BYTES / size_of::<T>().max(1));
        values.par_extend(indices.map(&at));
    }
    Ok(values)
}

/// `values`, of which there are no more than they say.
///
/// # Errors
/// [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn collect<T>(mut values: impl ExactSizeIterator<Item = T>, cancel: &Cancel) -> Result<Vec<T>> {
    let mut all = with_room(values.len())?;
    while values.len() > block::<T>() {
        cancel.check()?;
        all.extend(values.by_ref().take(block::<T>()));
    }
    all.extend(values);
    Ok(all)
}

/// Values of a block.
fn block<T>() -> usize {
    BLOCK_BYTES / size_of::<T>().max(1)
}
