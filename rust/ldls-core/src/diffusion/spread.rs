//! Where labels spread to from their seeds, one edge a step.

use super::schedule::{BLOCK, targets};
use crate::graph::PointGraph;
use crate::memory::{push, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;

/// Labels that are followed together: one bit each.
const TOGETHER: usize = u8::BITS as usize;
/// Fewest shares of the labels for each thread, since some spread farther than others.
const SHARES_A_THREAD: usize = 2;

/// Some of the blocks of rows of a graph.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Blocks(Vec<u64>);

impl Blocks {
    /// None of `count`.
    pub(super) fn none(count: usize) -> Self {
        Self(vec![0; count.div_ceil(64)])
    }

    /// All of `count`.
    pub(super) fn all(count: usize) -> Self {
        let mut all = Self::none(count);
        (0..count).for_each(|block| all.insert(block));
        all
    }

    fn insert(&mut self, block: usize) {
        self.0[block / 64] |= 1 << (block % 64);
    }

    pub(super) fn add(&mut self, others: &Self) {
        for (word, other) in self.0.iter_mut().zip(&others.0) {
            *word |= other;
        }
    }

    pub(super) fn is_disjoint(&self, others: &Self) -> bool {
        let mut words = self.0.iter().zip(&others.0);
        words.all(|(word, other)| word & other == 0)
    }

    /// How many of `others` are not among them.
    pub(super) fn lacks(&self, others: &Self) -> usize {
        let words = self.0.iter().zip(&others.0);
        let lacking = words.map(|(word, other)| (other & !word).count_ones() as usize);
        lacking.sum()
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = usize> {
        let words = self.0.iter().enumerate();
        words.flat_map(|(at, word)| {
            let bits = (0..64).filter(move |bit| word >> bit & 1 == 1);
            bits.map(move |bit| 64 * at + bit)
        })
    }
}

/// The blocks with a row that each label reaches in at most so many steps from the rows of its `seeds`.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub(super) fn spread<T: Real>(
    a: &PointGraph<T>,
    seeds: &[Vec<u32>],
    steps: usize,
    cancel: &Cancel,
) -> Result<Vec<Blocks>> {
    let t0 = std::time::Instant::now();
    let flow = targets(a, 1, cancel)?;
    if std::env::var_os("SHOW").is_some() { eprintln!("turned {:?}", t0.elapsed()); }
    let shares = SHARES_A_THREAD * rayon::current_num_threads();
    let size = seeds.len().div_ceil(shares).clamp(1, TOGETHER);
    let shares = seeds.par_chunks(size);
    let reached = shares.map(|seeds| spread_together(&flow, seeds, steps, cancel));
    Ok(reached.collect::<Result<Vec<_>>>()?.concat())
}

/// The same of labels that are followed together, where row after row has its targets.
fn spread_together(
    (offsets, targets): &(Vec<u32>, Vec<u32>),
    seeds: &[Vec<u32>],
    steps: usize,
    cancel: &Cancel,
) -> Result<Vec<Blocks>> {
    let rows = offsets.len() - 1;
    // the labels that have come to each row, and rows with those that came in the last step
    let mut come: Vec<u8> = zeros(rows, cancel)?;
    let (mut fresh, mut next) = (Vec::new(), Vec::new());
    for (label, of_label) in seeds.iter().enumerate() {
        for &row in of_label {
            come[row as usize] |= 1 << label;
            push(&mut fresh, (row, 1_u8 << label))?;
        }
    }
    for _ in 0..steps {
        cancel.check()?;
        if fresh.is_empty() {
            break;
        }
        for (row, labels) in fresh.drain(..) {
            let [start, end] = [row, row + 1].map(|at| offsets[at as usize] as usize);
            for &target in &targets[start..end] {
                let new = labels & !come[target as usize];
                if new != 0 {
                    come[target as usize] |= new;
                    push(&mut next, (target, new))?;
                }
            }
        }
        std::mem::swap(&mut fresh, &mut next);
    }
    let mut reached = vec![Blocks::none(rows.div_ceil(BLOCK)); seeds.len()];
    for (block, come) in come.chunks(BLOCK).enumerate() {
        let labels = come.iter().fold(0, |labels, come| labels | come);
        for (label, reached) in reached.iter_mut().enumerate() {
            if labels >> label & 1 == 1 {
                reached.insert(block);
            }
        }
    }
    Ok(reached)
}
