//! The values of all lanes at all points, which threads read while others write other rows of them.
//!
//! They are kept group by group: where a group holds nothing but zeros, a sweep leaves it out and does not touch its
//! memory.

#![expect(unsafe_code, reason = "threads share values by rows")]

use super::lanes::Lanes;
use super::plan::MOST_GROUPS;
use crate::memory;
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Points by which every other array is shifted, which are half a page. Processors tell by the place in its page whether what
/// they load has just been stored, and what has just been stored are the next values of points nearby.
const SHIFT: usize = 64;

/// Values of all lanes at all points.
#[derive(Debug)]
pub(super) struct Values<T, const WIDTH: usize> {
    groups: Vec<Vec<Lanes<T, WIDTH>>>,
    /// Where in each group those of point 0 are.
    first: usize,
}

impl<T: Real, const WIDTH: usize> Values<T, WIDTH> {
    /// Zeros, for the array of this `number` among those of a pass.
    pub(super) fn zeros(
        number: usize,
        points: usize,
        groups: usize,
        cancel: &Cancel,
    ) -> Result<Self> {
        let first = number % 2 * SHIFT;
        // threads share out what the allocator has to clear
        let group = |_| memory::zeros(first + points, cancel);
        let groups = (0..groups).into_par_iter().map(group);
        let groups = groups.collect::<Result<_>>()?;
        Ok(Self { groups, first })
    }

    /// None at all.
    pub(super) fn none() -> Self {
        Self {
            groups: Vec::new(),
            first: 0,
        }
    }

    /// True of [`Self::none`].
    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Those of each group at all points.
    pub(super) fn groups(&self) -> impl Iterator<Item = &[Lanes<T, WIDTH>]> {
        self.groups.iter().map(|group| &group[self.first..])
    }

    pub(super) fn group(&self, group: usize) -> &[Lanes<T, WIDTH>] {
        &self.groups[group][self.first..]
    }

    pub(super) fn group_mut(&mut self, group: usize) -> &mut [Lanes<T, WIDTH>] {
        &mut self.groups[group][self.first..]
    }
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
    pub(super) fn new(values: &'a mut Values<T, WIDTH>) -> Self {
        // before there are pointers, which nobody may borrow beside
        let points = values.groups().next().map_or(0, <[_]>::len);
        let mut groups = [std::ptr::null_mut(); MOST_GROUPS];
        for (group, shared) in groups.iter_mut().take(values.groups.len()).enumerate() {
            *shared = values.group_mut(group).as_mut_ptr();
        }
        Self {
            groups,
            count: values.groups.len(),
            points,
            borrowed: PhantomData,
        }
    }

    /// Where the values of `group` begin, that of point 0 first.
    #[inline(always)]
    pub(super) fn begin(&self, group: usize) -> *mut Lanes<T, WIDTH> {
        assert!(group < self.count, "a group of the values");
        self.groups[group]
    }

    /// The same of every group; null where there is none.
    #[inline(always)]
    pub(super) fn begins(&self) -> [*mut Lanes<T, WIDTH>; MOST_GROUPS] {
        self.groups
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
