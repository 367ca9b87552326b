//! Where labels come to from their seeds, one edge farther with every step.

use super::schedule::{BLOCK, BLOCKS_A_TASK, Schedule};
use crate::bits::ones;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::mem::take;
use std::ops::Range;

/// Labels that are followed together: one bit each.
const TOGETHER: usize = u32::BITS as usize;

/// Steps in which labels fill what is small, and stop there.
const STEPS_TO_SETTLE: usize = 4;

/// Some of the blocks of rows of a graph.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Blocks(Vec<u64>);

impl Blocks {
    pub(super) fn add(&mut self, others: &Self) {
        self.0.resize(others.0.len(), 0);
        let words = self.0.iter_mut().zip(&others.0);
        words.for_each(|(word, other)| *word |= other);
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// True if some block is among both.
    pub(super) fn meet(&self, others: &Self) -> bool {
        let mut words = self.0.iter().zip(&others.0);
        words.any(|(word, other)| word & other != 0)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = usize> {
        let words = self.0.iter().enumerate();
        words.flat_map(|(at, word)| ones(*word).map(move |bit| 64 * at + bit))
    }
}

/// The blocks with a row that each of `labels` reaches in at most so many steps over `a` from its seeds in `b`. None where it
/// would cost too much to say: where after [`STEPS_TO_SETTLE`] some go on in more than the share `most_awake` of all blocks.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub(super) fn spread<T: Real>(
    (a, b): (&PointGraph<T>, &PixelLabels<T>),
    schedule: &Schedule,
    labels: &[u32],
    (steps, most_awake): (usize, f64),
    cancel: &Cancel,
) -> Result<Option<Vec<Blocks>>> {
    let of_labels = |labels: &[u32]| {
        let mut spread = Spread::new((a, b), schedule, labels, cancel)?;
        for step in 0..steps {
            cancel.check()?;
            let awake = spread.awake.len() as f64 / schedule.blocks() as f64;
            if step == STEPS_TO_SETTLE && awake > most_awake {
                return Ok(None);
            }
            if !spread.advance()? {
                break;
            }
        }
        spread.blocks(labels.len(), cancel).map(Some)
    };
    let shares = labels.par_chunks(TOGETHER).map(of_labels);
    let shares = shares.collect::<Result<Option<Vec<_>>>>()?;
    Ok(shares.map(|shares| shares.concat()))
}

/// How far some labels have come, a bit for each of them.
struct Spread<'a, T> {
    a: &'a PointGraph<T>,
    schedule: &'a Schedule,
    /// Those that have come to each row.
    come: Vec<u32>,
    /// Those that have come to all rows of each block.
    full: Vec<u32>,
    /// Those that may come to each block next.
    near: Vec<u32>,
    /// The blocks that any may come to next.
    awake: Vec<u32>,
}

