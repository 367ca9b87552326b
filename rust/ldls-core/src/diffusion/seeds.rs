//! The seeds of the labels that share a pass over the graph, by the lane of each label.
//!
//! They are added in every step. In most blocks nearly all rows have one seed, and in the same lanes: that of the background far
//! from all masks, that of a mask within it, or of several. These are added with the other terms; the rest one by one.

use super::lanes::Lanes;
use super::plan::{BACKGROUND_LANE, PROBE_LANES, Plan};
use super::schedule::{BLOCK, ROWS_A_TASK};
use crate::bits::ones;
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate, with_room, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What divides a circle by the golden ratio: pi (3 - sqrt 5).
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Distances from the middle between which the factors lie that the probe has for labels, and that of the background.
const RING: [f64; 2] = [0.6, 1.4];
const OF_BACKGROUND: f64 = 2.0;
/// By how much the factors of one seed are aside from those of its label: what a sum over many labels cancels of, it does not of these.
const ASIDE: f64 = 0.15;
/// Ways in which they may be.
const WAYS: usize = 1 << WAYS_BITS;
const WAYS_BITS: u32 = 4;

/// The seeds of the labels of one pass by lane.
#[derive(Debug)]
pub(super) struct Seeds<T> {
    /// The lanes of the labels.
    pub(super) plan: Plan,
    /// Of each block the lanes in which most rows have their largest seed, a bit each.
    pub(super) common: Vec<u64>,
    /// Of each row the seed that it has in all of these; zero where there is no such.
    pub(super) in_common: Vec<T>,
    others: Others<T>,
    /// Seeds of the probe, where the pass has it.
    pub(super) probe: Vec<[T; PROBE_LANES]>,
    /// The largest seed of all labels.
    pub(super) largest: f64,
    /// Values up to this magnitude are too small to matter.
    pub(super) least: T,
}

/// The seeds that rows do not have in common lanes, block after block.
#[derive(Debug)]
struct Others<T> {
    /// Row within its block and lane of each.
    places: Vec<[u8; 2]>,
    weights: Vec<T>,
    /// Where those of each block end.
    ends: Vec<u32>,
}

