//! The values of all lanes at all points, which threads read while others write other rows of them.
//!
//! Which thread may touch which rows when is the business of [`super::tiles`], which orders the steps of tiles of rows.

use super::lanes::MOST_GROUPS;
use crate::Real;
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;

/// Bytes at which the rows of a group are aligned, so that none lies in two lines of the cache.
const ALIGNMENT: usize = 32;

/// Values of all lanes at all points, group by group: where one holds nothing but zeros, a sweep leaves it out and
/// does not touch its memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Values<T, const WIDTH: usize>(Vec<GroupValues<T, WIDTH>>);

/// Values of one group of lanes at all points.
#[derive(Debug, Clone)]
struct GroupValues<T, const WIDTH: usize> {
    /// Not a vector of rows: zeroed memory of plain numbers comes from the system as it is, page by page when used.
    buffer: Vec<T>,
    /// Where the first row begins.
    start: usize,
    points: usize,
}

impl<T: Real, const WIDTH: usize> GroupValues<T, WIDTH> {
    /// From zeros in `buffer`, of which there are as many as `length_for` says.
    fn new(buffer: Vec<T>, points: usize) -> Self {
        let start = buffer.as_ptr().align_offset(ALIGNMENT).min(Self::SPARE);
        Self {
            buffer,
            start,
            points,
        }
    }

    /// Values beyond those of the rows, so that rows can begin where memory is aligned.
    const SPARE: usize = ALIGNMENT / size_of::<T>();

    fn length_for(points: usize) -> usize {
        points * WIDTH + Self::SPARE
    }

    #[inline(always)]
    fn rows(&self) -> &[[T; WIDTH]] {
        &self.buffer[self.start..].as_chunks().0[..self.points]
    }

    #[inline(always)]
    fn rows_mut(&mut self) -> &mut [[T; WIDTH]] {
        &mut self.buffer[self.start..].as_chunks_mut().0[..self.points]
    }
}

impl<T: Real, const WIDTH: usize> Values<T, WIDTH> {
    /// Zeros at `points` points.
    pub(crate) fn zero(points: usize, groups: usize) -> Self {
        let length = GroupValues::<T, WIDTH>::length_for(points);
        let buffers = (0..groups)
            .into_par_iter()
            .map(|_| vec![T::default(); length]);
        let group = |buffer| GroupValues::new(buffer, points);
        Self(buffers.map(group).collect())
    }

    /// The values of `group` at all points.
    #[inline(always)]
    pub(crate) fn group(&self, group: usize) -> &[[T; WIDTH]] {
        self.0[group].rows()
    }

    /// The same to write.
    #[inline(always)]
    pub(crate) fn group_mut(&mut self, group: usize) -> &mut [[T; WIDTH]] {
        self.0[group].rows_mut()
    }

    /// The value of `lane` at point `i`.
    #[inline(always)]
    pub(crate) fn get(&self, i: usize, lane: usize) -> T {
        self.group(lane / WIDTH)[i][lane % WIDTH]
    }

    /// Number of points.
    pub(crate) fn points(&self) -> usize {
        self.0.first().map_or(0, |group| group.points)
    }

    /// Number of lanes.
    pub(crate) fn lanes(&self) -> usize {
        self.0.len() * WIDTH
    }
}

/// The values of all lanes at all points, borrowed for as long as threads share them.
#[derive(Debug)]
pub(crate) struct SharedValues<'a, T, const WIDTH: usize> {
    groups: [*mut [T; WIDTH]; MOST_GROUPS],
    count: usize,
    points: usize,
    borrowed: PhantomData<&'a mut Values<T, WIDTH>>,
}

// SAFETY: what lies behind the pointers is plain numbers; a `Window`, the only way to them, is promised by who makes
// it to be the only one to write its rows, with none to read them
#[expect(unsafe_code, reason = "threads share values by rows")]
unsafe impl<T: Send, const WIDTH: usize> Sync for SharedValues<'_, T, WIDTH> {}

impl<'a, T: Real, const WIDTH: usize> SharedValues<'a, T, WIDTH> {
    pub(crate) fn new(values: &'a mut Values<T, WIDTH>) -> Self {
        let mut groups = [std::ptr::null_mut(); MOST_GROUPS];
        for (shared, group) in groups.iter_mut().zip(&mut values.0) {
            *shared = group.rows_mut().as_mut_ptr();
        }
        Self {
            groups,
            count: values.0.len(),
            points: values.points(),
            borrowed: PhantomData,
        }
    }

