//! The values of all lanes at all points, which threads read while others write other rows of them.
//!
//! They are kept group by group, `Vec<Vec<Lanes>>`: where a group holds nothing but zeros, a sweep leaves it out
//! and does not touch its memory.

#![expect(unsafe_code, reason = "threads share values by rows")]

use super::lanes::Lanes;
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
) -> Result<Vec<Vec<Lanes<T, WIDTH>>>> {
    // threads share out what the allocator has to clear
    let group = |_| memory::zeros(points, cancel);
    (0..groups).into_par_iter().map(group).collect()
}

/// Values of all lanes at all points, borrowed for as long as threads share them.
#[derive(Debug)]
pub(super) struct SharedValues<'a, T, const WIDTH: usize> {
    groups: [*mut Lanes<T, WIDTH>; MOST_GROUPS],
    count: usize,
    points: usize,
    borrowed: PhantomData<&'a mut [T]>,
}

// SAFETY: behind the pointers are plain numbers; whoever reads or writes a row promises that nobody else writes it meanwhile
unsafe impl<T: Send, const WIDTH: usize> Sync for SharedValues<'_, T, WIDTH> {}

impl<'a, T: Real, const WIDTH: usize> SharedValues<'a, T, WIDTH> {
    pub(super) fn new(values: &'a mut [Vec<Lanes<T, WIDTH>>]) -> Self {
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

    /// Where the values of `group` begin, that of point 0 first.
    #[inline(always)]
    pub(super) fn begin(&self, group: usize) -> *mut Lanes<T, WIDTH> {
        assert!(group < self.count, "a group of the values");
        self.groups[group]
    }

    /// `rows` of `group`.
    ///
    /// # Safety
    /// Nobody writes them meanwhile.
    pub(super) unsafe fn rows(&self, group: usize, rows: &Range<usize>) -> &'a [Lanes<T, WIDTH>] {
        let within = rows.start <= rows.end && rows.end <= self.points;
        assert!(within, "rows of the values");
        let begin = self.begin(group).wrapping_add(rows.start);
        // SAFETY: the rows are there, and the caller promises the rest
        unsafe { std::slice::from_raw_parts(begin, rows.len()) }
    }
}
