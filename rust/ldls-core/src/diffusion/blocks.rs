//! Blocks of consecutive rows of a graph, and from which other blocks values flow to each.

use crate::graph::PointGraph;
use crate::{Memory, Real};
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a block.
pub(crate) const BLOCK: usize = 16;

/// The blocks of a graph: from which of them values flow to each.
#[derive(Debug)]
pub(crate) struct Blocks {
    rows: usize,
    offsets: Vec<u32>,
    sources: Vec<u32>,
}

impl Blocks {
    pub(crate) fn new<T: Real>(a: &PointGraph<T>, memory: &mut Memory) -> Self {
        let count = a.len().div_ceil(BLOCK);
        // few tasks: each marks the blocks that it has met in an array of its own
        let size = count.div_ceil(4 * rayon::current_num_threads()).max(1);
        let tasks = count.div_ceil(size);
        let mut parts: Vec<Sources> = memory.as_left(tasks);
        let blocks = |task: usize| task * size..count.min((task + 1) * size);
        let of_task = |(task, part): (usize, &mut Sources)| part.find(a, count, blocks(task));
        parts[..tasks].par_iter_mut().enumerate().for_each(of_task);
        let entries = parts[..tasks].iter().map(|part| part.blocks.len()).sum();
        let (mut sources, mut offsets) = (memory.empty(entries), memory.empty(count + 1));
        offsets.push(0);
        for part in &parts[..tasks] {
            let start = sources.len() as u32;
            offsets.extend(part.ends.iter().map(|end| start + end));
            sources.extend_from_slice(&part.blocks);
        }
        memory.keep_as_is(parts);
        Self {
            rows: a.len(),
            offsets,
            sources,
        }
    }

    /// Keeps the vectors, which are no longer needed.
    pub(crate) fn keep_in(self, memory: &mut Memory) {
        memory.keep(self.offsets);
        memory.keep(self.sources);
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Number of blocks.
    pub(crate) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The blocks other than `block` with a row that a row of `block` has an edge from.
    #[inline(always)]
    pub(crate) fn sources(&self, block: usize) -> &[u32] {
        &self.sources[self.offsets[block] as usize..self.offsets[block + 1] as usize]
    }
}

/// The sources of some consecutive blocks, block after block.
#[derive(Debug, Default)]
struct Sources {
    blocks: Vec<u32>,
    /// Where those of each block end.
    ends: Vec<u32>,
    /// At which block each was last met.
    met: Vec<u32>,
}

impl Sources {
    /// Finds those of `blocks`, of which there are `count`.
    fn find<T: Real>(&mut self, a: &PointGraph<T>, count: usize, blocks: Range<usize>) {
        let Self {
            blocks: found,
            ends,
            met,
        } = self;
        [&mut *found, ends, met].into_iter().for_each(Vec::clear);
        met.resize(count, u32::MAX);
        for block in blocks {
            met[block] = block as u32;
            for &column in a.slices(block * BLOCK..a.len().min((block + 1) * BLOCK)).0 {
                let source = column / BLOCK as u32;
                if std::mem::replace(&mut met[source as usize], block as u32) != block as u32 {
                    found.push(source);
                }
            }
            ends.push(found.len() as u32);
        }
    }
}
