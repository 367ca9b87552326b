//! The seeds of the labels that share a pass over the graph, by the lane of each label.

use super::plan::{BACKGROUND_LANE, Plan};
use super::schedule::{BLOCK, ROWS_A_TASK};
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate, with_room, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;
use std::ops::Range;

/// The seeds of the labels of one pass by lane, row after row.
#[derive(Debug)]
pub(super) struct Seeds<T> {
    pub(super) plan: Plan,
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
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(b: &PixelLabels<T>, plan: Plan, cancel: &Cancel) -> Result<Self> {
        let n_labels = plan.lanes.iter().map(|&(label, _)| label as usize + 1);
        let mut lane_of = vec![None; n_labels.max().unwrap_or(0)];
        for &(label, lane) in plan.lanes.iter().filter(|(label, _)| *label > 0) {
            lane_of[label as usize] = Some(lane as u32);
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
            let (mut entries, mut ends) = (Vec::new(), with_room(rows.len())?);
            for i in rows {
                for (label, weight) in b.row(i) {
                    if let Some(lane) = lane_of.get(label).copied().flatten() {
                        push(&mut entries, (i as u32, lane, weight))?;
                    }
                }
                ends.push(entries.len() as u32);
            }
            Ok((entries, ends))
        };
        let tasks = (0..b.rows().div_ceil(ROWS_A_TASK)).into_par_iter();
        let parts = tasks.map(of_task).collect::<Result<Vec<_>>>()?;
        let mut entries = with_room(parts.iter().map(|(entries, _)| entries.len()).sum())?;
        let mut offsets = with_room(b.rows() + 1)?;
        offsets.push(0);
        for (own, ends) in parts {
            let before = entries.len() as u32;
            offsets.extend(ends.iter().map(|end| before + end));
            entries.extend(own);
        }
        let weights = b.weights.par_iter().with_min_len(ROWS_A_TASK);
        let largest = weights
            .map(|weight| weight.to_f64())
            .reduce(|| 0.0, f64::max);
        Ok(Self {
            plan,
            background,
            probe,
            entries,
            offsets,
            least: T::from_f64(T::NEGLIGIBLE * largest),
        })
    }

    /// For each block of rows, bit g where lanes of group g have seeds.
    pub(super) fn groups(&self, width: usize, cancel: &Cancel) -> Result<Vec<u8>> {
        let rows = self.background.len();
        let probed = self.plan.probe.map_or(0, |lane| 1 << (lane / width));
        let background = self.background.par_iter().with_min_len(ROWS_A_TASK);
        let full = background.any(|&weight| weight > T::default());
        let everywhere = probed | u8::from(full) << (BACKGROUND_LANE / width);
        let of_block = |block: usize| {
            let of_block = block * BLOCK..rows.min((block + 1) * BLOCK);
            let seeds = self.of_rows(of_block).iter();
            seeds.fold(everywhere, |bits, (_, lane, _)| {
                bits | 1 << (*lane as usize / width)
            })
        };
        tabulate(rows.div_ceil(BLOCK), of_block, cancel)
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