impl<T: Real> Seeds<T> {
    /// The seeds in `b` of the labels of `plan`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(b: &PixelLabels<T>, plan: Plan, cancel: &Cancel) -> Result<Self> {
        let n_labels = plan.lanes.iter().map(|&(label, _)| label as usize + 1);
        let mut lane_of = vec![None; n_labels.max().unwrap_or(0)];
        for &(label, lane) in &plan.lanes {
            lane_of[label as usize] = Some(lane as u8);
        }
        let of_labels = |row: usize| {
            let seeds = b.row(row);
            seeds.filter_map(|(label, weight)| Some(((*lane_of.get(label)?)?, weight)))
        };
        let of_row = |row: usize| {
            let sum = || of_labels(row).map(|(_, seed)| seed).sum();
            let of_sum = plan.sum.map(|lane| (lane as u8, sum()));
            of_labels(row).chain(of_sum.filter(|(_, sum)| *sum > T::default()))
        };
        let mut common = zeros(b.rows().div_ceil(BLOCK), cancel)?;
        let mut in_common = zeros(b.rows(), cancel)?;
        let of_task = |(task, (common, in_common)): (usize, (&mut [u64], &mut [T]))| {
            cancel.check()?;
            let mut others = Others::with_room(0, common.len())?;
            let blocks = common.iter_mut().zip(in_common.chunks_mut(BLOCK));
            for ((common, in_common), first) in blocks.zip((task * ROWS_A_TASK..).step_by(BLOCK)) {
                let rows = first..first + in_common.len();
                let mut largest = [Largest::default(); BLOCK];
                let largest = &mut largest[..rows.len()];
                let of_rows = largest.iter_mut().zip(rows.clone());
                of_rows.for_each(|(largest, row)| *largest = Largest::of(of_row(row)));
                *common = most_common(largest);
                for ((at, seed), largest) in in_common.iter_mut().enumerate().zip(largest) {
                    if largest.lanes == *common && largest.are_all {
                        *seed = largest.seed;
                        continue;
                    }
                    *seed = seed_in_all(*common, of_row(first + at));
                    for (lane, weight) in of_row(first + at) {
                        if *common >> lane & 1 == 0 || weight != *seed {
                            others.push([at as u8, lane], weight)?;
                        }
                    }
                }
                others.ends.push(others.places.len() as u32);
            }
            Ok(others)
        };
        let tasks = common.par_chunks_mut(ROWS_A_TASK / BLOCK);
        let tasks = tasks.zip(in_common.par_chunks_mut(ROWS_A_TASK)).enumerate();
        let others = Others::concat(tasks.map(of_task).collect::<Result<_>>()?)?;
        let probe = if plan.probe.is_some() {
            let labels = b.labels.par_iter().max();
            let factors: Vec<[T; PROBE_LANES]> =
                factors(labels.map_or(0, |&label| label as usize + 1));
            let asides = asides();
            let of_row = |row: usize| {
                let sum = [T::default(); PROBE_LANES];
                b.row(row).fold(sum, |[x, y], (label, seed)| {
                    let ([own_x, own_y], aside) = (factors[label], way_of(row, label));
                    let [aside_x, aside_y]: [T; PROBE_LANES] = asides[aside];
                    [x + (own_x + aside_x) * seed, y + (own_y + aside_y) * seed]
                })
            };
            tabulate(b.rows(), of_row, cancel)?
        } else {
            Vec::new()
        };
        let all = b.weights.par_iter().with_min_len(ROWS_A_TASK);
        let largest = all.map(|weight| weight.to_f64()).reduce(|| 0.0, f64::max);
        Ok(Self {
            plan,
            common,
            in_common,
            others,
            probe,
            largest,
            least: T::from_f64(T::NEGLIGIBLE * largest),
        })
    }

    /// For each block of rows, bit g where lanes of group g have seeds.
    pub(super) fn groups(&self, cancel: &Cancel) -> Result<Vec<u8>> {
        let width = self.plan.width;
        // what is nearly everywhere counts as everywhere
        let background = self.plan.lanes.contains(&(0, BACKGROUND_LANE));
        let everywhere = background.then_some(BACKGROUND_LANE);
        let everywhere = everywhere.into_iter().chain(self.plan.beside_labels());
        let everywhere = everywhere.fold(0, |lanes, lane| lanes | 1 << lane);
        let of_block = |block: usize| {
            let common = everywhere | self.common[block];
            let lanes = self
                .others(block)
                .fold(common, |lanes, (_, lane, _)| lanes | 1 << lane);
            ones(lanes).fold(0, |groups, lane| groups | 1 << (lane / width))
        };
        tabulate(self.common.len(), of_block, cancel)
    }

    /// Puts those of `group` times `scale`, but for the probe's, to the `values` of some rows, the first of which is `first`, that of
    /// a block.
    pub(super) fn put<const WIDTH: usize>(
        &self,
        group: usize,
        first: usize,
        values: &mut [Lanes<T, WIDTH>],
        scale: T,
    ) {
        let lane_of = |lane: usize| (lane / WIDTH == group).then_some(lane % WIDTH);
        for (block, values) in (first / BLOCK..).zip(values.chunks_mut(BLOCK)) {
            for lane in ones(self.common[block]).filter_map(lane_of) {
                let values = values.iter_mut().zip(&self.in_common[block * BLOCK..]);
                values.for_each(|(value, &seed)| value[lane] = scale * seed);
            }
            for (row, lane, weight) in self.others(block) {
                if let Some(lane) = lane_of(lane) {
                    values[row][lane] = scale * weight;
                }
            }
        }
    }

    /// Puts those of the probe times `scale` to the `values` of its group at some rows, the first of which is `first`.
    pub(super) fn put_probe<const WIDTH: usize>(
        &self,
        first: usize,
        values: &mut [Lanes<T, WIDTH>],
        scale: T,
    ) {
        for (at, lane) in self.plan.probe_lanes().enumerate() {
            let values = values.iter_mut().zip(&self.probe[first..]);
            values.for_each(|(value, seeds)| value[lane] = scale * seeds[at]);
        }
    }

    /// Row within the block, lane and weight of each seed of `block` that is not in common lanes, but for the probe's.
    #[inline(always)]
    pub(super) fn others(&self, block: usize) -> impl Iterator<Item = (usize, usize, T)> {
        self.others.of_block(block)
    }
}

impl<T: Real> Others<T> {
    /// None yet, and room for so many of so many blocks.
    fn with_room(seeds: usize, blocks: usize) -> Result<Self> {
        Ok(Self {
            places: with_room(seeds)?,
            weights: with_room(seeds)?,
            ends: with_room(blocks)?,
        })
    }

    fn push(&mut self, place: [u8; 2], weight: T) -> Result<()> {
        push(&mut self.places, place)?;
        push(&mut self.weights, weight)
    }

    fn concat(parts: Vec<Self>) -> Result<Self> {
        let sum = |len: fn(&Self) -> usize| parts.iter().map(len).sum();
        let mut all = Self::with_room(sum(|part| part.places.len()), sum(|part| part.ends.len()))?;
        for part in parts {
            let before = all.places.len() as u32;
            all.ends.extend(part.ends.iter().map(|end| before + end));
            all.places.extend(part.places);
            all.weights.extend(part.weights);
        }
        Ok(all)
    }

