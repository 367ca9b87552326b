//! Sweeps over the graph: the only place where time is spent in number crunching.
//!
//! A sweep works on blocks of consecutive rows. Values spread from the seeds by one edge a sweep, so at first
//! most halves of most blocks are zero; those are left out, at no loss.

use crate::lanes::{LaneSeeds, Row};
use crate::{PointGraph, Real};
use multiversion::multiversion;
use rayon::prelude::*;

/// Rows of a block.
const BLOCK: usize = 16;
/// Blocks handled by one task of the thread pool.
const BLOCKS_A_TASK: usize = 32;

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

/// A precision for which sweeps are compiled.
pub(crate) trait Sweep<const HALF: usize>: Real {
    /// Applies `step` to the blocks of `next` from block `first` on, each where `active` has its bit set.
    fn step_blocks(
        a: &PointGraph<Self>,
        seeds: &LaneSeeds<Self>,
        step: Step<Self>,
        z: &[Row<Self, HALF>],
        next: &mut [Row<Self, HALF>],
        first: usize,
        active: &[u8],
    );
}

impl Sweep<HALF_F32> for f32 {
    fn step_blocks(
        a: &PointGraph<f32>,
        seeds: &LaneSeeds<f32>,
        step: Step<f32>,
        z: &[Row<f32, HALF_F32>],
        next: &mut [Row<f32, HALF_F32>],
        first: usize,
        active: &[u8],
    ) {
        step_f32(a, seeds, step, z, next, first, active);
    }
}

