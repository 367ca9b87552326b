//! Sweeps over the graph: the only place where time is spent in number crunching.
//!
//! A sweep works on blocks of consecutive rows. Values spread from the seeds by one edge a sweep, so at first
//! most halves of most blocks are zero; those are left out, at no loss.

use crate::lanes::{BACKGROUND_LANE, Half, LaneSeeds, Values};
use crate::{PointGraph, Real};
use multiversion::multiversion;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a block.
const BLOCK: usize = 16;
/// Blocks handled by one task of the thread pool.
const BLOCKS_A_TASK: usize = 32;

/// Edges of a point with the paper's parameters: 10 neighbours and itself.
const PAPER_DEGREE: usize = 11;

/// Number of floats that make half a cache line.
pub(crate) const HALF_F32: usize = 8;
/// The same of doubles.
pub(crate) const HALF_F64: usize = 4;

/// One step next <- seeds * s + along * A z - stay * z - back * next.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<T> {
    pub(crate) seeds: T,
    pub(crate) along: T,
    pub(crate) stay: T,
    pub(crate) back: T,
}

/// What the rows of a step are computed from.
pub(crate) struct Inputs<'a, T, const HALF: usize> {
    a: &'a PointGraph<T>,
    seeds: &'a LaneSeeds<T>,
    step: Step<T>,
    z: &'a Values<T, HALF>,
    /// One where the background lies, zero elsewhere: its seeds are added to all lanes at once, since a single
    /// lane would have to wait for the row to reach memory.
    background_lanes: [T; HALF],
}

impl<'a, T: Real, const HALF: usize> Inputs<'a, T, HALF> {
    fn new(
        a: &'a PointGraph<T>,
        seeds: &'a LaneSeeds<T>,
        step: Step<T>,
        z: &'a Values<T, HALF>,
    ) -> Self {
        assert!(
            z.0.iter().all(|half| half.len() == a.len()),
            "values for each point"
        );
        let mut background_lanes = [T::default(); HALF];
        background_lanes[BACKGROUND_LANE] = T::from_f64(1.0);
        Self {
            a,
            seeds,
            step,
            z,
            background_lanes,
        }
    }
}

/// Consecutive blocks of rows that a step computes.
pub(crate) struct Task<'a, T, const HALF: usize> {
    /// Number of the first block.
    first: usize,
    next: [&'a mut [Half<T, HALF>]; 2],
    /// Halves of each block that may become anything but zeros.
    active: &'a [u8],
    /// Halves of each block that are.
    filled: &'a mut [u8],
}

/// A precision for which sweeps are compiled.
pub(crate) trait Sweep<const HALF: usize>: Real {
    /// Computes the active halves of the blocks of `task`.
    fn step_blocks(inputs: &Inputs<Self, HALF>, task: Task<Self, HALF>);
}

impl Sweep<HALF_F32> for f32 {
    fn step_blocks(inputs: &Inputs<f32, HALF_F32>, task: Task<f32, HALF_F32>) {
        step_f32(inputs, task);
    }
}

impl Sweep<HALF_F64> for f64 {
    fn step_blocks(inputs: &Inputs<f64, HALF_F64>, task: Task<f64, HALF_F64>) {
        step_f64(inputs, task);
    }
}

// without fused multiply-add, which is not faster here, results are the same bits on every processor
#[multiversion(targets("x86_64+avx2"))]
fn step_f32(inputs: &Inputs<f32, HALF_F32>, task: Task<f32, HALF_F32>) {
    step_all(inputs, task);
}

#[multiversion(targets("x86_64+avx2"))]
fn step_f64(inputs: &Inputs<f64, HALF_F64>, task: Task<f64, HALF_F64>) {
    step_all(inputs, task);
}

#[inline(always)]
fn step_all<T: Real, const HALF: usize>(inputs: &Inputs<T, HALF>, task: Task<T, HALF>) {
    let [first, second] = task.next;
    let rows = first.chunks_mut(BLOCK).zip(second.chunks_mut(BLOCK));
    let states = task.active.iter().zip(task.filled);
    for (block, ((first, second), (&active, filled))) in rows.zip(states).enumerate() {
        if active == 0 {
            continue;
        }
        let start = (task.first + block) * BLOCK;
        let range = start..start + first.len();
        if active & 1 != 0 {
            step_rows::<T, HALF, 0>(inputs, range.clone(), first);
        }
        if active & 2 != 0 {
            step_rows::<T, HALF, 1>(inputs, range.clone(), second);
        }
        for &(i, lane, weight) in inputs.seeds.of_rows(range) {
            let rows = if (lane as usize) < HALF {
                &mut *first
            } else {
                &mut *second
            };
            rows[i as usize - start].0[lane as usize % HALF] += inputs.step.seeds * weight;
        }
        if active & !*filled != 0 {
            *filled |= u8::from(in_use(first)) | u8::from(in_use(second)) << 1;
        }
    }
}

