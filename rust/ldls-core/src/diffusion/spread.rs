//! Where labels come to, one edge farther with every step: from their seeds, or from where other labels have larger ones.

use super::schedule::{BLOCK, BLOCKS_A_TASK, Schedule};
use crate::bits::ones;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::iter::repeat;
use std::mem::take;
use std::ops::Range;

/// Labels that are followed together: one bit each.
pub(super) const TOGETHER: usize = u64::BITS as usize;

/// Steps in which labels fill what is small, and stop there.
const STEPS_TO_SETTLE: usize = 4;
/// Steps in which labels come nearly as far as in any number of them, which are sooner taken where their order does not matter.
const MANY_STEPS: usize = 32;

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
/// would cost too much to say: where after [`STEPS_TO_SETTLE`] some go on in more than the share `most_awake` of all blocks, or
/// before in twice as many.
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
        let bits = bits_of(labels.iter().zip(0..));
        let seeded = |row: usize| {
            let bits = b.row(row).filter_map(|(label, _)| bits.get(label));
            bits.fold(0, |all, bit| all | bit)
        };
        let mut spread = Spread::new(a, schedule, seeded, cancel)?;
        if !spread.take_steps(steps, most_awake, cancel)? {
            return Ok(None);
        }
        spread.blocks(labels.len(), cancel).map(Some)
    };
    let shares = labels.par_chunks(TOGETHER).map(of_labels);
    let shares = shares.collect::<Result<Option<Vec<_>>>>()?;
    Ok(shares.map(|shares| shares.concat()))
}

/// Of each row of `a` those of up to [`TOGETHER`] labels, a bit each, of which one of their `rivals` is ahead by a seed in `b` that
/// comes there in at most so many `steps`, or in any number where they are [`MANY_STEPS`] and more.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub(super) fn behind<T: Real>(
    (a, b): (&PointGraph<T>, &PixelLabels<T>),
    schedule: &Schedule,
    rivals: &[(u32, Vec<u32>)],
    steps: usize,
    cancel: &Cancel,
) -> Result<Vec<u64>> {
    let own = bits_of(rivals.iter().map(|(label, _)| label).zip(0..));
    let places = rivals.iter().zip(0..);
    let of_rivals =
        bits_of(places.flat_map(|((_, rivals), place)| rivals.iter().zip(repeat(place))));
    let bits = |bits: &[u64], label: usize| bits.get(label).copied().unwrap_or(0);
    let smaller = |row: usize| {
        let as_large = |least: T| {
            let seeds = b.row(row).filter(|(_, seed)| *seed >= least);
            seeds.fold(0, |all, (label, _)| all | bits(&own, label))
        };
        let larger = |one: T, (_, seed)| if seed > one { seed } else { one };
        let largest = b.row(row).fold(T::default(), larger);
        // in most rows all have the largest
        let first = as_large(largest);
        b.row(row).fold(0, |behind, (label, seed)| {
            let open = bits(&of_rivals, label) & !(first | behind);
            if open == 0 || seed <= T::default() {
                return behind;
            }
            behind | open & !as_large(seed)
        })
    };
    let mut spread = Spread::new(a, schedule, smaller, cancel)?;
    if steps < MANY_STEPS {
        // in however many blocks they go on
        spread.take_steps(steps, 1.0, cancel)?;
    } else {
        spread.take_all_steps(cancel)?;
    }
    Ok(spread.come)
}

/// The bits of each label up to the highest: one at each of its `places`.
fn bits_of<'a>(places: impl Iterator<Item = (&'a u32, usize)>) -> Vec<u64> {
    let mut bits = Vec::new();
    for (&label, place) in places {
        let label = label as usize;
        bits.resize(bits.len().max(label + 1), 0);
        bits[label] |= 1_u64 << place;
    }
    bits
}

/// How far some labels have come, a bit for each of them.
struct Spread<'a, T> {
    a: &'a PointGraph<T>,
    schedule: &'a Schedule,
    /// Those that have come to each row.
    come: Vec<u64>,
    /// Those that have come to all rows of each block.
    full: Vec<u64>,
    /// Those that may come to each block next.
    near: Vec<u64>,
    /// The blocks that any may come to next.
    awake: Vec<u32>,
}

