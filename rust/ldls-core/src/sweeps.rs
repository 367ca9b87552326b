//! Sweeps over the graph: the only place where time is spent in number crunching.
//!
//! A sweep works on blocks of consecutive rows. Values spread from the seeds by one edge a sweep, so at first
//! most groups of lanes of most blocks are zero; those are left out, at no loss.

use crate::lanes::{BACKGROUND_LANE, Group, LaneSeeds, Values};
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

/// What the rows of a step are computed from.
pub(crate) struct Inputs<'a, T, const WIDTH: usize> {
    a: &'a PointGraph<T>,
    seeds: &'a LaneSeeds<T>,
    step: Step<T>,
    z: &'a Values<T, WIDTH>,
    /// One where the background lies, zero elsewhere: its seeds are added to all lanes at once, since a single
    /// lane would have to wait for the row to reach memory.
    background_lanes: [T; WIDTH],
}

impl<'a, T: Real, const WIDTH: usize> Inputs<'a, T, WIDTH> {
    fn new(
        a: &'a PointGraph<T>,
        seeds: &'a LaneSeeds<T>,
        step: Step<T>,
        z: &'a Values<T, WIDTH>,
    ) -> Self {
        assert!(
            z.0.iter().all(|group| group.len() == a.len()),
            "values for each point"
        );
        let mut background_lanes = [T::default(); WIDTH];
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
pub(crate) struct Task<'a, T, const WIDTH: usize> {
    /// Number of the first block.
    first: usize,
    /// Their rows, group by group.
    next: Vec<&'a mut [Group<T, WIDTH>]>,
    /// Groups of each block that may become anything but zeros: bit g for group g.
    active: &'a [u8],
    /// Groups of each block that are.
    filled: &'a mut [u8],
}

/// A precision for which sweeps are compiled.
pub(crate) trait Sweep<const WIDTH: usize>: Real {
    /// Computes the active groups of the blocks of `task`.
    fn step_blocks(inputs: &Inputs<Self, WIDTH>, task: Task<Self, WIDTH>);
}

impl Sweep<WIDTH_F32> for f32 {
    fn step_blocks(inputs: &Inputs<f32, WIDTH_F32>, task: Task<f32, WIDTH_F32>) {
        step_f32(inputs, task);
    }
}

impl Sweep<WIDTH_F64> for f64 {
    fn step_blocks(inputs: &Inputs<f64, WIDTH_F64>, task: Task<f64, WIDTH_F64>) {
        step_f64(inputs, task);
    }
}

// without fused multiply-add, which is not faster here, results are the same bits on every processor
#[multiversion(targets("x86_64+avx2"))]
fn step_f32(inputs: &Inputs<f32, WIDTH_F32>, task: Task<f32, WIDTH_F32>) {
    step_all(inputs, task);
}

#[multiversion(targets("x86_64+avx2"))]
fn step_f64(inputs: &Inputs<f64, WIDTH_F64>, task: Task<f64, WIDTH_F64>) {
    step_all(inputs, task);
}

#[inline(always)]
fn step_all<T: Real, const WIDTH: usize>(inputs: &Inputs<T, WIDTH>, task: Task<T, WIDTH>) {
    let Task {
        first,
        mut next,
        active,
        filled,
    } = task;
    for (block, (&active, filled)) in active.iter().zip(filled).enumerate() {
        let start = (first + block) * BLOCK;
        let rows = block * BLOCK..next[0].len().min((block + 1) * BLOCK);
        let range = start..start + rows.len();
        let mut groups = (0..next.len()).filter(|group| active >> group & 1 == 1);
        while let Some(group) = groups.next() {
            let background = group == BACKGROUND_LANE / WIDTH;
            if let Some(other) = groups.next() {
                let [one, two] = next.get_disjoint_mut([group, other]).expect("two groups");
                let pair = [&mut one[rows.clone()], &mut two[rows.clone()]];
                if background {
                    step_pairs::<T, WIDTH, true>(inputs, [group, other], range.clone(), pair);
                } else {
                    step_pairs::<T, WIDTH, false>(inputs, [group, other], range.clone(), pair);
                }
            } else {
                let rows = &mut next[group][rows.clone()];
                if background {
                    step_rows::<T, WIDTH, true>(inputs, group, range.clone(), rows);
                } else {
                    step_rows::<T, WIDTH, false>(inputs, group, range.clone(), rows);
                }
            }
        }
        for &(i, lane, weight) in inputs.seeds.of_rows(range) {
            let (group, lane) = (lane as usize / WIDTH, lane as usize % WIDTH);
            next[group][rows.start + i as usize - start].0[lane] += inputs.step.seeds * weight;
        }
        if active & !*filled != 0 {
            for (group, values) in next.iter().enumerate() {
                *filled |= u8::from(in_use(&values[rows.clone()])) << group;
            }
        }
    }
}

fn in_use<T: Real, const WIDTH: usize>(rows: &[Group<T, WIDTH>]) -> bool {
    rows.iter().any(|row| row.0 != [T::default(); WIDTH])
}

/// Computes one group of the rows of `range`.
#[inline(always)]
fn step_rows<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    inputs: &Inputs<T, WIDTH>,
    group: usize,
    range: Range<usize>,
    rows: &mut [Group<T, WIDTH>],
) {
    let z = &inputs.z.0[group];
    let background = &inputs.seeds.background[range.clone()];
    let points = rows.iter_mut().zip(&z[range.clone()]).zip(background);
    if inputs.a.degree() == Some(PAPER_DEGREE) {
        // with a number of edges known beforehand there is no loop over them, and less to check
        let (columns, weights) = inputs.a.slices(range);
        let columns = columns.as_chunks::<PAPER_DEGREE>().0;
        let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
        for (((row, own), &background), (columns, weights)) in points.zip(edges) {
            let sum = weighted_sum(z, columns, weights);
            row.0 = finish::<T, WIDTH, BACKGROUND>(inputs, &sum, &own.0, &row.0, background);
        }
    } else {
        for (i, ((row, own), &background)) in range.zip(points) {
            let (columns, weights) = inputs.a.slices(i..i + 1);
            let sum = weighted_sum(z, columns, weights);
            row.0 = finish::<T, WIDTH, BACKGROUND>(inputs, &sum, &own.0, &row.0, background);
        }
    }
}