fn in_use<T: Real, const HALF: usize>(rows: &[Half<T, HALF>]) -> bool {
    rows.iter().any(|row| row.0 != [T::default(); HALF])
}

/// Computes one half of the rows of `range`.
#[inline(always)]
fn step_rows<T: Real, const HALF: usize, const WHICH: usize>(
    inputs: &Inputs<T, HALF>,
    range: Range<usize>,
    rows: &mut [Half<T, HALF>],
) {
    let z = &inputs.z.0[WHICH];
    let background = &inputs.seeds.background[range.clone()];
    let points = rows.iter_mut().zip(&z[range.clone()]).zip(background);
    if inputs.a.degree() == Some(PAPER_DEGREE) {
        // with a number of edges known beforehand there is no loop over them, and less to check
        let (columns, weights) = inputs.a.slices(range);
        let columns = columns.as_chunks::<PAPER_DEGREE>().0;
        let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
        for (((row, own), &background), (columns, weights)) in points.zip(edges) {
            let sum = weighted_sum(z, columns, weights);
            row.0 = finish::<T, HALF, WHICH>(inputs, &sum, &own.0, &row.0, background);
        }
    } else {
        for (i, ((row, own), &background)) in range.zip(points) {
            let (columns, weights) = inputs.a.slices(i..i + 1);
            let sum = weighted_sum(z, columns, weights);
            row.0 = finish::<T, HALF, WHICH>(inputs, &sum, &own.0, &row.0, background);
        }
    }
}

/// Weighted sum of the rows of `z` that `columns` name.
#[inline(always)]
#[expect(
    unsafe_code,
    reason = "the check of every column takes a sixth of the time of a sweep"
)]
fn weighted_sum<T: Real, const HALF: usize>(
    z: &[Half<T, HALF>],
    columns: &[u32],
    weights: &[T],
) -> [T; HALF] {
    // one row, one thread: sums keep their order, so results do too
    let mut sum = [T::default(); HALF];
    for (&column, &weight) in columns.iter().zip(weights) {
        // SAFETY: a `PointGraph` has no column beyond its last row, and `Inputs::new` sees to as many in `z`
        let values = unsafe { z.get_unchecked(column as usize) };
        for (sum, value) in sum.iter_mut().zip(&values.0) {
            *sum += weight * *value;
        }
    }
    sum
}

/// The values of a half after the step; those too small to matter become zero.
#[inline(always)]
fn finish<T: Real, const HALF: usize, const WHICH: usize>(
    inputs: &Inputs<T, HALF>,
    sum: &[T; HALF],
    z: &[T; HALF],
    before: &[T; HALF],
    background: T,
) -> [T; HALF] {
    let Step {
        seeds,
        along,
        stay,
        back,
    } = inputs.step;
    let (background, least) = (seeds * background, inputs.seeds.least);
    let mut next = [T::default(); HALF];
    for lane in 0..HALF {
        let mut value = along * sum[lane] - stay * z[lane] - back * before[lane];
        if WHICH == BACKGROUND_LANE / HALF {
            value += background * inputs.background_lanes[lane];
        }
        let counts = value > least || value < T::default() - least;
        next[lane] = if counts { value } else { T::default() };
    }
    next
}

/// The blocks of a graph: which of them values flow to from each.
pub(crate) struct Blocks {
    offsets: Vec<u32>,
    targets: Vec<u32>,
}

impl Blocks {
    pub(crate) fn new<T: Real>(a: &PointGraph<T>) -> Self {
        let count = a.len().div_ceil(BLOCK);
        let sources: Vec<Vec<u32>> = (0..count)
            .into_par_iter()
            .with_min_len(BLOCKS_A_TASK)
            .map_init(
                || vec![u32::MAX; count],
                |met, block| sources_of(a, block, met),
            )
            .collect();
        let mut offsets = vec![0_u32; count + 1];
        for &source in sources.iter().flatten() {
            offsets[source as usize + 1] += 1;
        }
        for block in 0..count {
            offsets[block + 1] += offsets[block];
        }
        let mut ends = offsets.clone();
        let mut targets = vec![0; offsets[count] as usize];
        for (block, sources) in sources.iter().enumerate() {
            for &source in sources {
                let end = &mut ends[source as usize];
                targets[*end as usize] = block as u32;
                *end += 1;
            }
        }
        Self { offsets, targets }
    }

    fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn targets(&self, block: usize) -> &[u32] {
        &self.targets[self.offsets[block] as usize..self.offsets[block + 1] as usize]
    }
}

/// Blocks that the rows of `block` have an edge from. `met` says for every block at which one it was last met.
fn sources_of<T: Real>(a: &PointGraph<T>, block: usize, met: &mut [u32]) -> Vec<u32> {
    let rows = block * BLOCK..a.len().min((block + 1) * BLOCK);
    let mut sources = Vec::with_capacity(32);
    for &column in a.slices(rows).0 {
        let source = column / BLOCK as u32;
        if met[source as usize] != block as u32 {
            met[source as usize] = block as u32;
            sources.push(source);
        }
    }
    sources
}

/// Values of the lanes of one pass at all points, and those of the step before.
pub(crate) struct State<'a, T, const HALF: usize> {
    a: &'a PointGraph<T>,
    seeds: &'a LaneSeeds<T>,
    blocks: &'a Blocks,
    /// Values after the last step.
    pub(crate) z: Values<T, HALF>,
    /// Values before it, which the next step overwrites.
    pub(crate) previous: Values<T, HALF>,
    /// Halves of each block that may hold anything but zeros: bit 0 for the first, bit 1 for the second.
    active: Vec<u8>,
    /// Halves of each block that do.
    filled: Vec<u8>,
    /// Halves of each block that do and have made active the blocks that they flow to.
    passed_on: Vec<u8>,
}

impl<'a, T: Sweep<HALF>, const HALF: usize> State<'a, T, HALF> {
    /// z = `scale` * s, with the probe's seeds as they are.
    pub(crate) fn new(
        a: &'a PointGraph<T>,
        seeds: &'a LaneSeeds<T>,
        blocks: &'a Blocks,
        scale: T,
    ) -> Self {
        let (mut z, previous) = (Values::zero(a.len()), Values::zero(a.len()));
        for &(i, lane, weight) in seeds.of_rows(0..a.len()) {
            *z.get_mut(i as usize, lane as usize) = scale * weight;
        }
        for (row, &weight) in z.0[0].iter_mut().zip(&seeds.background) {
            row.0[BACKGROUND_LANE] += scale * weight;
        }
        if let Some((lane, seeds)) = &seeds.probe {
            seeds
                .iter()
                .enumerate()
                .for_each(|(i, &seed)| *z.get_mut(i, *lane) = seed);
        }
        let active = seeds.halves(BLOCK, HALF);
        let (filled, passed_on) = (active.clone(), vec![0; blocks.len()]);
        let mut state = Self {
            a,
            seeds,
            blocks,
            z,
            previous,
            active,
            filled,
            passed_on,
        };
        state.spread();
        state
    }

    /// Lane of the probe, if there is one.
    pub(crate) fn probe(&self) -> Option<usize> {
        self.seeds.probe.as_ref().map(|(lane, _)| *lane)
    }

    /// Applies `step`; what was z becomes the previous values.
    pub(crate) fn step(&mut self, step: Step<T>) {
        let inputs = Inputs::new(self.a, self.seeds, step, &self.z);
        let [first, second] = &mut self.previous.0;
        let rows = BLOCK * BLOCKS_A_TASK;
        let next = first.par_chunks_mut(rows).zip(second.par_chunks_mut(rows));
        let states = self
            .active
            .par_chunks(BLOCKS_A_TASK)
            .zip(self.filled.par_chunks_mut(BLOCKS_A_TASK));
        next.zip(states)
            .enumerate()
            .for_each(|(task, ((first, second), (active, filled)))| {
                let first_block = task * BLOCKS_A_TASK;
                T::step_blocks(
                    &inputs,
                    Task {
                        first: first_block,
                        next: [first, second],
                        active,
                        filled,
                    },
                );
            });
        std::mem::swap(&mut self.z, &mut self.previous);
        self.spread();
    }

    /// Makes active the blocks that newly filled ones flow to.
    fn spread(&mut self) {
        for block in 0..self.blocks.len() {
            let new = self.filled[block] & !self.passed_on[block];
            if new != 0 {
                self.passed_on[block] |= new;
                for &target in self.blocks.targets(block) {
                    self.active[target as usize] |= new;
                }
            }
        }
    }
}
