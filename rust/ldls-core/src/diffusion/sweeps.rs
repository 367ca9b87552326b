//! Sweeps over the graph: the only place where time is spent in number crunching.

use super::activity::Activity;
use super::blocks::BLOCK;
use super::lanes::{BACKGROUND_LANE, LaneSeeds};
use super::values::{Part, Source, Window};
use crate::Real;
use crate::graph::PointGraph;
use multiversion::multiversion;
use std::ops::Range;

/// Edges of a point with the paper's parameters: 10 neighbours and itself.
const PAPER_DEGREE: usize = 11;

/// Lanes of a group in single precision.
pub(crate) const WIDTH_F32: usize = 8;
/// The same in double precision.
pub(crate) const WIDTH_F64: usize = 4;

/// One step next <- seeds * s + along * A z - stay * z - back * next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<T> {
    pub(crate) seeds: T,
    pub(crate) along: T,
    pub(crate) stay: T,
    pub(crate) back: T,
}

/// What the rows of a step are computed from, but for the values.
#[derive(Debug)]
pub(crate) struct Inputs<'a, T, const WIDTH: usize> {
    a: &'a PointGraph<T>,
    seeds: &'a LaneSeeds<T>,
    step: Step<T>,
    /// One where the background lies, zero elsewhere: its seeds are added to all lanes at once, since a single
    /// lane would have to wait for the row to reach memory.
    background_lanes: [T; WIDTH],
}

impl<'a, T: Real, const WIDTH: usize> Inputs<'a, T, WIDTH> {
    pub(crate) fn new(a: &'a PointGraph<T>, seeds: &'a LaneSeeds<T>, step: Step<T>) -> Self {
        let mut background_lanes = [T::default(); WIDTH];
        background_lanes[BACKGROUND_LANE] = T::from_f64(1.0);
        Self {
            a,
            seeds,
            step,
            background_lanes,
        }
    }
}

/// A precision for which sweeps are compiled.
pub(crate) trait Sweep<const WIDTH: usize>: Real {
    /// Computes what is active of the rows of `window`, which are whole blocks.
    fn sweep(inputs: &Inputs<Self, WIDTH>, activity: &Activity, window: Window<Self, WIDTH>);
}

impl Sweep<WIDTH_F32> for f32 {
    fn sweep(inputs: &Inputs<f32, WIDTH_F32>, activity: &Activity, window: Window<f32, WIDTH_F32>) {
        sweep_f32(inputs, activity, window);
    }
}

impl Sweep<WIDTH_F64> for f64 {
    fn sweep(inputs: &Inputs<f64, WIDTH_F64>, activity: &Activity, window: Window<f64, WIDTH_F64>) {
        sweep_f64(inputs, activity, window);
    }
}

// without fused multiply-add, which is not faster here, results are the same bits on every processor
#[multiversion(targets("x86_64+avx2"))]
fn sweep_f32(inputs: &Inputs<f32, WIDTH_F32>, activity: &Activity, window: Window<f32, WIDTH_F32>) {
    sweep_blocks(inputs, activity, window);
}

#[multiversion(targets("x86_64+avx2"))]
fn sweep_f64(inputs: &Inputs<f64, WIDTH_F64>, activity: &Activity, window: Window<f64, WIDTH_F64>) {
    sweep_blocks(inputs, activity, window);
}

#[inline(always)]
fn sweep_blocks<T: Real, const WIDTH: usize>(
    inputs: &Inputs<T, WIDTH>,
    activity: &Activity,
    mut window: Window<T, WIDTH>,
) {
    let all = window.rows();
    for block in all.start / BLOCK..all.end.div_ceil(BLOCK) {
        let rows = block * BLOCK..all.end.min((block + 1) * BLOCK);
        let active = activity.active(block);
        let mut groups = (0..window.groups()).filter(|group| active >> group & 1 == 1);
        while let Some(group) = groups.next() {
            let background = group == BACKGROUND_LANE / WIDTH;
            if let Some(other) = groups.next() {
                let pair = window.pair([group, other], &rows);
                if background {
                    step_pairs::<T, WIDTH, true>(inputs, rows.clone(), pair);
                } else {
                    step_pairs::<T, WIDTH, false>(inputs, rows.clone(), pair);
                }
            } else {
                let part = window.one(group, &rows);
                if background {
                    step_rows::<T, WIDTH, true>(inputs, rows.clone(), part);
                } else {
                    step_rows::<T, WIDTH, false>(inputs, rows.clone(), part);
                }
            }
        }
        for &(i, lane, weight) in inputs.seeds.of_rows(rows.clone()) {
            let (group, lane) = (lane as usize / WIDTH, lane as usize % WIDTH);
            let part = window.one(group, &rows);
            part.next[i as usize - rows.start][lane] += inputs.step.seeds * weight;
        }
        let unfilled = active & !activity.filled(block);
        if unfilled != 0 {
            let unfilled = (0..window.groups()).filter(|group| unfilled >> group & 1 == 1);
            let new = unfilled.filter(|&group| in_use(window.one(group, &rows).next));
            activity.fill(block, new.fold(0, |bits, group| bits | 1 << group));
        }
    }
}

fn in_use<T: Real, const WIDTH: usize>(rows: &[[T; WIDTH]]) -> bool {
    rows.iter().any(|row| *row != [T::default(); WIDTH])
}

