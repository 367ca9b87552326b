//! Which groups of lanes of which blocks of rows hold anything but zeros.
//!
//! Values spread from the seeds by one edge a step, so at first most groups of most blocks are zero; those are left
//! out, at no loss.

use super::blocks::Blocks;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// Bit g of a block stands for group g. Once set, a bit stays.
#[derive(Debug)]
pub(crate) struct Activity<'a> {
    blocks: &'a Blocks,
    /// Groups that hold values.
    filled: Vec<AtomicU8>,
    /// All groups.
    all: u8,
}

impl<'a> Activity<'a> {
    /// Where the groups of each block that are `seeded`, of so many, hold values.
    pub(crate) fn new(blocks: &'a Blocks, seeded: Vec<u8>, groups: usize) -> Self {
        Self {
            blocks,
            filled: seeded.into_iter().map(AtomicU8::new).collect(),
            all: u8::MAX >> (u8::BITS as usize - groups),
        }
    }

    /// Groups of `block` that a step may fill: those filled in it or in a block that values flow from.
    #[inline(always)]
    pub(crate) fn active(&self, block: usize) -> u8 {
        let mut active = self.filled(block);
        for &source in self.blocks.sources(block) {
            if active == self.all {
                break;
            }
            active |= self.filled(source as usize);
        }
        active
    }

    /// Groups of `block` that hold values.
    #[inline(always)]
    pub(crate) fn filled(&self, block: usize) -> u8 {
        // threads may see values of a step that they are not in yet, and so compute zeros in vain, but no wrong ones
        self.filled[block].load(Relaxed)
    }

    /// Notes that `groups` of `block` hold values.
    #[inline(always)]
    pub(crate) fn fill(&self, block: usize, groups: u8) {
        self.filled[block].fetch_or(groups, Relaxed);
    }
}