impl<'a, T: Real> Spread<'a, T> {
    /// The labels `of_row` at each row.
    fn new(
        a: &'a PointGraph<T>,
        schedule: &'a Schedule,
        of_row: impl Fn(usize) -> u64 + Sync,
        cancel: &Cancel,
    ) -> Result<Self> {
        let blocks = schedule.blocks();
        let mut spread = Self {
            a,
            schedule,
            come: tabulate(a.len(), of_row, cancel)?,
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

    fn come_to_all(&self, block: usize) -> u64 {
        let rows = self.come[self.rows(block)].iter();
        rows.fold(u64::MAX, |all, come| all & come)
    }

    /// Notes that `labels` have come to rows of `block`, so that they may come to those that these have edges to next.
    fn wake(&mut self, block: usize, labels: u64) -> Result<()> {
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

    /// Takes so many steps, or as many as lead anywhere; false if after [`STEPS_TO_SETTLE`] some go on in more than the share
    /// `most_awake` of all blocks, or before in twice as many.
    fn take_steps(&mut self, steps: usize, most_awake: f64, cancel: &Cancel) -> Result<bool> {
        for step in 0..steps {
            cancel.check()?;
            let awake = self.awake.len() as f64 / self.schedule.blocks() as f64;
            let most_awake = if step < STEPS_TO_SETTLE {
                2.0 * most_awake
            } else {
                most_awake
            };
            if step <= STEPS_TO_SETTLE && awake > most_awake {
                return Ok(false);
            }
            if !self.advance()? {
                break;
            }
        }
        Ok(true)
    }

    /// Takes steps until none leads anywhere, those of a row after those of the rows before it.
    fn take_all_steps(&mut self, cancel: &Cancel) -> Result<()> {
        let blocks = self.schedule.blocks();
        let mut upwards = true;
        while !self.awake.is_empty() {
            cancel.check()?;
            self.awake.clear();
            for at in 0..blocks {
                // labels come through many blocks at once that way, so in turn the other way
                self.advance_block(if upwards { at } else { blocks - 1 - at })?;
            }
            upwards = !upwards;
        }
        Ok(())
    }

    /// Takes a step of each row of `block`, one after the other.
    fn advance_block(&mut self, block: usize) -> Result<()> {
        let (near, mut new) = (take(&mut self.near[block]), 0);
        if near != 0 {
            for row in self.rows(block) {
                let labels = self.coming(row, near);
                self.come[row] |= labels;
                new |= labels;
            }
        }
        if new != 0 {
            self.full[block] = self.come_to_all(block);
            self.wake(block, new)?;
        }
        Ok(())
    }

    /// Takes a step; false if it led nowhere.
    fn advance(&mut self) -> Result<bool> {
        let awake = take(&mut self.awake);
        let new = awake.par_chunks(BLOCKS_A_TASK);
        let new = new.map(|blocks| self.come_next(blocks));
        let new: Vec<(usize, u64)> = new.collect::<Result<Vec<_>>>()?.concat();
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
    fn come_next(&self, blocks: &[u32]) -> Result<Vec<(usize, u64)>> {
        let mut new = Vec::new();
        for &block in blocks {
            for row in self.rows(block as usize) {
                let labels = self.coming(row, self.near[block as usize]);
                if labels != 0 {
                    push(&mut new, (row, labels))?;
                }
            }
        }
        Ok(new)
    }

    /// Those of the labels that are `near` which come to a row in the next step.
    #[inline]
    fn coming(&self, row: usize, near: u64) -> u64 {
        let missing = near & !self.come[row];
        if missing == 0 {
            return 0;
        }
        let from = self.a.row(row).map(|(column, _)| self.come[column]);
        missing & from.fold(0, |any, come| any | come)
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
    use crate::test_support::{one_seed_each, seeds_by_point};
    use proptest::prelude::*;

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
        assert!(followed(100, &[0, 50], (STEPS_TO_SETTLE, 0.29)).is_some());
        assert!(followed(100, &[0, 50], (STEPS_TO_SETTLE, 0.1)).is_none());
    }

    #[test]
    fn they_come_everywhere_in_the_end_and_more_are_followed_than_there_are_bits() {
        let seeds: Vec<usize> = (0..2 * TOGETHER + 3).map(|label| 3 * label).collect();
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

    /// The graph of points to each of which others flow.
    fn graph(flows: &[Vec<u32>]) -> PointGraph {
        let offsets = (0..=flows.len()).map(|i| flows[..i].iter().map(Vec::len).sum());
        let columns = flows.concat();
        let weights = vec![0.25; columns.len()];
        PointGraph::from_csr(offsets.collect(), columns, weights).unwrap()
    }

    proptest! {
        #[test]
        fn a_label_is_behind_where_a_rival_has_a_larger_seed_within_so_many_edges(
            rows in proptest::collection::vec((proptest::collection::vec(0..60_u32, 0..3), 0..16_u32), 60),
            steps in prop_oneof![0..8_usize, Just(MANY_STEPS)],
        ) {
            let flows: Vec<Vec<u32>> = rows.iter().map(|(from, _)| from.clone()).collect();
            let a = graph(&flows);
            // labels 0 to 3 have a seed, a larger one or none; few points have any
            let kinds: [&[(u32, f64)]; 5] = [
                &[(1, 0.5)], &[(1, 0.5), (3, 0.5)], &[(0, 0.25), (3, 0.5)], &[(0, 0.5), (1, 0.5), (2, 0.25), (3, 0.5)], &[],
            ];
            let kind = |&(_, kind): &(Vec<u32>, u32)| kinds[(kind as usize).min(4)];
            let seeds: Vec<&[(u32, f64)]> = rows.iter().map(kind).collect();
            let b = seeds_by_point(rows.len(), &seeds);
            let rivals = [(0, vec![1, 2]), (1, vec![3, 3]), (2, vec![0, 3])];
            let smaller = |seeds: &&[(u32, f64)]| {
                let seed = |label| seeds.iter().find(|(other, _)| *other == label).map_or(0.0, |(_, seed)| *seed);
                let is_behind = |(label, rivals): &(u32, Vec<u32>)| rivals.iter().any(|rival| seed(*rival) > seed(*label));
                let bits = rivals.iter().enumerate().filter(|(_, of_label)| is_behind(of_label));
                bits.fold(0_u64, |all, (bit, _)| all | 1 << bit)
            };
            let mut expected: Vec<u64> = seeds.iter().map(smaller).collect();
            for _ in 0..if steps < MANY_STEPS { steps } else { rows.len() } {
                let before = expected.clone();
                for (all, from) in expected.iter_mut().zip(&flows) {
                    *all |= from.iter().fold(0, |all, from| all | before[*from as usize]);
                }
            }
            let schedule = Schedule::new(&a, Cancel::never()).unwrap();
            let found = behind((&a, &b), &schedule, &rivals, steps, Cancel::never());
            prop_assert_eq!(found.unwrap(), expected);
        }
    }
}
