//! The seeds of the labels that share a pass over the graph, by the lane of each label.

use super::plan::{BACKGROUND_LANE, Plan};
use super::schedule::{BLOCK, ROWS_A_TASK};
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate, with_room, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;

/// The seeds of the labels of one pass by lane.
#[derive(Debug)]
pub(super) struct Seeds<T> {
    /// The lanes of the labels.
    pub(super) plan: Plan,
    /// Seeds of the background, which nearly every row has; zeros where it is in another pass.
    pub(super) background: Vec<T>,
    /// Seeds of the probe, where the pass has it.
    pub(super) probe: Vec<T>,
    /// Row within its block and lane of each other seed, block after block.
    places: Vec<[u8; 2]>,
    /// Their weights.
    weights: Vec<T>,
    /// Where those of each block begin.
    offsets: Vec<u32>,
    /// Values up to this magnitude are too small to matter.
    pub(super) least: T,
}

impl<T: Real> Seeds<T> {
    /// The seeds in `b` of the labels of `plan`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(b: &PixelLabels<T>, plan: Plan, cancel: &Cancel) -> Result<Self> {
        let n_labels = plan.lanes.iter().map(|&(label, _)| label as usize + 1);
        let mut lane_of = vec![None; n_labels.max().unwrap_or(0)];
        for &(label, lane) in plan.lanes.iter().filter(|(label, _)| *label > 0) {
            lane_of[label as usize] = Some(lane as u8);
        }
        let background = |i: usize| {
            let weight = b.row(i).find(|&(label, _)| label == 0);
            weight.map_or(T::default(), |(_, weight)| weight)
        };
        let background = if plan.lanes.contains(&(0, BACKGROUND_LANE)) {
            tabulate(b.rows(), background, cancel)?
        } else {
            zeros(b.rows(), cancel)?
        };
        let signed = |(label, weight): (usize, T)| T::from_f64(random_sign(label)) * weight;
        let probe = if plan.probe.is_some() {
            tabulate(b.rows(), |i| b.row(i).map(signed).sum(), cancel)?
        } else {
            Vec::new()
        };
        let of_task = |task: usize| {
            cancel.check()?;
            let rows = task * ROWS_A_TASK..b.rows().min((task + 1) * ROWS_A_TASK);
            let (mut places, mut weights, mut ends) = (Vec::new(), Vec::new(), Vec::new());
            for i in rows.clone() {
                for (label, weight) in b.row(i) {
                    if let Some(lane) = lane_of.get(label).copied().flatten() {
                        push(&mut places, [(i % BLOCK) as u8, lane])?;
                        push(&mut weights, weight)?;
                    }
                }
                if (i + 1) % BLOCK == 0 || i + 1 == rows.end {
                    ends.push(places.len() as u32);
                }
            }
            Ok((places, weights, ends))
        };
        let tasks = (0..b.rows().div_ceil(ROWS_A_TASK)).into_par_iter();
        let parts = tasks.map(of_task).collect::<Result<Vec<_>>>()?;
        let count = parts.iter().map(|(places, ..)| places.len()).sum();
        let (mut places, mut weights) = (with_room(count)?, with_room(count)?);
        let mut offsets = with_room(b.rows().div_ceil(BLOCK) + 1)?;
        offsets.push(0);
        for (of_places, of_weights, ends) in parts {
            let before = places.len() as u32;
            offsets.extend(ends.iter().map(|end| before + end));
            places.extend(of_places);
            weights.extend(of_weights);
        }
        let all = b.weights.par_iter().with_min_len(ROWS_A_TASK);
        let largest = all.map(|weight| weight.to_f64()).reduce(|| 0.0, f64::max);
        Ok(Self {
            plan,
            background,
            probe,
            places,
            weights,
            offsets,
            least: T::from_f64(T::NEGLIGIBLE * largest),
        })
    }

    /// For each block of rows, bit g where lanes of group g have seeds.
    pub(super) fn groups(&self, cancel: &Cancel) -> Result<Vec<u8>> {
        let width = self.plan.width;
        let probed = self.plan.probe.map_or(0, |lane| 1 << (lane / width));
        let background = self.background.par_iter().with_min_len(ROWS_A_TASK);
        let full = background.any(|&weight| weight > T::default());
        let everywhere = probed | u8::from(full) << (BACKGROUND_LANE / width);
        let of_block = |block: usize| {
            let lanes = self.of_block(block).map(|(_, lane, _)| lane);
            lanes.fold(everywhere, |bits, lane| bits | 1 << (lane / width))
        };
        tabulate(self.offsets.len() - 1, of_block, cancel)
    }

    /// Row within the block, lane and weight of each seed of `block`, but for the background's and the probe's.
    #[inline(always)]
    pub(super) fn of_block(&self, block: usize) -> impl Iterator<Item = (usize, usize, T)> {
        let own = self.offsets[block] as usize..self.offsets[block + 1] as usize;
        let places = self.places[own.clone()].iter().zip(&self.weights[own]);
        places.map(|(&[row, lane], &weight)| (row.into(), lane.into(), weight))
    }
}

/// Plus or minus one, without a pattern.
fn random_sign(label: usize) -> f64 {
    // the multiplier of Knuth's multiplicative hash
    let hash = (label as u32).wrapping_add(1).wrapping_mul(2_654_435_769);
    if hash & 0x8000 == 0 { 1.0 } else { -1.0 }
}