impl<'a, T: Real> Spread<'a, T> {
    /// The `labels` at their seeds.
    fn new(
        (a, b): (&'a PointGraph<T>, &PixelLabels<T>),
        schedule: &'a Schedule,
        labels: &[u32],
        cancel: &Cancel,
    ) -> Result<Self> {
        let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
        let mut bits = vec![0; n_labels];
        for (bit, &label) in labels.iter().enumerate() {
            bits[label as usize] = 1_u32 << bit;
        }
        let of_row = |row: usize| {
            let bits = b.row(row).filter_map(|(label, _)| bits.get(label));
            bits.fold(0, |all, bit| all | bit)
        };
        let blocks = schedule.blocks();
        let mut spread = Self {
            a,
            schedule,
            come: tabulate(b.rows(), of_row, cancel)?,
            full: Vec::new(),
            near: zeros(blocks, cancel)?,
            awake: Vec::new(),
        };
        spread.full = tabulate(blocks, |block| spread.come_to_all(block), cancel)?;
        for block in 0..blocks {
            let rows = spread.come[spread.rows(block)].iter();
            spread.wake(block, rows.fold(0, |any, come| any | come))?;
        }
        Ok(spread)
    }

    fn rows(&self, block: usize) -> Range<usize> {
        block * BLOCK..self.come.len().min((block + 1) * BLOCK)
    }

    fn come_to_all(&self, block: usize) -> u32 {
        let rows = self.come[self.rows(block)].iter();
        rows.fold(u32::MAX, |all, come| all & come)
    }

    /// Notes that `labels` have come to rows of `block`, so that they may come to those that these have edges to next.
    fn wake(&mut self, block: usize, labels: u32) -> Result<()> {
        for &target in self.schedule.targets(block).iter().chain([&(block as u32)]) {
            let near = labels & !self.full[target as usize];
            if near != 0 {
                if self.near[target as usize] == 0 {
                    push(&mut self.awake, target)?;
                }
                self.near[target as usize] |= near;
            }
        }
        Ok(())
    }

    /// Takes a step; false if it led nowhere.
    fn advance(&mut self) -> Result<bool> {
        let awake = take(&mut self.awake);
        let new = awake.par_chunks(BLOCKS_A_TASK);
        let new = new.map(|blocks| self.come_next(blocks));
        let new: Vec<(usize, u32)> = new.collect::<Result<Vec<_>>>()?.concat();
        for block in awake {
            self.near[block as usize] = 0;
        }
        for &(row, labels) in &new {
            self.come[row] |= labels;
        }
        for rows in new.chunk_by(|one, other| one.0 / BLOCK == other.0 / BLOCK) {
            let block = rows[0].0 / BLOCK;
            self.full[block] = self.come_to_all(block);
            self.wake(block, rows.iter().fold(0, |any, (_, labels)| any | labels))?;
        }
        Ok(!new.is_empty())
    }

    /// Rows of `blocks` that labels come to in the next step, and which.
    fn come_next(&self, blocks: &[u32]) -> Result<Vec<(usize, u32)>> {
        let mut new = Vec::new();
        for &block in blocks {
            for row in self.rows(block as usize) {
                let missing = self.near[block as usize] & !self.come[row];
                if missing != 0 {
                    let from = self.a.row(row).map(|(column, _)| self.come[column]);
                    let labels = missing & from.fold(0, |any, come| any | come);
                    if labels != 0 {
                        push(&mut new, (row, labels))?;
                    }
                }
            }
        }
        Ok(new)
    }

    /// The blocks that each of so many labels has come to.
    fn blocks(&self, labels: usize, cancel: &Cancel) -> Result<Vec<Blocks>> {
        let mut blocks = vec![Blocks::default(); labels];
        for of_label in &mut blocks {
            of_label.0 = zeros(self.schedule.blocks().div_ceil(64), cancel)?;
        }
        for (block, rows) in self.come.chunks(BLOCK).enumerate() {
            for label in ones(rows.iter().fold(0, |any, come| any | come)) {
                blocks[label].0[block / 64] |= 1 << (block % 64);
            }
        }
        Ok(blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::one_seed_each;

    /// The blocks that labels come to in a ring of points with edges from the one before each, where each label has one seed.
    fn followed(points: u32, seeds: &[usize], steps: (usize, f64)) -> Option<Vec<Vec<usize>>> {
        let columns = (0..points).map(|i| (i + points - 1) % points).collect();
        let offsets = (0..=points as usize).collect();
        let a = PointGraph::<f32>::from_csr(offsets, columns, vec![0.5; points as usize]).unwrap();
        let b = one_seed_each(points as usize, seeds);
        let labels: Vec<u32> = (0..seeds.len() as u32).collect();
        let schedule = Schedule::new(&a, Cancel::never()).unwrap();
        let come = spread((&a, &b), &schedule, &labels, steps, Cancel::never()).unwrap()?;
        Some(come.iter().map(|blocks| blocks.iter().collect()).collect())
    }

    fn blocks(points: u32, seeds: &[usize], steps: usize) -> Vec<Vec<usize>> {
        followed(points, seeds, (steps, 1.0)).unwrap()
    }

    #[test]
    fn labels_come_one_edge_farther_with_every_step() {
        let last = BLOCK - 1;
        assert_eq!(blocks(100, &[last, 0], 0), [[0], [0]]);
        assert_eq!(blocks(100, &[last, 0], 1), [vec![0, 1], vec![0]]);
        assert_eq!(blocks(100, &[last, 0], BLOCK), [[0, 1], [0, 1]]);
        assert_eq!(
            blocks(100, &[last, 0], BLOCK + 1),
            [vec![0, 1, 2], vec![0, 1]]
        );
    }

    #[test]
    fn labels_that_go_on_in_too_many_blocks_are_not_followed() {
        // each of two goes on in two blocks of seven at most
        assert!(followed(100, &[0, 50], (9, 0.6)).is_some());
        assert!(followed(100, &[0, 50], (9, 0.2)).is_none());
        assert!(followed(100, &[0, 50], (STEPS_TO_SETTLE, 0.2)).is_some());
    }

    #[test]
    fn they_come_everywhere_in_the_end_and_more_are_followed_than_there_are_bits() {
        let seeds: Vec<usize> = (0..2 * TOGETHER + 3).map(|label| 7 * label).collect();
        let everywhere: Vec<usize> = (0..500_usize.div_ceil(BLOCK)).collect();
        let come = blocks(500, &seeds, usize::MAX);
        assert_eq!(come.len(), seeds.len());
        assert!(come.iter().all(|blocks| *blocks == everywhere));
    }

    #[test]
    fn blocks_meet_where_both_have_one() {
        let [one, other, all] = [Blocks(vec![1, 2]), Blocks(vec![2, 1]), Blocks(vec![0, 3])];
        assert!(!one.meet(&other) && one.meet(&all) && other.meet(&all));
        let mut both = Blocks::default();
        both.add(&one);
        both.add(&other);
        assert_eq!(both.iter().collect::<Vec<_>>(), [0, 1, 64, 65]);
    }
}
