//! One step of the recurrence over some rows of the graph: the only place where time is spent in number crunching.

#![expect(
    unsafe_code,
    reason = "threads share values by rows, and a check of every column takes a sixth of the time of a sweep"
)]

use super::schedule::{Activity, BLOCK, Schedule};
use super::seeds::{BACKGROUND_LANE, Seeds};
use super::values::SharedValues;
use crate::graph::PointGraph;
use crate::{Cancel, Real, Result};
use multiversion::multiversion;
use std::hint::black_box;
use std::ops::Range;

/// Edges of a point with the paper's parameters: 10 neighbours and itself.
const PAPER_DEGREE: usize = 11;

/// Lanes of a group in single precision.
pub(super) const WIDTH_F32: usize = 8;
/// The same in double precision.
pub(super) const WIDTH_F64: usize = 4;

/// One step next <- seeds * s + along * A z - stay * z - back * next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<T> {
    pub(super) seeds: T,
    pub(super) along: T,
    pub(super) stay: T,
    pub(super) back: T,
}

impl<T: Real> Step<T> {
    /// z <- A z + b as it stands.
    pub(super) fn product() -> Self {
        Self::new(1.0, 1.0, 0.0, 0.0)
    }

    pub(super) fn new(seeds: f64, along: f64, stay: f64, back: f64) -> Self {
        let [seeds, along, stay, back] = [seeds, along, stay, back].map(T::from_f64);
        Self {
            seeds,
            along,
            stay,
            back,
        }
    }
}

/// Takes `steps` one after the other, each from the first of `values` to the second, which change places after it.
pub(super) fn take_steps<T: Real, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    schedule: &Schedule,
    steps: &[Step<T>],
    activity: &Activity,
    values: [&mut [Vec<[T; WIDTH]>]; 2],
    cancel: &Cancel,
) -> Result<()> {
    let values = values.map(SharedValues::new);
    schedule.run(steps.len(), cancel, |rows, step| {
        let from_to = [&values[step % 2], &values[(step + 1) % 2]];
        // SAFETY: nobody else is in these rows, and what they have edges from lies in them or in tiles next to them,
        // which neither are behind `step`, so have its z, nor ahead of the step after it, so have not lost it
        unsafe { sweep(a, seeds, steps[step], activity, from_to, rows) }
    })
}

/// Computes the active groups of the rows in `all`, which are whole blocks, of the second values from the first.
///
/// # Safety
/// Meanwhile nobody else touches these rows of the second values, or writes a row of the first that lies in `all` or that
/// a row in `all` has an edge from.
// without fused multiply-add, which is not faster here, results are the same bits on every processor
#[multiversion(targets("x86_64+avx2"))]
unsafe fn sweep<T: Real, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    activity: &Activity,
    values: [&SharedValues<T, WIDTH>; 2],
    all: Range<usize>,
) {
    // one where the background lies: its seed is added to all lanes at once, since a single lane would have to wait for
    // the row to reach memory; a black box, since the compiler would take the lanes apart
    let mut lanes = [T::default(); WIDTH];
    lanes[BACKGROUND_LANE] = T::from_f64(1.0);
    let lanes = &black_box(lanes);
    let next = values[1];
    for block in all.start / BLOCK..all.end.div_ceil(BLOCK) {
        let rows = block * BLOCK..all.end.min((block + 1) * BLOCK);
        let active = activity.active(block);
        let mut groups = (0..next.groups()).filter(|group| active >> group & 1 == 1);
        while let Some(group) = groups.next() {
            let pair = (group, groups.next());
            // SAFETY: as the caller promises; groups differ
            unsafe {
                if group == BACKGROUND_LANE / WIDTH {
                    step_pair::<T, WIDTH, true>(a, seeds, step, pair, values, &rows, lanes);
                } else {
                    step_pair::<T, WIDTH, false>(a, seeds, step, pair, values, &rows, lanes);
                }
            }
        }
        for &(i, lane, weight) in seeds.of_rows(rows.clone()) {
            let (group, lane) = (lane as usize / WIDTH, lane as usize % WIDTH);
            // SAFETY: as the caller promises
            let next = unsafe { next.rows_mut(group, &rows) };
            next[i as usize - rows.start][lane] += step.seeds * weight;
        }
        let unfilled = active & !activity.filled(block);
        if unfilled != 0 {
            let unfilled = (0..next.groups()).filter(|group| unfilled >> group & 1 == 1);
            // SAFETY: as the caller promises
            let new = unfilled.filter(|&group| in_use(unsafe { next.rows(group, &rows) }));
            activity.fill(block, new.fold(0, |bits, group| bits | 1 << group));
        }
    }
}

fn in_use<T: Real, const WIDTH: usize>(rows: &[[T; WIDTH]]) -> bool {
    rows.iter().any(|row| *row != [T::default(); WIDTH])
}