    /// Where `rows` of `group` begin.
    #[inline(always)]
    fn begin(&self, group: usize, rows: &Range<usize>) -> *mut [T; WIDTH] {
        let within = rows.start <= rows.end && rows.end <= self.points;
        assert!(group < self.count && within, "rows of the values");
        self.groups[group].wrapping_add(rows.start)
    }
}

/// What one thread computes of a step: some rows of the values after it, from the values before it.
#[derive(Debug)]
pub(crate) struct Window<'a, T, const WIDTH: usize> {
    z: &'a SharedValues<'a, T, WIDTH>,
    next: &'a SharedValues<'a, T, WIDTH>,
    rows: Range<usize>,
}

#[expect(unsafe_code, reason = "threads share values by rows")]
impl<'a, T: Real, const WIDTH: usize> Window<'a, T, WIDTH> {
    /// `rows` of `next`, to be computed from `z`.
    ///
    /// # Safety
    /// While the window lives, no other one holds any of these rows of `next` as its own or reads them as `z`, and
    /// none has as its own a row of `z` that lies in `rows` or that is read with [`Source::at`].
    pub(crate) unsafe fn new(
        z: &'a SharedValues<'a, T, WIDTH>,
        next: &'a SharedValues<'a, T, WIDTH>,
        rows: Range<usize>,
    ) -> Self {
        assert!(rows.end <= next.points, "rows of the values");
        Self { z, next, rows }
    }

    /// The rows of the window.
    pub(crate) fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Number of groups.
    pub(crate) fn groups(&self) -> usize {
        self.next.count
    }

    /// `rows`, some of those of the window, of two different groups of the values to compute, and of those before.
    #[inline(always)]
    pub(crate) fn pair(
        &mut self,
        groups: [usize; 2],
        rows: &Range<usize>,
    ) -> [Part<'_, T, WIDTH>; 2] {
        assert!(groups[0] != groups[1], "two groups");
        groups.map(|group| self.part(group, rows))
    }

    /// The same of one group.
    #[inline(always)]
    pub(crate) fn one(&mut self, group: usize, rows: &Range<usize>) -> Part<'_, T, WIDTH> {
        self.part(group, rows)
    }

    #[inline(always)]
    fn part<'b>(&self, group: usize, rows: &Range<usize>) -> Part<'b, T, WIDTH> {
        assert!(
            self.rows.start <= rows.start && rows.end <= self.rows.end,
            "rows of the window"
        );
        let (next, own) = (self.next.begin(group, rows), self.z.begin(group, rows));
        // SAFETY: the rows lie within both (`begin` checks it), are the window's alone, and the callers, which
        // borrow it mutably, ask for no two parts of one group
        unsafe {
            Part {
                next: std::slice::from_raw_parts_mut(next, rows.len()),
                own: std::slice::from_raw_parts(own, rows.len()),
                z: Source(self.z.groups[group], PhantomData),
            }
        }
    }
}

/// Some rows of one group of lanes.
#[derive(Debug)]
pub(crate) struct Part<'a, T, const WIDTH: usize> {
    /// Their values after the step before last, in place of which come those after the step.
    pub(crate) next: &'a mut [[T; WIDTH]],
    /// Their values after the step before.
    pub(crate) own: &'a [[T; WIDTH]],
    /// The values of all rows after the step before.
    pub(crate) z: Source<'a, T, WIDTH>,
}

/// The values of one group at all points.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source<'a, T, const WIDTH: usize>(*const [T; WIDTH], PhantomData<&'a [T; WIDTH]>);

impl<'a, T: Real, const WIDTH: usize> Source<'a, T, WIDTH> {
    /// The values at point `i`.
    ///
    /// # Safety
    /// There is a point `i`, and a row of the window has an edge from it.
    #[inline(always)]
    #[expect(
        unsafe_code,
        reason = "the check of every column takes a sixth of the time of a sweep"
    )]
    pub(crate) unsafe fn at(self, i: u32) -> &'a [T; WIDTH] {
        // SAFETY: the caller promises that the row exists; nobody writes it while the window lives
        unsafe { &*self.0.add(i as usize) }
    }
}
