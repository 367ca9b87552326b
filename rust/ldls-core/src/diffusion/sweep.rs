//! One step of the recurrence over some rows of the graph: the only place where time is spent in number crunching.

use super::schedule::{Activity, BLOCK};
use super::seeds::{BACKGROUND_LANE, Seeds};
use super::values::SharedValues;
use crate::Real;
use crate::graph::PointGraph;
use multiversion::multiversion;
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

/// Computes the active groups of the rows in `all`, which are whole blocks, of the second values from the first.
///
/// # Safety
/// Meanwhile nobody else touches these rows of the second values, or writes a row of the first that lies in `all` or that
/// a row in `all` has an edge from.
// without fused multiply-add, which is not faster here, results are the same bits on every processor
#[multiversion(targets("x86_64+avx2"))]
#[expect(unsafe_code, reason = "threads share values by rows")]
pub(super) unsafe fn sweep<T: Real, const WIDTH: usize>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    activity: &Activity,
    values: [&SharedValues<T, WIDTH>; 2],
    all: Range<usize>,
) {
    let next = values[1];
    for block in all.start / BLOCK..all.end.div_ceil(BLOCK) {
        let rows = block * BLOCK..all.end.min((block + 1) * BLOCK);
        let active = activity.active(block);
        let mut groups = (0..next.groups()).filter(|group| active >> group & 1 == 1);
        while let Some(group) = groups.next() {
            let background = group == BACKGROUND_LANE / WIDTH;
            // two groups at a time share what they read of the graph
            let pair = groups.next().map(|other| [group, other]);
            // SAFETY: as the caller promises; groups differ
            unsafe {
                match (pair, background) {
                    (Some(pair), true) => {
                        step_rows::<_, _, 2, true>(a, seeds, step, pair, values, &rows);
                    }
                    (Some(pair), false) => {
                        step_rows::<_, _, 2, false>(a, seeds, step, pair, values, &rows);
                    }
                    (None, true) => {
                        step_rows::<_, _, 1, true>(a, seeds, step, [group], values, &rows);
                    }
                    (None, false) => {
                        step_rows::<_, _, 1, false>(a, seeds, step, [group], values, &rows);
                    }
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

/// Computes `GROUPS` different groups of `rows`; the background lies in the first, if `BACKGROUND`.
///
/// # Safety
/// As of [`sweep`].
#[inline(always)]
#[expect(unsafe_code, reason = "threads share values by rows")]
unsafe fn step_rows<T: Real, const WIDTH: usize, const GROUPS: usize, const BACKGROUND: bool>(
    a: &PointGraph<T>,
    seeds: &Seeds<T>,
    step: Step<T>,
    groups: [usize; GROUPS],
    [z, next]: [&SharedValues<T, WIDTH>; 2],
    rows: &Range<usize>,
) {
    let sources = groups.map(|group| z.source(group));
    // SAFETY: as the caller promises; groups differ
    let own = groups.map(|group| unsafe { z.rows(group, rows) });
    // SAFETY: the same
    let mut next = groups.map(|group| unsafe { next.rows_mut(group, rows) });
    let background = &seeds.background[rows.clone()];
    let mut finish_row = |row: usize, sums: [[T; WIDTH]; GROUPS]| {
        for group in 0..GROUPS {
            let seed = (BACKGROUND && group == 0).then(|| background[row]);
            let before = &mut next[group][row];
            *before = finish(
                step,
                &sums[group],
                &own[group][row],
                before,
                seed,
                seeds.least,
            );
        }
    };
    if a.degree() == Some(PAPER_DEGREE) {
        // with a number of edges known beforehand there is no loop over them, and less to check
        let (columns, weights) = a.slices(rows.clone());
        let columns = columns.as_chunks::<PAPER_DEGREE>().0;
        let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
        for (row, (columns, weights)) in edges.enumerate() {
            finish_row(row, paper_sums(sources, columns, weights));
        }
    } else {
        for (row, i) in rows.clone().enumerate() {
            let (columns, weights) = a.slices(i..i + 1);
            let mut sums = [[T::default(); WIDTH]; GROUPS];
            for (&column, &weight) in columns.iter().zip(weights) {
                add(&mut sums, sources, column, weight);
            }
            finish_row(row, sums);
        }
    }
}

/// Weighted sums, for each of `sources`, of the rows that `columns` name.
#[inline(always)]
fn paper_sums<T: Real, const WIDTH: usize, const GROUPS: usize>(
    sources: [*const [T; WIDTH]; GROUPS],
    columns: &[u32; PAPER_DEGREE],
    weights: &[T; PAPER_DEGREE],
) -> [[T; WIDTH]; GROUPS] {
    let mut sums = [[T::default(); WIDTH]; GROUPS];
    // in three parts, since the compiler leaves a loop over all edges a loop, which takes a quarter more time
    for edge in 0..4 {
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
#[expect(
    unsafe_code,
    reason = "the check of every column takes a sixth of the time of a sweep"
)]
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

/// The values of a group after the step; those too small to matter become zero.
#[inline(always)]
fn finish<T: Real, const WIDTH: usize>(
    step: Step<T>,
    sum: &[T; WIDTH],
    z: &[T; WIDTH],
    before: &[T; WIDTH],
    background: Option<T>,
    least: T,
) -> [T; WIDTH] {
    // one where the background lies: its seed is added to all lanes at once, since a single lane would have to wait for
    // the row to reach memory
    let mut background_lanes = [T::default(); WIDTH];
    background_lanes[BACKGROUND_LANE] = T::from_f64(1.0);
    let background = background.map(|weight| step.seeds * weight);
    let mut next = [T::default(); WIDTH];
    for lane in 0..WIDTH {
        let mut value = step.along * sum[lane] - step.stay * z[lane] - step.back * before[lane];
        if let Some(background) = background {
            value += background * background_lanes[lane];
        }
        next[lane] = if value.abs() > least {
            value
        } else {
            T::default()
        };
    }
    next
}
