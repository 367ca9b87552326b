//! Blocks of consecutive rows of a graph, and from which other blocks values flow to each.

use crate::Real;
use crate::graph::PointGraph;
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
    pub(crate) fn new<T: Real>(a: &PointGraph<T>) -> Self {
        let count = a.len().div_ceil(BLOCK);
        // few tasks: each marks the blocks that it has met in an array of its own
        let size = count.div_ceil(4 * rayon::current_num_threads()).max(1);
        let tasks = count.div_ceil(size);
        let blocks = |task: usize| task * size..count.min((task + 1) * size);
        let parts: Vec<Sources> = (0..tasks)
            .into_par_iter()
            .map(|task| Sources::of(a, count, blocks(task)))
            .collect();
        let entries = parts.iter().map(|part| part.blocks.len()).sum();
        let (mut sources, mut offsets) =
            (Vec::with_capacity(entries), Vec::with_capacity(count + 1));
        offsets.push(0);
        for part in &parts {
            let start = sources.len() as u32;
            offsets.extend(part.ends.iter().map(|end| start + end));
            sources.extend_from_slice(&part.blocks);
        }
        Self {
            rows: a.len(),
            offsets,
            sources,
        }
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
struct Sources {
    blocks: Vec<u32>,
    /// Where those of each block end.
    ends: Vec<u32>,
}

impl Sources {
    /// The sources of `blocks`; the graph has `count` of them.
    fn of<T: Real>(a: &PointGraph<T>, count: usize, blocks: Range<usize>) -> Self {
        let mut sources = Self {
            blocks: Vec::new(),
            ends: Vec::with_capacity(blocks.len()),
        };
        // at which block each was last met
        let mut met = vec![u32::MAX; count];
        for block in blocks {
            met[block] = block as u32;
            for &column in a.slices(block * BLOCK..a.len().min((block + 1) * BLOCK)).0 {
                let source = column / BLOCK as u32;
                if std::mem::replace(&mut met[source as usize], block as u32) != block as u32 {
                    sources.blocks.push(source);
                }
            }
            sources.ends.push(sources.blocks.len() as u32);
        }
        sources
    }
}