    #[inline(always)]
    fn of_block(&self, block: usize) -> impl Iterator<Item = (usize, usize, T)> {
        let start = if block == 0 { 0 } else { self.ends[block - 1] };
        let own = start as usize..self.ends[block] as usize;
        let places = self.places[own.clone()].iter().zip(&self.weights[own]);
        places.map(|(&[row, lane], &weight)| (row.into(), lane.into(), weight))
    }
}

/// The largest seed of a row.
#[derive(Debug, Clone, Copy, Default)]
struct Largest<T> {
    seed: T,
    /// The lanes that have it, a bit each.
    lanes: u64,
    /// Whether no other lane has a seed.
    are_all: bool,
}

impl<T: Real> Largest<T> {
    fn of(seeds: impl Iterator<Item = (u8, T)>) -> Self {
        let (mut seed, mut lanes, mut all) = (T::default(), 0_u64, 0_u64);
        for (lane, weight) in seeds {
            if weight > seed {
                (seed, lanes) = (weight, 0);
            }
            lanes |= u64::from(weight == seed) << lane;
            all |= 1 << lane;
        }
        Self {
            seed,
            lanes,
            are_all: lanes == all,
        }
    }
}

/// The most common lanes of some rows, of as common ones the first.
fn most_common<T>(rows: &[Largest<T>]) -> u64 {
    let (mut best, mut most) = (0, 0);
    for (at, row) in rows.iter().enumerate() {
        if most == 0 || row.lanes != best {
            let same = rows[at..].iter().filter(|other| other.lanes == row.lanes);
            let count = same.count();
            if count > most {
                (best, most) = (row.lanes, count);
            }
        }
    }
    best
}

/// The seed that a row of these `seeds` has in all of the `common` lanes; zero where there is no such.
fn seed_in_all<T: Real>(common: u64, seeds: impl Iterator<Item = (u8, T)>) -> T {
    let mut seeds = seeds.filter(|(lane, _)| common >> lane & 1 == 1);
    let Some((_, first)) = seeds.next() else {
        return T::default();
    };
    let others = seeds.filter(|(_, weight)| *weight == first).count() as u32;
    if 1 + others == common.count_ones() {
        first
    } else {
        T::default()
    }
}

/// The factors with which the probe has so many labels: places in a plane, so that what one lacks and what the one beside it has
/// too much of does not cancel. They are spread evenly over a ring, no two near one another, those of labels one after the other far
/// apart, and that of the background, which all objects are beside, far from all.
fn factors<T: Real>(labels: usize) -> Vec<[T; PROBE_LANES]> {
    let [inner, outer] = RING.map(|radius| radius * radius);
    let place = |label: usize| {
        let share = label as f64 / labels as f64;
        let radius = if label == 0 {
            OF_BACKGROUND
        } else {
            (inner + share * (outer - inner)).sqrt()
        };
        on_circle(radius, GOLDEN_ANGLE * label as f64)
    };
    (0..labels).map(place).collect()
}

/// What the factors of a seed may be aside by.
fn asides<T: Real>() -> [[T; PROBE_LANES]; WAYS] {
    std::array::from_fn(|way| on_circle(ASIDE, way as f64 * TAU / WAYS as f64))
}

/// The way of the seed of a label at a row: no pattern of rows or labels is one of ways.
#[inline]
fn way_of(row: usize, label: usize) -> usize {
    let mixed = (row as u32).wrapping_mul(0x9e37_79b1) ^ (label as u32).wrapping_mul(0x85eb_ca6b);
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d);
    (mixed >> (u32::BITS - WAYS_BITS)) as usize
}

fn on_circle<T: Real>(radius: f64, angle: f64) -> [T; PROBE_LANES] {
    let (sine, cosine) = angle.sin_cos();
    [cosine, sine].map(|part| T::from_f64(radius * part))
}

#[cfg(test)]
mod tests {
    use super::super::plan::Planner;
    use super::super::schedule::Schedule;
    use super::*;
    use crate::graph::PointGraph;
    use proptest::prelude::*;

    fn largest(seeds: &[(u8, f32)]) -> Largest<f32> {
        Largest::of(seeds.iter().copied())
    }

