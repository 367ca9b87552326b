//! The order in which the rows of a graph take their steps, and where labels flow from.
//!
//! A step of a row needs the step before it of the rows that it has edges from, and of no others. Rows go in blocks,
//! blocks in tiles. Where all values fit into the cache, all tiles take a step before any takes the next. A larger
//! cloud would be fetched from memory for every step; it is divided into regions that fit, and each takes several steps
//! at a time. Tiles at the border of a region that is still to come are left to that one, a ring of tiles more with
//! every step ("sparse tiling": Strout et al., Int. J. High Performance Computing Applications 18(1), 2004). The values
//! do not depend on it.

use super::phases;
use crate::graph::PointGraph;
use crate::memory::{filled, push, with_room, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// Fewest rows for a task of the thread pool.
pub(super) const ROWS_A_TASK: usize = 512;
/// Rows of a block.
pub(super) const BLOCK: usize = 16;
/// Rows of a tile.
const TILE: usize = 4 * BLOCK;
/// Blocks between two looks at the flag.
const BLOCKS_A_LOOK: usize = 4096;
/// Fewest blocks for a task of the thread pool.
pub(super) const BLOCKS_A_TASK: usize = ROWS_A_TASK / BLOCK;
/// Tiles of a region: some 16 MB of values and edges.
const REGION: usize = 32768 / TILE;
/// Steps that a region takes at a time.
const ROUND: usize = 12;

/// Blocks of consecutive rows, the blocks that labels flow to from each, and when each tile takes which step.
#[derive(Debug)]
pub(super) struct Schedule {
    rows: usize,
    /// Targets of block i at `target_offsets[i]..target_offsets[i + 1]`.
    target_offsets: Vec<u32>,
    targets: Vec<u32>,
    /// Steps after which the order repeats itself.
    round: usize,
    /// Region after region and step after step of a round, the tiles that take it then.
    order: Vec<u32>,
    /// Where in `order` each step of each region begins.
    offsets: Vec<usize>,
}

impl Schedule {
    pub(super) fn new<T: Real>(a: &PointGraph<T>, cancel: &Cancel) -> Result<Self> {
        Self::in_regions(a, REGION, cancel)
    }

    /// One step after the other, in which fewer and fewer rows take part: in each the first ones, as many as `rows` says of it,
    /// and the rest of their last tile, whose values then are not those of its steps.
    pub(super) fn narrowing<T: Real>(
        a: &PointGraph<T>,
        rows: impl ExactSizeIterator<Item = usize>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (target_offsets, targets) = targets(a, cancel)?;
        let (round, mut order, mut offsets) = (rows.len().max(1), Vec::new(), vec![0]);
        for rows in rows {
            (0..rows.div_ceil(TILE)).try_for_each(|tile| push(&mut order, tile as u32))?;
            offsets.push(order.len());
        }
        Ok(Self {
            rows: a.len(),
            target_offsets,
            targets,
            round,
            order,
            offsets,
        })
    }

    /// Regions of `size` tiles each.
    fn in_regions<T: Real>(a: &PointGraph<T>, size: usize, cancel: &Cancel) -> Result<Self> {
        let (target_offsets, targets) = targets(a, cancel)?;
        let mut schedule = Self {
            rows: a.len(),
            target_offsets,
            targets,
            round: 1,
            order: Vec::new(),
            offsets: Vec::new(),
        };
        let tiles = a.len().div_ceil(TILE);
        if tiles > size {
            schedule.round = ROUND;
        }
        // the region of each tile in each step: what must wait for a later region is left to that one
        let mut regions = with_room(tiles * schedule.round)?;
        regions.extend((0..tiles).map(|tile| (tile / size) as u32));
        if schedule.round > 1 {
            let edges = schedule.tile_edges(cancel)?;
            for step in 1..schedule.round {
                cancel.check()?;
                regions.extend_from_within((step - 1) * tiles..);
                let (before, after) = regions.split_at_mut(step * tiles);
                let before = &before[(step - 1) * tiles..];
                for &[a, b] in &edges {
                    let [a, b] = [a as usize, b as usize];
                    after[a] = after[a].max(before[b]);
                    after[b] = after[b].max(before[a]);
                }
            }
        }
        schedule.sort(&regions, tiles, size, cancel)?;
        Ok(schedule)
    }

    /// Sorts the tiles by region and step.
    fn sort(&mut self, regions: &[u32], tiles: usize, size: usize, cancel: &Cancel) -> Result<()> {
        let place = |at: usize| regions[at] as usize * self.round + at / tiles;
        let mut offsets = vec![0; tiles.div_ceil(size) * self.round + 1];
        (0..regions.len()).for_each(|at| offsets[place(at) + 1] += 1);
        for at in 1..offsets.len() {
            offsets[at] += offsets[at - 1];
        }
        let mut order = zeros(regions.len(), cancel)?;
        for at in 0..regions.len() {
            let next = &mut offsets[place(at)];
            order[*next] = (at % tiles) as u32;
            *next += 1;
        }
        // each place now begins where it ended
        offsets.rotate_right(1);
        offsets[0] = 0;
        (self.order, self.offsets) = (order, offsets);
        Ok(())
    }

    /// The pairs of different tiles with edges from one to the other, some of them twice.
    fn tile_edges(&self, cancel: &Cancel) -> Result<Vec<[u32; 2]>> {
        let mut edges = Vec::new();
        // at which tile each was last met
        let mut met = filled(u32::MAX, self.rows.div_ceil(TILE), cancel)?;
        for block in 0..self.blocks() {
            let tile = (block * BLOCK / TILE) as u32;
            met[tile as usize] = tile;
            for &target in self.targets(block) {
                let other = target / (TILE / BLOCK) as u32;
                if std::mem::replace(&mut met[other as usize], tile) != tile {
                    push(&mut edges, [tile, other])?;
                }
            }
        }
        Ok(edges)
    }

    /// Number of blocks.
    pub(super) fn blocks(&self) -> usize {
        self.rows.div_ceil(BLOCK)
    }

    /// The blocks other than `block` with a row that has an edge from a row of `block`.
    pub(super) fn targets(&self, block: usize) -> &[u32] {
        let [start, end] = [block, block + 1].map(|at| self.target_offsets[at] as usize);
        &self.targets[start..end]
    }

    /// Calls `work(rows, step)` for each of `steps` of every tile of rows, on all threads of the pool.
    ///
    /// At that time every tile next to it that takes part has taken the steps before, none has begun with `step` + 1, and
    /// what was written for those is visible.
    ///
    /// # Errors
    /// [`Error::Cancelled`]: some tiles have taken fewer steps then.
    pub(super) fn run(
        &self,
        steps: Range<usize>,
        cancel: &Cancel,
        work: impl Fn(Range<usize>, usize) + Sync,
    ) -> Result<()> {
        let places = self.offsets.windows(2).enumerate();
        let first = steps.start / self.round * self.round;
        let phases = (first..steps.end).step_by(self.round).flat_map(|first| {
            let steps_of_round = places.clone().map(move |(place, range)| {
                let tiles = &self.order[range[0]..range[1]];
                (first + place % self.round, tiles)
            });
            steps_of_round.filter(|(step, _)| steps.contains(step))
        });
        let count = |(_, tiles): &(usize, &[u32])| tiles.len();
        phases::run(&phases, count, cancel, |&(step, tiles), turn| {
            for &tile in &tiles[turn] {
                let start = tile as usize * TILE;
                work(start..self.rows.min(start + TILE), step);
            }
        })
    }
}

/// Offsets and targets of all blocks: the other blocks with edges from each.
fn targets<T: Real>(a: &PointGraph<T>, cancel: &Cancel) -> Result<(Vec<u32>, Vec<u32>)> {
    let count = a.len().div_ceil(BLOCK);
    // few tasks: each marks the blocks that it has met in an array of its own
    let size = count.div_ceil(4 * rayon::current_num_threads()).max(1);
    let of_task = |task: usize| {
        let (mut sources, mut ends) = (Vec::new(), with_room(size)?);
        // at which block each was last met
        let mut met = filled(u32::MAX, count, cancel)?;
        for block in task * size..count.min((task + 1) * size) {
            if block % BLOCKS_A_LOOK == 0 {
                cancel.check()?;
            }
            met[block] = block as u32;
            for &column in a.slices(block * BLOCK..a.len().min((block + 1) * BLOCK)).0 {
                let source = column / BLOCK as u32;
                if std::mem::replace(&mut met[source as usize], block as u32) != block as u32 {
                    push(&mut sources, source)?;
                }
            }
            ends.push(sources.len());
        }
        Ok((sources, ends))
    };
    let tasks = (0..count.div_ceil(size)).into_par_iter();
    let parts: Vec<(Vec<u32>, Vec<usize>)> = tasks.map(of_task).collect::<Result<_>>()?;
    // turned round
    let mut offsets: Vec<u32> = zeros(count + 1, cancel)?;
    for (sources, _) in &parts {
        cancel.check()?;
        for &source in sources {
            offsets[source as usize + 1] += 1;
        }
    }
    for block in 0..count {
        offsets[block + 1] += offsets[block];
    }
    let mut targets = zeros(offsets[count] as usize, cancel)?;
    let mut block = 0;
    for (sources, ends) in &parts {
        cancel.check()?;
        let mut start = 0;
        for &end in ends {
            for &source in &sources[start..end] {
                let next = &mut offsets[source as usize];
                targets[*next as usize] = block;
                *next += 1;
            }
            (start, block) = (end, block + 1);
        }
    }
    // each block's now begin where they ended
    offsets.rotate_right(1);
    offsets[0] = 0;
    Ok((offsets, targets))
}

/// The groups of lanes of each block that hold anything but zeros; bit g of a block stands for group g.
///
/// Labels spread from the seeds by one edge a step, so at first most groups of most blocks are zero and are left out,
/// at no loss. Once set, a bit stays.
#[derive(Debug)]
pub(super) struct Activity<'a> {
    schedule: &'a Schedule,
    filled: Vec<AtomicU8>,
    /// The same of each block and of those that labels flow from to it.
    active: Vec<AtomicU8>,
}

