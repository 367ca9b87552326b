//! Which label wins at each point, and where single precision does not tell.

use super::lanes::Lane;
use super::pass::{label_values, labels_of};
use super::values::Values;
use rayon::prelude::*;

/// Rounding of single precision, as a share of the largest likelihood of a point: 1e-5 on real frames, no bound.
const ROUNDING: f32 = 2.5e-5;
/// Rows handled by one task of the thread pool.
const BLOCK: usize = 2048;

/// The best labels of a point so far.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Best {
    /// The winner and the one behind it; of equal ones the lowest first.
    pub(crate) labels: [u32; 2],
    /// Their values and that of the third.
    values: [f32; 3],
    sum: f32,
}

impl Best {
    #[inline]
    fn offer(&mut self, label: u32, value: f32) {
        self.sum += value;
        if value <= self.values[2] {
            return;
        }
        let beats =
            |other: f32, other_label: u32| value > other || (value == other && label < other_label);
        if beats(self.values[0], self.labels[0]) {
            self.values = [value, self.values[0], self.values[1]];
            self.labels = [label, self.labels[0]];
        } else if beats(self.values[1], self.labels[1]) {
            self.values = [self.values[0], value, self.values[1]];
            self.labels[1] = label;
        } else {
            self.values[2] = value;
        }
    }

    /// Whether the value at `rank` may really be the largest, where each may be off by `error`.
    fn may_win(&self, rank: usize, error: f64) -> bool {
        let behind = f64::from(self.values[0] - self.values[rank]);
        self.values[rank] > 0.0 && behind <= f64::from(ROUNDING * self.values[0]) + 2.0 * error
    }

    pub(crate) fn confidence(&self) -> f32 {
        if self.sum > 0.0 {
            (self.values[0] / self.sum).min(1.0)
        } else {
            0.0
        }
    }
}

/// The points at which single precision does not tell the winner.
pub(crate) struct Contested {
    pub(crate) points: Vec<u32>,
    /// Error of the values in single precision.
    error: f64,
}

impl Contested {
    pub(crate) fn among(best: &[Best], error: f64) -> Self {
        let contested = best
            .iter()
            .enumerate()
            .filter(|(_, best)| best.may_win(1, error));
        Self {
            points: contested.map(|(point, _)| point as u32).collect(),
            error,
        }
    }

    /// The labels that may win at any of the points, ascending.
    pub(crate) fn labels(&self, best: &[Best], n_labels: usize) -> Vec<u32> {
        let at = |&point: &u32| &best[point as usize];
        if self
            .points
            .iter()
            .map(at)
            .any(|best| best.may_win(2, self.error))
        {
            return (0..n_labels as u32).collect();
        }
        let mut labels: Vec<u32> = self
            .points
            .iter()
            .flat_map(|point| at(point).labels)
            .collect();
        labels.sort_unstable();
        labels.dedup();
        labels
    }

    /// Keeps the best label of each point and its value in `refined`.
    pub(crate) fn refine<const WIDTH: usize>(
        &self,
        refined: &mut [(u32, f64)],
        lanes: &[Lane],
        z: &Values<f64, WIDTH>,
    ) {
        for (&point, best) in self.points.iter().zip(refined) {
            for (label, lane) in labels_of(lanes) {
                let value = z.get(point as usize, lane);
                if value > best.1 || (value == best.1 && label < best.0) {
                    *best = (label, value);
                }
            }
        }
    }
}

pub(crate) fn update<const WIDTH: usize>(
    best: &mut [Best],
    lanes: &[Lane],
    z: &Values<f32, WIDTH>,
) {
    let lanes = label_values(lanes, z);
    best.par_iter_mut()
        .enumerate()
        .with_min_len(BLOCK)
        .for_each(|(i, best)| {
            for (label, values) in &lanes {
                best.offer(*label, values.at(i));
            }
        });
}