/// Computes two groups of the rows of `range`, which share what they read of the graph.
#[inline(always)]
fn step_pairs<T: Real, const WIDTH: usize, const BACKGROUND: bool>(
    inputs: &Inputs<T, WIDTH>,
    [one, two]: [usize; 2],
    range: Range<usize>,
    [rows_one, rows_two]: [&mut [Group<T, WIDTH>]; 2],
) {
    let (z_one, z_two) = (inputs.z.0[one].as_slice(), inputs.z.0[two].as_slice());
    if inputs.a.degree() != Some(PAPER_DEGREE) {
        step_rows::<T, WIDTH, BACKGROUND>(inputs, one, range.clone(), rows_one);
        step_rows::<T, WIDTH, false>(inputs, two, range, rows_two);
        return;
    }
    let own = z_one[range.clone()].iter().zip(&z_two[range.clone()]);
    let background = &inputs.seeds.background[range.clone()];
    let (columns, weights) = inputs.a.slices(range);
    let columns = columns.as_chunks::<PAPER_DEGREE>().0;
    let edges = columns.iter().zip(weights.as_chunks::<PAPER_DEGREE>().0);
    let points = rows_one.iter_mut().zip(rows_two).zip(own).zip(background);
    for ((((one, two), (own_one, own_two)), &background), (columns, weights)) in points.zip(edges) {
        let [sum_one, sum_two] = weighted_sums(z_one, z_two, columns, weights);
        one.0 = finish::<T, WIDTH, BACKGROUND>(inputs, &sum_one, &own_one.0, &one.0, background);
        two.0 = finish::<T, WIDTH, false>(inputs, &sum_two, &own_two.0, &two.0, background);
    }
}