impl Sweep<HALF_F64> for f64 {
    fn step_blocks(
        a: &PointGraph<f64>,
        seeds: &LaneSeeds<f64>,
        step: Step<f64>,
        z: &[Row<f64, HALF_F64>],
        next: &mut [Row<f64, HALF_F64>],
        first: usize,
        active: &[u8],
    ) {
        step_f64(a, seeds, step, z, next, first, active);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn step_f32(
    a: &PointGraph<f32>,
    seeds: &LaneSeeds<f32>,
    step: Step<f32>,
    z: &[Row<f32, HALF_F32>],
    next: &mut [Row<f32, HALF_F32>],
    first: usize,
    active: &[u8],
) {
    step_all(a, seeds, step, z, next, first, active);
}

#[multiversion(targets("x86_64+avx2"))]
fn step_f64(
    a: &PointGraph<f64>,
    seeds: &LaneSeeds<f64>,
    step: Step<f64>,
    z: &[Row<f64, HALF_F64>],
    next: &mut [Row<f64, HALF_F64>],
    first: usize,
    active: &[u8],
) {
    step_all(a, seeds, step, z, next, first, active);
}

#[inline(always)]
fn step_all<T: Real, const HALF: usize>(
    a: &PointGraph<T>,
    seeds: &LaneSeeds<T>,
    step: Step<T>,
    z: &[Row<T, HALF>],
    next: &mut [Row<T, HALF>],
    first: usize,
    active: &[u8],
) {
    for (block, (rows, halves)) in next.chunks_mut(BLOCK).zip(active).enumerate() {
        let start = (first + block) * BLOCK;
        for (i, row) in (start..).zip(rows) {
            match halves {
                0 => break,
                1 => step_half(a, step, z, i, row, 0),
                2 => step_half(a, step, z, i, row, 1),
                _ => step_row(a, step, z, i, row),
            }
            for &(lane, weight) in seeds.row(i) {
                row.as_flattened_mut()[lane as usize] += step.seeds * weight;
            }
        }
    }
}

#[inline(always)]
fn step_row<T: Real, const HALF: usize>(
    a: &PointGraph<T>,
    step: Step<T>,
    z: &[Row<T, HALF>],
    i: usize,
    row: &mut Row<T, HALF>,
) {
    // one row, one thread: sums keep their order, so results do too
    let mut sum = [[T::default(); HALF]; 2];
    let (columns, weights) = a.row_slices(i);
    for (&j, &weight) in columns.iter().zip(weights) {
        let values = &z[j as usize];
        for half in 0..2 {
            for lane in 0..HALF {
                sum[half][lane] += weight * values[half][lane];
            }
        }
    }
    for half in 0..2 {
        finish(step, &sum[half], &z[i][half], &mut row[half]);
    }
}

#[inline(always)]
fn step_half<T: Real, const HALF: usize>(
    a: &PointGraph<T>,
    step: Step<T>,
    z: &[Row<T, HALF>],
    i: usize,
    row: &mut Row<T, HALF>,
    half: usize,
) {
    let mut sum = [T::default(); HALF];
    let (columns, weights) = a.row_slices(i);
    for (&j, &weight) in columns.iter().zip(weights) {
        let values = &z[j as usize][half];
        for lane in 0..HALF {
            sum[lane] += weight * values[lane];
        }
    }
    finish(step, &sum, &z[i][half], &mut row[half]);
}

#[inline(always)]
fn finish<T: Real, const HALF: usize>(
    step: Step<T>,
    sum: &[T; HALF],
    z: &[T; HALF],
    row: &mut [T; HALF],
) {
    for lane in 0..HALF {
        row[lane] = step.along * sum[lane] - step.stay * z[lane] - step.back * row[lane];
    }
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
            .map(|block| sources_of(a, block))
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

fn sources_of<T: Real>(a: &PointGraph<T>, block: usize) -> Vec<u32> {
    let rows = block * BLOCK..a.len().min((block + 1) * BLOCK);
    let mut sources: Vec<u32> = Vec::with_capacity(32);
    for &column in a.columns_of(rows) {
        let source = column / BLOCK as u32;
        if !sources.contains(&source) {
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
    pub(crate) z: Vec<Row<T, HALF>>,
    /// Values before it, which the next step overwrites.
    pub(crate) previous: Vec<Row<T, HALF>>,
    /// Halves of each block that may hold anything but zeros.
    active: Vec<u8>,
    /// Halves of each block that do.
    filled: Vec<u8>,
}

impl<'a, T: Sweep<HALF>, const HALF: usize> State<'a, T, HALF> {
    /// z = `scale` * s, with the probe's seeds as they are.
    pub(crate) fn new(
        a: &'a PointGraph<T>,
        seeds: &'a LaneSeeds<T>,
        blocks: &'a Blocks,
        scale: T,
    ) -> Self {
        let mut z = vec![[[T::default(); HALF]; 2]; a.len()];
        z.par_iter_mut()
            .enumerate()
            .with_min_len(BLOCK * BLOCKS_A_TASK)
            .for_each(|(i, row)| {
                for &(lane, weight) in seeds.row(i) {
                    row.as_flattened_mut()[lane as usize] = scale * weight;
                }
                if let Some((lane, seeds)) = &seeds.probe {
                    row.as_flattened_mut()[*lane] = seeds[i];
                }
            });
        let previous = vec![[[T::default(); HALF]; 2]; a.len()];
        let active = seeds.halves(BLOCK, HALF);
        let filled = vec![0; blocks.len()];
        let mut state = Self {
            a,
            seeds,
            blocks,
            z,
            previous,
            active,
            filled,
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
        let (a, seeds, z) = (self.a, self.seeds, &self.z);
        self.previous
            .par_chunks_mut(BLOCK * BLOCKS_A_TASK)
            .zip(self.active.par_chunks(BLOCKS_A_TASK))
            .enumerate()
            .for_each(|(task, (next, active))| {
                T::step_blocks(a, seeds, step, z, next, task * BLOCKS_A_TASK, active);
            });
        std::mem::swap(&mut self.z, &mut self.previous);
        self.spread();
    }

    /// Lets the blocks that values have newly reached pass them on.
    fn spread(&mut self) {
        for block in 0..self.blocks.len() {
            let unsure = self.active[block] & !self.filled[block];
            if unsure == 0 {
                continue;
            }
            let reached = unsure & self.halves_in_use(block);
            self.filled[block] |= reached;
            for &target in self.blocks.targets(block) {
                self.active[target as usize] |= reached;
            }
        }
    }

    fn halves_in_use(&self, block: usize) -> u8 {
        let rows = &self.z[block * BLOCK..self.z.len().min((block + 1) * BLOCK)];
        let used = |half: usize| {
            rows.iter()
                .any(|row| row[half].iter().any(|&value| value != T::default()))
        };
        u8::from(used(0)) | u8::from(used(1)) << 1
    }
}
