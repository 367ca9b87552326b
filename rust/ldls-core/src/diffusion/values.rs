//! The values of all lanes at all points, which threads read while others write other rows of them.
//!
//! They are kept group by group, `Vec<Vec<[T; WIDTH]>>`: where a group holds nothing but zeros, a sweep leaves it out
//! and does not touch its memory.

#![expect(unsafe_code, reason = "threads share values by rows")]

use super::seeds::MOST_GROUPS;
use crate::memory;
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Zeros of `groups` groups at `points` points.
pub(super) fn zeros<T: Real, const WIDTH: usize>(
    points: usize,
    groups: usize,
    cancel: &Cancel,
) -> Result<Vec<Vec<[T; WIDTH]>>> {
    // threads share out what the allocator has to clear
    let group = |_| memory::zeros(points, cancel);
    (0..groups).into_par_iter().map(group).collect()
}

/// Values of all lanes at all points, borrowed for as long as threads share them.
#[derive(Debug)]
pub(super) struct SharedValues<'a, T, const WIDTH: usize> {
    groups: [*mut [T; WIDTH]; MOST_GROUPS],
    count: usize,
    points: usize,
    borrowed: PhantomData<&'a mut [T]>,
}

// SAFETY: behind the pointers are plain numbers; callers of `rows` and `rows_mut` promise that nobody writes a row that
// another reads or writes
unsafe impl<T: Send, const WIDTH: usize> Sync for SharedValues<'_, T, WIDTH> {}

impl<'a, T: Real, const WIDTH: usize> SharedValues<'a, T, WIDTH> {
    pub(super) fn new(values: &'a mut [Vec<[T; WIDTH]>]) -> Self {
        let mut groups = [std::ptr::null_mut(); MOST_GROUPS];
        for (shared, group) in groups.iter_mut().zip(values.iter_mut()) {
            *shared = group.as_mut_ptr();
        }
        Self {
            groups,
            count: values.len(),
            points: values.first().map_or(0, Vec::len),
            borrowed: PhantomData,
        }
    }

    /// Number of groups.
    pub(super) fn groups(&self) -> usize {
        self.count
    }

    /// Where `rows` of `group` begin.
    #[inline(always)]
    fn begin(&self, group: usize, rows: &Range<usize>) -> *mut [T; WIDTH] {
        let within = rows.start <= rows.end && rows.end <= self.points;
        assert!(group < self.count && within, "rows of the values");
        self.groups[group].wrapping_add(rows.start)
    }

    /// `rows` of `group`, to read.
    ///
    /// # Safety
    /// Nobody writes them meanwhile.
    #[inline(always)]
    pub(super) unsafe fn rows(&self, group: usize, rows: &Range<usize>) -> &'a [[T; WIDTH]] {
        // SAFETY: the rows are there (`begin` checks it), and the caller promises the rest
        unsafe { std::slice::from_raw_parts(self.begin(group, rows), rows.len()) }
    }

    /// The same, to write.
    ///
    /// # Safety
    /// Nobody else reads or writes them meanwhile.
    #[inline(always)]
    pub(super) unsafe fn rows_mut(
        &self,
        group: usize,
        rows: &Range<usize>,
    ) -> &'a mut [[T; WIDTH]] {
        // SAFETY: the rows are there (`begin` checks it), and the caller promises the rest
        unsafe { std::slice::from_raw_parts_mut(self.begin(group, rows), rows.len()) }
    }

    /// Where the values of `group` begin, that of point 0 first.
    #[inline(always)]
    pub(super) fn source(&self, group: usize) -> *const [T; WIDTH] {
        self.begin(group, &(0..0))
    }
}