/// Computes one group of `rows`, the one with the background if `BACKGROUND`.
///
/// # Safety
/// As of [`sweep`].
#[inline(always)]
unsafe fn step_rows<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    group: usize,
    [z, next]: [&SharedValues<T, WIDTH>; 2],
    rows: &Range<usize>,
    lanes: &[T; WIDTH],
) {
    let source = z.source(group);
    // SAFETY: as the caller promises
    let (own, next) = unsafe { (z.rows(group, rows), next.rows_mut(group, rows)) };
    let points = next
        .iter_mut()
        .zip(own)
        .zip(&seeds.background[rows.clone()]);
    if a.degree() == Some(PAPER_DEGREE) {
        // with a number of edges known beforehand there is no loop over them, and less to check
        for (((row, own), &seed), (columns, weights)) in points.zip(paper_edges(a, rows)) {
            let [sum] = paper_sums([source], [own], columns, weights);
            *row = finish::<T, WIDTH, BACKGROUND>(step, &sum, own, row, seed, lanes, seeds.least);
        }
    } else {
        for (i, ((row, own), &seed)) in rows.clone().zip(points) {
            let (columns, weights) = a.slices(i..i + 1);
            let mut sum = [[T::default(); WIDTH]];
            for (&column, &weight) in columns.iter().zip(weights) {
                add(&mut sum, [source], column, weight);
            }
            *row =
                finish::<T, WIDTH, BACKGROUND>(step, &sum[0], own, row, seed, lanes, seeds.least);
        }
    }
}

/// Computes a group of `rows`, and another one with it if there is one, which share what they read of the graph; the
/// background lies in the first, if `BACKGROUND`.
///
/// # Safety
/// As of [`sweep`].
#[inline(always)]
unsafe fn step_pair<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    (first, second): (usize, Option<usize>),
    [z, next]: [&SharedValues<T, WIDTH>; 2],
    rows: &Range<usize>,
    lanes: &[T; WIDTH],
) {
    let Some(second) = second.filter(|_| a.degree() == Some(PAPER_DEGREE)) else {
        // SAFETY: as the caller promises
        unsafe {
            step_rows::<T, WIDTH, BACKGROUND>(a, seeds, step, first, [z, next], rows, lanes);
            if let Some(second) = second {
                step_rows::<T, WIDTH, false>(a, seeds, step, second, [z, next], rows, lanes);
            }
        }
        return;
    };
    let sources = [z.source(first), z.source(second)];
    // SAFETY: as the caller promises; groups differ
    let (own, other) = unsafe { (z.rows(first, rows), z.rows(second, rows)) };
    // SAFETY: the same
    let (one, two) = unsafe { (next.rows_mut(first, rows), next.rows_mut(second, rows)) };
    let points = one.iter_mut().zip(two).zip(own.iter().zip(other));
    let points = points.zip(&seeds.background[rows.clone()]);
    for ((((one, two), own), &seed), (columns, weights)) in points.zip(paper_edges(a, rows)) {
        let sums = paper_sums(sources, [own.0, own.1], columns, weights);
        *one = finish::<T, WIDTH, BACKGROUND>(step, &sums[0], own.0, one, seed, lanes, seeds.least);
        *two = finish::<T, WIDTH, false>(step, &sums[1], own.1, two, seed, lanes, seeds.least);
    }
}

/// Columns and weights of each of `rows`.
#[inline(always)]
fn paper_edges<'a, T: Real>(
    a: &'a PointGraph<T>,
    rows: &Range<usize>,
) -> impl Iterator<Item = (&'a [u32; PAPER_DEGREE], &'a [T; PAPER_DEGREE])> {
    let (columns, weights) = a.slices(rows.clone());
    columns.as_chunks().0.iter().zip(weights.as_chunks().0)
}

/// Weighted sums, for each of `sources`, of the rows that `columns` name, the first of which are their `own`.
#[inline(always)]
fn paper_sums<T: Real, const WIDTH: usize, const GROUPS: usize>(
    sources: [*const [T; WIDTH]; GROUPS],
    own: [&[T; WIDTH]; GROUPS],
    columns: &[u32; PAPER_DEGREE],
    weights: &[T; PAPER_DEGREE],
) -> [[T; WIDTH]; GROUPS] {
    // rows of one length begin with the point itself
    let mut sums = own.map(|values| values.map(|value| weights[0] * value));
    // in three parts, since the compiler leaves a loop over all edges a loop, which takes a quarter more time
    for edge in 1..4 {
        add(&mut sums, sources, columns[edge], weights[edge]);
    }
    for edge in 4..8 {
        add(&mut sums, sources, columns[edge], weights[edge]);
    }
    for edge in 8..PAPER_DEGREE {
        add(&mut sums, sources, columns[edge], weights[edge]);
    }
    sums
}

/// Adds to the sums of some groups what comes along one edge of a row.
#[inline(always)]
fn add<T: Real, const WIDTH: usize, const GROUPS: usize>(
    sums: &mut [[T; WIDTH]; GROUPS],
    sources: [*const [T; WIDTH]; GROUPS],
    column: u32,
    weight: T,
) {
    for group in 0..GROUPS {
        // SAFETY: a `PointGraph` has no column beyond its last row, this is an edge of a row that the caller of `sweep`
        // holds, and nobody writes the rows that such edges come from
        let values = unsafe { &*sources[group].add(column as usize) };
        for lane in 0..WIDTH {
            sums[group][lane] += weight * values[lane];
        }
    }
}

/// The values of a group at a point after the step; those too small to matter become zero.
#[inline(always)]
fn finish<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    step: Step<T>,
    sum: &[T; WIDTH],
    own: &[T; WIDTH],
    before: &[T; WIDTH],
    background: T,
    lanes: &[T; WIDTH],
    least: T,
) -> [T; WIDTH] {
    let background = step.seeds * background;
    let mut after = [T::default(); WIDTH];
    for lane in 0..WIDTH {
        let mut value = step.along * sum[lane] - step.stay * own[lane] - step.back * before[lane];
        if BACKGROUND {
            value += background * lanes[lane];
        }
        after[lane] = if value.abs() > least {
            value
        } else {
            T::default()
        };
    }
    after
}