    #[test]
    fn lanes_with_the_largest_seed_are_common_where_most_rows_have_it_there() {
        let of_background = largest(&[(0, 0.5)]);
        let of_two = largest(&[(0, 0.125), (3, 0.5), (9, 0.5)]);
        assert_eq!((of_background.lanes, of_background.are_all), (1, true));
        assert_eq!((of_two.lanes, of_two.are_all), (1 << 3 | 1 << 9, false));
        let rows = [of_background, of_two, of_two, of_background, of_two];
        assert_eq!(most_common(&rows), of_two.lanes);
        assert_eq!(most_common(&rows[..2]), of_background.lanes);
    }

    #[test]
    fn in_the_probe_no_two_labels_are_near_and_the_background_is_far_from_all() {
        for (labels, least) in [(12, 0.45), (37, 0.28), (500, 0.07)] {
            let factors = factors::<f64>(labels);
            let apart = |one: usize, other: usize| {
                let [one, other] = [factors[one], factors[other]];
                (one[0] - other[0]).hypot(one[1] - other[1])
            };
            for label in 1..labels {
                assert!(apart(0, label) > 0.59, "{label} of {labels}");
                let nearest = (1..label).map(|other| apart(label, other));
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                assert!(nearest > least, "{label} of {labels}: {nearest}");
                if label > 1 {
                    assert!(apart(label, label - 1) > 1.1, "{label} of {labels}");
                }
            }
        }
    }

    #[test]
    fn factors_of_seeds_are_aside_in_all_ways_alike() {
        let mut counts = [0; WAYS];
        for row in 0..500 {
            (1..30).for_each(|label| counts[way_of(row, label)] += 1);
        }
        let expected = 500 * 29 / WAYS as i32;
        assert!(
            counts.iter().all(|count| (count - expected).abs() < 150),
            "{counts:?}"
        );
        let sum = asides::<f64>()
            .iter()
            .fold([0.0; 2], |sum, way| [sum[0] + way[0], sum[1] + way[1]]);
        assert!(sum.iter().all(|part: &f64| part.abs() < 1e-15));
    }

    proptest! {
        #[test]
        fn what_is_common_and_what_is_not_are_all_seeds(
            rows in proptest::collection::vec(
                proptest::collection::btree_map(0_u32..20, 1_u8..3, 0..4),
                1..70,
            ),
        ) {
            let ends = rows.iter().scan(0, |end, row| {
                *end += row.len();
                Some(*end)
            });
            let b = PixelLabels {
                offsets: [0].into_iter().chain(ends).collect(),
                labels: rows.iter().flat_map(|row| row.keys().copied()).collect(),
                weights: rows.iter().flat_map(|row| row.values().map(|&w| f32::from(w))).collect(),
                mass: vec![0.0; rows.len()],
            };
            let n = rows.len() as u32;
            let a = PointGraph::from_csr((0..=rows.len()).collect(), (0..n).collect(), vec![0.5; rows.len()]);
            let (a, never) = (a.unwrap(), Cancel::never());
            let schedule = Schedule::new(&a, never).unwrap();
            let planner = Planner { schedule: &schedule, width: 8, probe: false, sum: false, steps: 1 };
            let labels: Vec<u32> = (0..20).collect();
            let plan = planner.plan((&a, &b), &labels, never).unwrap().remove(0);
            let seeds = Seeds::new(&b, plan, never).unwrap();
            let mut expected = vec![vec![0.0; 8 * seeds.plan.groups]; rows.len()];
            for &(label, lane) in &seeds.plan.lanes {
                for (expected, row) in expected.iter_mut().zip(&rows) {
                    expected[lane] = row.get(&label).map_or(0.0, |&weight| f32::from(weight));
                }
            }
            let mut put = vec![vec![0.0; 8 * seeds.plan.groups]; rows.len()];
            for group in 0..seeds.plan.groups {
                let mut values = vec![bytemuck::Zeroable::zeroed(); rows.len()];
                seeds.put::<8>(group, 0, &mut values, 0.5);
                for (put, values) in put.iter_mut().zip(&values) {
                    put[8 * group..][..8].copy_from_slice(&values[..]);
                }
            }
            let half = expected.iter().map(|row| row.iter().map(|weight| 0.5 * weight).collect());
            prop_assert_eq!(put, half.collect::<Vec<Vec<f32>>>());
            // as a step adds them
            let mut added = vec![vec![0.0; 8 * seeds.plan.groups]; rows.len()];
            for (row, added) in added.iter_mut().enumerate() {
                for lane in ones(seeds.common[row / BLOCK]) {
                    added[lane] += seeds.in_common[row];
                }
                for (_, lane, weight) in seeds.others(row / BLOCK).filter(|other| other.0 == row % BLOCK) {
                    added[lane] += weight;
                }
            }
            prop_assert_eq!(added, expected);
        }
    }
}
