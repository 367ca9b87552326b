//! The seeds of the labels that share a pass over the graph, by the lane of each label.

use super::schedule::{BLOCK, ROWS_A_TASK};
use crate::masks::PixelLabels;
use crate::memory::{collect, push, tabulate, with_room, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::ops::Range;

/// Most groups of a pass: one bit each says which of them are in use.
pub(super) const MOST_GROUPS: usize = 8;
/// Points from which on a pass has a single group: each takes 64 bytes a point.
const MANY_POINTS: usize = 1 << 20;
/// Lane of the background in the pass that has it.
pub(super) const BACKGROUND_LANE: usize = 0;

/// The label of each lane of each pass over the graph; `None` is the lane of the probe.
///
/// The probe is all labels with random signs, of which only the last term of the series is summed: it shows how large
/// the terms left out may be. Labels without a seed need no lane. The first group, which the background keeps busy
/// everywhere, takes the labels with the most seeds; the others follow in the order of where they lie, so that the
/// labels of a group are neighbours and the group is zero over most of the cloud.
pub(super) fn plan<T: Real>(
    b: &PixelLabels<T>,
    labels: &[u32],
    width: usize,
    probe: bool,
) -> Vec<Vec<Option<u32>>> {
    let (counts, row_sums) = count_seeds(b, labels);
    let count = |label: &u32| counts[*label as usize];
    // rows are in the order of the tree: near rows are near points
    let middle = |label: &u32| row_sums[*label as usize] / count(label);
    let seeded = |label: &u32| *label > 0 && count(label) > 0;
    let mut rest: Vec<u32> = labels.iter().copied().filter(seeded).collect();
    rest.sort_by_key(|label| Reverse(count(label)));
    let background = labels.contains(&0).then_some(Some(0));
    let mut lanes: Vec<Option<u32>> = background
        .into_iter()
        .chain(probe.then_some(None))
        .collect();
    if !lanes.is_empty() {
        let first = (width - lanes.len()).min(rest.len());
        lanes.extend(rest.drain(..first).map(Some));
    }
    rest.sort_by_key(|label| (middle(label), *label));
    lanes.extend(rest.into_iter().map(Some));
    let most_groups = if b.rows() < MANY_POINTS {
        MOST_GROUPS
    } else {
        1
    };
    let passes = lanes.chunks(width * most_groups);
    passes.map(<[_]>::to_vec).collect()
}

/// Number of the seeds of each label up to the highest of `labels`, and the sum of their rows.
fn count_seeds<T: Real>(b: &PixelLabels<T>, labels: &[u32]) -> (Vec<u64>, Vec<u64>) {
    let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
    let (mut counts, mut row_sums) = (vec![0; n_labels], vec![0; n_labels]);
    for i in 0..b.rows() {
        for (label, _) in b.row(i).filter(|&(label, _)| label < n_labels) {
            counts[label] += 1;
            row_sums[label] += i as u64;
        }
    }
    (counts, row_sums)
}

/// The seeds of the labels of one pass by lane, row after row.
#[derive(Debug)]
pub(super) struct Seeds<T> {
    /// Label of each lane; `None` is the probe.
    pub(super) lanes: Vec<Option<u32>>,
    /// Seeds of the background, which nearly every row has; zeros where it is in another pass.
    pub(super) background: Vec<T>,
    /// Seeds of the probe, where the pass has it.
    pub(super) probe: Vec<T>,
    /// Row, lane and weight of each other seed; those of row i at `offsets[i]..offsets[i + 1]`.
    entries: Vec<(u32, u32, T)>,
    offsets: Vec<u32>,
    /// Values up to this magnitude are too small to matter.
    pub(super) least: T,
}

impl<T: Real> Seeds<T> {
    pub(super) fn new(
        b: &PixelLabels<T>,
        lanes: Vec<Option<u32>>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let n_labels = b.labels.iter().max().map_or(0, |&label| label as usize + 1);
        let mut lane_of = vec![None; n_labels];
        for (lane, label) in lanes.iter().enumerate() {
            if let Some(of_label) = label.and_then(|label| lane_of.get_mut(label as usize)) {
                *of_label = Some(lane as u32);
            }
        }
        let background = |i: usize| {
            let weight = b.row(i).find(|&(label, _)| label == 0);
            weight.map_or(T::default(), |(_, weight)| weight)
        };
        let background = match lanes[..] {
            [Some(0), ..] => tabulate(b.rows(), background, cancel)?,
            _ => zeros(b.rows(), cancel)?,
        };
        let signed = |(label, weight): (usize, T)| T::from_f64(random_sign(label)) * weight;
        let probe = if lanes.contains(&None) {
            tabulate(b.rows(), |i| b.row(i).map(signed).sum(), cancel)?
        } else {
            Vec::new()
        };
        let (mut entries, mut offsets) = (Vec::new(), with_room(b.rows() + 1)?);
        offsets.push(0);
        for i in 0..b.rows() {
            if i % ROWS_A_TASK == 0 {
                cancel.check()?;
            }
            for (label, weight) in b.row(i).filter(|&(label, _)| label > 0) {
                if let Some(lane) = lane_of[label] {
                    push(&mut entries, (i as u32, lane, weight))?;
                }
            }
            offsets.push(entries.len() as u32);
        }
        let weights = b.weights.par_iter().with_min_len(ROWS_A_TASK);
        let largest = weights
            .map(|weight| weight.to_f64())
            .reduce(|| 0.0, f64::max);
        Ok(Self {
            lanes,
            background,
            probe,
            entries,
            offsets,
            least: T::from_f64(T::NEGLIGIBLE * largest),
        })
    }

    /// Label and lane of the lanes that have a label.
    pub(super) fn labels(&self) -> impl Iterator<Item = (u32, usize)> {
        let lanes = self.lanes.iter().enumerate();
        lanes.filter_map(|(lane, label)| Some(((*label)?, lane)))
    }

    /// Lane of the probe, where the pass has it.
    pub(super) fn probe_lane(&self) -> Option<usize> {
        self.lanes.iter().position(Option::is_none)
    }

    /// For each block of rows, bit g where lanes of group g have seeds.
    pub(super) fn groups(&self, width: usize, cancel: &Cancel) -> Result<Vec<u8>> {
        let rows = self.background.len();
        let probed = self.probe_lane().map_or(0, |lane| 1 << (lane / width));
        let full = self.background.iter().any(|&weight| weight > T::default());
        let everywhere = probed | u8::from(full) << (BACKGROUND_LANE / width);
        let of_block = |first: usize| {
            let seeds = self.of_rows(first..rows.min(first + BLOCK)).iter();
            seeds.fold(everywhere, |bits, (_, lane, _)| {
                bits | 1 << (*lane as usize / width)
            })
        };
        collect((0..rows).step_by(BLOCK).map(of_block), cancel)
    }

    /// Row, lane and weight of each seed of `rows`, but for the background's and the probe's.
    #[inline(always)]
    pub(super) fn of_rows(&self, rows: Range<usize>) -> &[(u32, u32, T)] {
        &self.entries[self.offsets[rows.start] as usize..self.offsets[rows.end] as usize]
    }
}

/// Plus or minus one, without a pattern.
fn random_sign(label: usize) -> f64 {
    // the multiplier of Knuth's multiplicative hash
    let hash = (label as u32).wrapping_add(1).wrapping_mul(2_654_435_769);
    if hash & 0x8000 == 0 { 1.0 } else { -1.0 }
}