/// Computes one group of the rows of `range`.
#[inline(always)]
fn step_rows<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    inputs: &Inputs<T, WIDTH>,
    range: Range<usize>,
    Part { next, own, z }: Part<T, WIDTH>,
) {
    let background = &inputs.seeds.background[range.clone()];
    let points = next.iter_mut().zip(own).zip(background);
    if inputs.a.degree() == Some(PAPER_DEGREE) {
        // with a number of edges known beforehand there is no loop over them, and less to check
        let (columns, weights) = inputs.a.slices(range);
        let columns = columns.as_chunks::<PAPER_DEGREE>().0;
        let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
        for (((row, own), &background), (columns, weights)) in points.zip(edges) {
            let [sum] = paper_sums([z], columns, weights);
            *row = finish::<T, WIDTH, BACKGROUND>(inputs, &sum, own, row, background);
        }
    } else {
        for (i, ((row, own), &background)) in range.zip(points) {
            let (columns, weights) = inputs.a.slices(i..i + 1);
            let sum = weighted_sum(z, columns, weights);
            *row = finish::<T, WIDTH, BACKGROUND>(inputs, &sum, own, row, background);
        }
    }
}

/// Computes two groups of the rows of `range`, which share what they read of the graph.
#[inline(always)]
fn step_pairs<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    inputs: &Inputs<T, WIDTH>,
    range: Range<usize>,
    [one, two]: [Part<T, WIDTH>; 2],
) {
    if inputs.a.degree() != Some(PAPER_DEGREE) {
        step_rows::<T, WIDTH, BACKGROUND>(inputs, range.clone(), one);
        step_rows::<T, WIDTH, false>(inputs, range, two);
        return;
    }
    let (z_one, z_two) = (one.z, two.z);
    let own = one.own.iter().zip(two.own);
    let background = &inputs.seeds.background[range.clone()];
    let (columns, weights) = inputs.a.slices(range);
    let columns = columns.as_chunks::<PAPER_DEGREE>().0;
    let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
    let points = one.next.iter_mut().zip(two.next).zip(own).zip(background);
    for ((((one, two), (own_one, own_two)), &background), (columns, weights)) in points.zip(edges) {
        let [sum_one, sum_two] = paper_sums([z_one, z_two], columns, weights);
        *one = finish::<T, WIDTH, BACKGROUND>(inputs, &sum_one, own_one, one, background);
        *two = finish::<T, WIDTH, false>(inputs, &sum_two, own_two, two, background);
    }
}

/// Weighted sums, for each of `groups`, of the rows that `columns`, those of a row of the window, name.
#[inline(always)]
fn paper_sums<T: Real, const WIDTH: usize, const GROUPS: usize>(
    groups: [Source<T, WIDTH>; GROUPS],
    columns: &[u32; PAPER_DEGREE],
    weights: &[T; PAPER_DEGREE],
) -> [[T; WIDTH]; GROUPS] {
    // in three parts, since the compiler leaves a loop over all edges a loop, which takes a quarter more time
    let mut sums = [[T::default(); WIDTH]; GROUPS];
    add_edges::<T, WIDTH, GROUPS, 0, 4>(&mut sums, groups, columns, weights);
    add_edges::<T, WIDTH, GROUPS, 4, 8>(&mut sums, groups, columns, weights);
    add_edges::<T, WIDTH, GROUPS, 8, PAPER_DEGREE>(&mut sums, groups, columns, weights);
    sums
}

/// Adds to `sums` what comes along some edges of a row of the window.
#[inline(always)]
fn add_edges<
    T: Real,
    const WIDTH: usize,
    const GROUPS: usize,
    const FIRST: usize,
    const END: usize,
>(
    sums: &mut [[T; WIDTH]; GROUPS],
    groups: [Source<T, WIDTH>; GROUPS],
    columns: &[u32; PAPER_DEGREE],
    weights: &[T; PAPER_DEGREE],
) {
    for edge in FIRST..END {
        for group in 0..GROUPS {
            add(
                &mut sums[group],
                groups[group],
                columns[edge],
                weights[edge],
            );
        }
    }
}

/// Weighted sum of the rows that `columns`, those of a row of the window, name.
#[inline(always)]
fn weighted_sum<T: Real, const WIDTH: usize>(
    z: Source<T, WIDTH>,
    columns: &[u32],
    weights: &[T],
) -> [T; WIDTH] {
    let mut sum = [T::default(); WIDTH];
    for (&column, &weight) in columns.iter().zip(weights) {
        add(&mut sum, z, column, weight);
    }
    sum
}

/// Adds to `sum` what comes along one edge of a row of the window.
#[inline(always)]
#[expect(unsafe_code, reason = "threads share values by rows")]
fn add<T: Real, const WIDTH: usize>(
    sum: &mut [T; WIDTH],
    z: Source<T, WIDTH>,
    column: u32,
    weight: T,
) {
    // SAFETY: a `PointGraph` has no column beyond its last row, and this is an edge of a row of the window
    let values = unsafe { z.at(column) };
    for lane in 0..WIDTH {
        sum[lane] += weight * values[lane];
    }
}

/// The values of a group after the step; those too small to matter become zero.
#[inline(always)]
fn finish<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    inputs: &Inputs<T, WIDTH>,
    sum: &[T; WIDTH],
    z: &[T; WIDTH],
    before: &[T; WIDTH],
    background: T,
) -> [T; WIDTH] {
    let Step {
        seeds,
        along,
        stay,
        back,
    } = inputs.step;
    let (background, least) = (seeds * background, inputs.seeds.least);
    let mut next = [T::default(); WIDTH];
    for lane in 0..WIDTH {
        let mut value = along * sum[lane] - stay * z[lane] - back * before[lane];
        if BACKGROUND {
            value += background * inputs.background_lanes[lane];
        }
        next[lane] = if value.abs() > least {
            value
        } else {
            T::default()
        };
    }
    next
}
