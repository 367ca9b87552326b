//! In which order tiles of rows take their steps.
//!
//! A step of a row needs the step before it of the rows that it has edges from, and of no others. Where all values fit
//! into the cache, all tiles take a step before any takes the next. A larger cloud would be fetched from memory for
//! every step; it is divided into regions that fit, and each takes several steps at a time. Tiles at the border of a
//! region that is still to come are left to that one, a ring of tiles more with every step ("sparse tiling": Strout
//! et al., Int. J. High Performance Computing Applications 18(1), 2004). What is computed does not depend on it.

use super::blocks::{BLOCK, Blocks};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a tile.
const TILE: usize = 4 * BLOCK;
/// Fewest tiles for a task of the thread pool.
const TILES_A_TASK: usize = 4;
/// Tiles of a region: some 16 MB of values and edges.
const REGION: usize = 32768 / TILE;
/// Steps that a region takes at a time.
const ROUND: usize = 12;

/// Tiles of consecutive rows, and when each takes which step.
#[derive(Debug)]
pub(crate) struct Tiles {
    rows: usize,
    /// Steps after which the order repeats itself.
    round: usize,
    /// Region after region and step after step of a round, the tiles that take it then.
    order: Vec<u32>,
    /// Where in `order` each step of each region begins.
    offsets: Vec<usize>,
}

impl Tiles {
    pub(crate) fn new(blocks: &Blocks) -> Self {
        Self::in_regions(blocks, REGION)
    }

    /// Regions of `size` tiles each.
    fn in_regions(blocks: &Blocks, size: usize) -> Self {
        let tiles = blocks.rows().div_ceil(TILE);
        let round = if tiles <= size { 1 } else { ROUND };
        // the region of each tile in each step: what must wait for a later region is left to that one
        let mut regions = Vec::with_capacity(tiles * round);
        regions.extend((0..tiles).map(|tile| (tile / size) as u32));
        if round > 1 {
            let edges = edges(blocks);
            for step in 1..round {
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
        // sorted by region and step
        let place = |at: usize| regions[at] as usize * round + at / tiles;
        let mut offsets = vec![0; tiles.div_ceil(size) * round + 1];
        (0..regions.len()).for_each(|at| offsets[place(at) + 1] += 1);
        for at in 1..offsets.len() {
            offsets[at] += offsets[at - 1];
        }
        let mut order = vec![0; regions.len()];
        for at in 0..regions.len() {
            let next = &mut offsets[place(at)];
            order[*next] = (at % tiles) as u32;
            *next += 1;
        }
        // each place now begins where it ended
        offsets.rotate_right(1);
        offsets[0] = 0;
        Self {
            rows: blocks.rows(),
            round,
            order,
            offsets,
        }
    }

    /// Calls `work(rows, step)` for steps 0 to `steps` - 1 of every tile of rows, on all threads of the pool.
    ///
    /// At that time every tile next to it has taken steps 0 to `step` - 1, none has begun with `step` + 1, and what
    /// was written for those is visible.
    pub(crate) fn run(&self, steps: usize, work: impl Fn(Range<usize>, usize) + Sync) {
        for first in (0..steps).step_by(self.round) {
            for (place, range) in self.offsets.windows(2).enumerate() {
                let step = first + place % self.round;
                if step < steps {
                    let tiles = &self.order[range[0]..range[1]];
                    tiles
                        .par_iter()
                        .with_min_len(TILES_A_TASK)
                        .for_each(|&tile| {
                            let start = tile as usize * TILE;
                            work(start..self.rows.min(start + TILE), step);
                        });
                }
            }
        }
    }
}

/// The pairs of different tiles with edges from one to the other, some of them twice.
fn edges(blocks: &Blocks) -> Vec<[u32; 2]> {
    let mut edges = Vec::with_capacity(0);
    // at which tile each was last met
    let mut met = vec![u32::MAX; blocks.rows().div_ceil(TILE)];
    for block in 0..blocks.len() {
        let tile = (block * BLOCK / TILE) as u32;
        met[tile as usize] = tile;
        for &source in blocks.sources(block) {
            let other = source / (TILE / BLOCK) as u32;
            if std::mem::replace(&mut met[other as usize], tile) != tile {
                edges.push([tile, other]);
            }
        }
    }
    edges
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
            steps in 0_usize..30,
        ) {
            let blocks = Blocks::new(&graph(rows, &reaches));
            let count = rows.div_ceil(TILE);
            let edges = edges(&blocks);
            let taken: Vec<AtomicUsize> = (0..count).map(|_| AtomicUsize::new(0)).collect();
            let violations = AtomicUsize::new(0);
            Tiles::in_regions(&blocks, region).run(steps, |rows, step| {
                let tile = rows.start / TILE;
                let of_tile = edges.iter().filter(|edge| edge.contains(&(tile as u32)));
                let ready = of_tile.flatten().all(|&other| {
                    // this step at most: it may be about to take it, or have taken it
                    [step, step + 1].contains(&taken[other as usize].load(SeqCst))
                });
                if !ready || taken[tile].fetch_add(1, SeqCst) != step {
                    violations.fetch_add(1, SeqCst);
                }
            });
            prop_assert_eq!(violations.into_inner(), 0);
            prop_assert!(taken.into_iter().all(|taken| taken.into_inner() == steps));
        }
    }

    #[test]
    fn a_large_cloud_is_divided_and_most_of_a_region_takes_all_steps_of_a_round_at_once() {
        let rows = 4 * REGION * TILE;
        let blocks = Blocks::new(&graph(rows, &[1]));
        let tiles = Tiles::new(&blocks);
        assert_eq!((tiles.round, tiles.offsets.len() - 1), (ROUND, 4 * ROUND));
        let last = tiles.offsets.windows(2).nth(ROUND - 1).unwrap();
        assert!(last[1] - last[0] > REGION / 2);
    }
}