/// Weighted sums of the rows of two groups that `columns` name.
#[inline(always)]
#[expect(
    unsafe_code,
    reason = "the check of every column takes a sixth of the time of a sweep"
)]
fn weighted_sums<T: Real, const WIDTH: usize>(
    one: &[Group<T, WIDTH>],
    two: &[Group<T, WIDTH>],
    columns: &[u32],
    weights: &[T],
) -> [[T; WIDTH]; 2] {
    // one row, one thread: sums keep their order, so results do too
    let mut sums = [[T::default(); WIDTH]; 2];
    for (&column, &weight) in columns.iter().zip(weights) {
        // SAFETY: a `PointGraph` has no column beyond its last row; `Inputs::new` sees to as many in each group
        let values = unsafe {
            [
                &one.get_unchecked(column as usize).0,
                &two.get_unchecked(column as usize).0,
            ]
        };
        for group in 0..2 {
            for lane in 0..WIDTH {
                sums[group][lane] += weight * values[group][lane];
            }
        }
    }
    sums
}

/// Weighted sum of the rows of `z` that `columns` name.
#[inline(always)]
#[expect(
    unsafe_code,
    reason = "the check of every column takes a sixth of the time of a sweep"
)]
fn weighted_sum<T: Real, const WIDTH: usize>(
    z: &[Group<T, WIDTH>],
    columns: &[u32],
    weights: &[T],
) -> [T; WIDTH] {
    // one row, one thread: sums keep their order, so results do too
    let mut sum = [T::default(); WIDTH];
    for (&column, &weight) in columns.iter().zip(weights) {
        // SAFETY: a `PointGraph` has no column beyond its last row, and `Inputs::new` sees to as many in `z`
        let values = unsafe { z.get_unchecked(column as usize) };
        for (sum, value) in sum.iter_mut().zip(&values.0) {
            *sum += weight * *value;
        }
    }
    sum
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
pub(crate) struct State<'a, T, const WIDTH: usize> {
    a: &'a PointGraph<T>,
    seeds: &'a LaneSeeds<T>,
    blocks: &'a Blocks,
    /// Values after the last step.
    pub(crate) z: Values<T, WIDTH>,
    /// Values before it, which the next step overwrites.
    pub(crate) previous: Values<T, WIDTH>,
    /// Groups of each block that may hold anything but zeros: bit g for group g.
    active: Vec<u8>,
    /// Groups of each block that do.
    filled: Vec<u8>,
    /// Groups of each block that do and have made active the blocks that they flow to.
    passed_on: Vec<u8>,
}

impl<'a, T: Sweep<WIDTH>, const WIDTH: usize> State<'a, T, WIDTH> {
    /// z = `scale` * s, with the probe's seeds as they are.
    pub(crate) fn new(
        a: &'a PointGraph<T>,
        seeds: &'a LaneSeeds<T>,
        blocks: &'a Blocks,
        scale: T,
    ) -> Self {
        let groups = seeds.lanes.div_ceil(WIDTH).max(1);
        let (mut z, previous) = (Values::zero(a.len(), groups), Values::zero(a.len(), groups));
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
        let active = seeds.groups(BLOCK, WIDTH);
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

    /// Number of points.
    pub(crate) fn points(&self) -> usize {
        self.a.len()
    }

    /// Lane of the probe, if there is one.
    pub(crate) fn probe(&self) -> Option<usize> {
        self.seeds.probe.as_ref().map(|(lane, _)| *lane)
    }

    /// Applies `step`; what was z becomes the previous values.
    pub(crate) fn step(&mut self, step: Step<T>) {
        let inputs = Inputs::new(self.a, self.seeds, step, &self.z);
        let states = self
            .active
            .chunks(BLOCKS_A_TASK)
            .zip(self.filled.chunks_mut(BLOCKS_A_TASK));
        let rows = BLOCK * BLOCKS_A_TASK;
        let mut groups: Vec<_> = self
            .previous
            .0
            .iter_mut()
            .map(|group| group.chunks_mut(rows))
            .collect();
        let task = |(task, (active, filled))| Task {
            first: task * BLOCKS_A_TASK,
            next: groups.iter_mut().filter_map(Iterator::next).collect(),
            active,
            filled,
        };
        let tasks: Vec<Task<T, WIDTH>> = states.enumerate().map(task).collect();
        tasks
            .into_par_iter()
            .for_each(|task| T::step_blocks(&inputs, task));
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