impl<'a> Activity<'a> {
    /// Of each block those groups that are `seeded`.
    pub(super) fn new(schedule: &'a Schedule, seeded: &[u8]) -> Self {
        let activity = Self {
            schedule,
            filled: seeded.iter().map(|_| AtomicU8::new(0)).collect(),
            active: seeded.iter().copied().map(AtomicU8::new).collect(),
        };
        let blocks = seeded.par_iter().enumerate().with_min_len(BLOCKS_A_TASK);
        blocks.for_each(|(block, &groups)| activity.fill(block, groups));
        activity
    }

    /// Groups of `block` that a step may fill: those filled in it or in a block that labels flow from.
    pub(super) fn active(&self, block: usize) -> u8 {
        // threads may see values of a step that they are not in yet, and so compute zeros in vain, but no wrong ones
        self.active[block].load(Relaxed)
    }

    /// Groups of `block` that hold values.
    pub(super) fn filled(&self, block: usize) -> u8 {
        self.filled[block].load(Relaxed)
    }

    /// Notes that `groups` of `block` hold values.
    pub(super) fn fill(&self, block: usize, groups: u8) {
        if groups != 0 {
            self.filled[block].fetch_or(groups, Relaxed);
            for &target in self.schedule.targets(block) {
                self.active[target as usize].fetch_or(groups, Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::PointGraph;
    use proptest::prelude::*;
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

    /// A graph in which each row has edges from itself and from the two rows `reaches` away from it.
    fn graph(rows: usize, reaches: &[usize]) -> PointGraph {
        let columns = (0..rows).flat_map(|i| {
            let reach = reaches[i % reaches.len()];
            [i, (i + reach) % rows, (i + rows - reach % rows) % rows].map(|j| j as u32)
        });
        let offsets = (0..=rows).map(|i| 3 * i).collect();
        PointGraph::from_csr(offsets, columns.collect(), vec![0.25; 3 * rows]).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn every_tile_takes_every_step_once_all_next_to_it_are_ready(
            rows in 1_usize..6000,
            reaches in proptest::collection::vec(prop_oneof![0_usize..80, 0_usize..6000], 1..40),
            region in 1_usize..20,
            [before, steps] in [0_usize..20, 0_usize..30],
        ) {
            let schedule = Schedule::in_regions(&graph(rows, &reaches), region, Cancel::never()).unwrap();
            let count = rows.div_ceil(TILE);
            let edges = schedule.tile_edges(Cancel::never()).unwrap();
            let taken: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
            let violations = AtomicUsize::new(0);
            schedule.run(before..before + steps, Cancel::never(), |rows, step| {
                let (tile, step) = (rows.start / TILE, step - before);
                let of_tile = edges.iter().filter(|edge| edge.contains(&(tile as u32)));
                let ready = of_tile.flatten().all(|&other| {
                    // this step at most: it may be about to take it, or have taken it
                    [step, step + 1].contains(&taken[other as usize].load(SeqCst))
                });
                if !ready || taken[tile].fetch_add(1, SeqCst) != step {
                    violations.fetch_add(1, SeqCst);
                }
            }).unwrap();
            prop_assert_eq!(violations.into_inner(), 0);
            prop_assert!(taken.into_iter().all(|taken| taken.into_inner() == steps));
        }
    }

    #[test]
    fn a_large_cloud_is_divided_and_most_of_a_region_takes_all_steps_of_a_round_at_once() {
        let rows = 4 * REGION * TILE;
        let schedule = Schedule::new(&graph(rows, &[1]), Cancel::never()).unwrap();
        assert_eq!(
            (schedule.round, schedule.offsets.len() - 1),
            (ROUND, 4 * ROUND)
        );
        let last = schedule.offsets.windows(2).nth(ROUND - 1).unwrap();
        assert!(last[1] - last[0] > REGION / 2);
    }
}
