//! The label that wins at each point, and the points at which single precision cannot decide.

use super::lanes::{WIDTH_F32, WIDTH_F64};
use super::pass::Pass;
use super::schedule::ROWS_A_TASK;
use crate::Result;
use crate::memory::push;
use rayon::prelude::*;

/// Rounding of single precision, as a share of the largest likelihood of a point: 1e-5 on real frames, no bound.
const ROUNDING: f32 = 2.5e-5;

/// Share of the largest value of a point that errors are at most where labels of less than half of it cannot win.
const SMALL_ERROR: f64 = 1.0 / 32.0;

/// Share of the largest value within which values in double precision are equal: what rounding leaves of equal ones.
pub(super) const EQUAL: f64 = 1e-13;

/// The best labels of a point so far. All but the last are told apart: where that may win too, all labels are looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Best<const RANKS: usize> {
    /// The winner first; of equal ones the lowest.
    pub(super) labels: [u32; RANKS],
    /// Their values.
    values: [f32; RANKS],
    sum: f32,
}

impl<const RANKS: usize> Default for Best<RANKS> {
    fn default() -> Self {
        Self {
            labels: [0; RANKS],
            values: [0.0; RANKS],
            sum: 0.0,
        }
    }
}

impl<const RANKS: usize> Best<RANKS> {
    #[inline]
    fn offer(&mut self, mut label: u32, mut value: f32) {
        for (other, best) in self.labels.iter_mut().zip(&mut self.values) {
            if value > *best || (value == *best && label < *other) {
                std::mem::swap(other, &mut label);
                std::mem::swap(best, &mut value);
            }
        }
    }

    /// True if the value at `rank` may really be the largest, where each may be off by `error`.
    pub(super) fn may_win(&self, rank: usize, error: f64) -> bool {
        let behind = f64::from(self.values[0] - self.values[rank]);
        self.values[rank] > 0.0 && behind <= f64::from(ROUNDING * self.values[0]) + 2.0 * error
    }

    /// Value of the best label.
    pub(super) fn value(&self) -> f32 {
        self.values[0]
    }

    /// The labels that may win, ascending; none where there are more than are told apart.
    pub(super) fn rivals(&self, error: f64) -> Option<Vec<u32>> {
        if self.may_win(RANKS - 1, error) {
            return None;
        }
        let may_win = (0..RANKS - 1).filter(|&rank| self.may_win(rank, error));
        let mut labels: Vec<u32> = may_win.map(|rank| self.labels[rank]).collect();
        labels.sort_unstable();
        Some(labels)
    }

    pub(super) fn confidence(&self) -> f32 {
        if self.sum > 0.0 {
            (self.values[0] / self.sum).min(1.0)
        } else {
            0.0
        }
    }
}

/// Offers the values of a pass to the best labels of all points, where each may be off by `error`.
pub(super) fn update<const RANKS: usize>(
    best: &mut [Best<RANKS>],
    pass: &Pass<f32, WIDTH_F32>,
    error: f64,
) {
    let groups: Vec<_> = pass.groups().collect();
    let least = (error / SMALL_ERROR) as f32;
    let points = best.par_iter_mut().enumerate().with_min_len(ROWS_A_TASK);
    points.for_each(|(i, best)| {
        let (mut sums, mut largest) = ([0.0; WIDTH_F32], [best.values[0]; WIDTH_F32]);
        for (values, counts) in &groups {
            let values = &values[i];
            for lane in 0..WIDTH_F32 {
                let value = counts[lane] * values[lane];
                sums[lane] += value;
                largest[lane] = if value > largest[lane] {
                    value
                } else {
                    largest[lane]
                };
            }
        }
        best.sum += sums.iter().sum::<f32>();
        let largest = largest.iter().fold(0.0, |one: f32, other| one.max(*other));
        // most labels are far behind, and cannot win
        let far_behind = if largest > least { largest / 2.0 } else { 0.0 };
        for (group, (values, counts)) in groups.iter().enumerate() {
            let values = &values[i];
            let may_win = |lane: usize| counts[lane] * values[lane] > far_behind;
            if (0..WIDTH_F32).fold(false, |any, lane| any | may_win(lane)) {
                let lanes = pass.labels_at(i, group).enumerate();
                for (lane, label) in lanes.filter(|(lane, _)| may_win(*lane)) {
                    best.offer(label.unwrap_or_default(), values[lane]);
                }
            }
        }
    });
}

/// A point at which single precision cannot decide.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NearTie {
    pub(super) point: u32,
    /// The labels that may win, ascending; none where there are more than are told apart.
    pub(super) rivals: Option<Vec<u32>>,
}

/// All near-ties by point, where each value may be off by the `error` of the point, none by more than the `largest`.
pub(super) fn near_ties<const RANKS: usize>(
    best: &[Best<RANKS>],
    largest: f64,
    error: impl Fn(u32) -> f64 + Sync,
) -> Result<Vec<NearTie>> {
    let of_task = |task: usize| {
        let mut ties = Vec::new();
        for at in task * ROWS_A_TASK..best.len().min((task + 1) * ROWS_A_TASK) {
            // the largest leaves few to be looked at more closely
            if best[at].may_win(1, largest) {
                let (point, error) = (at as u32, error(at as u32));
                if best[at].may_win(1, error) {
                    let rivals = best[at].rivals(error);
                    push(&mut ties, NearTie { point, rivals })?;
                }
            }
        }
        Ok(ties)
    };
    let tasks = (0..best.len().div_ceil(ROWS_A_TASK)).into_par_iter();
    let ties = tasks.map(of_task).collect::<Result<Vec<_>>>()?;
    Ok(ties.into_iter().flatten().collect())
}

/// The labels that may win at any of `ties`, ascending.
pub(super) fn candidates(ties: &[NearTie], n_labels: usize) -> Vec<u32> {
    let mut labels = Vec::new();
    for tie in ties {
        let Some(rivals) = &tie.rivals else {
            return (0..n_labels as u32).collect();
        };
        labels.extend(rivals);
        // most have the same
        if labels.len() > 2 * n_labels {
            labels.sort_unstable();
            labels.dedup();
        }
    }
    labels.sort_unstable();
    labels.dedup();
    labels
}

/// Keeps in `refined` the best label of each of `points` and its value; of [`EQUAL`] ones the lowest.
pub(super) fn refine(points: &[u32], refined: &mut [(u32, f64)], pass: &Pass<f64, WIDTH_F64>) {
    for (&point, best) in points.iter().zip(refined) {
        for (label, value) in pass.at(point as usize) {
            offer(best, label, value);
        }
    }
}

fn offer((best, largest): &mut (u32, f64), label: u32, value: f64) {
    if value > *largest * (1.0 + EQUAL) {
        (*best, *largest) = (label, value);
    } else if value >= *largest * (1.0 - EQUAL) {
        (*best, *largest) = (label.min(*best), value.max(*largest));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near-ties where each value may be off by as much.
    fn ties_of(best: &[Best<4>], error: f64) -> Vec<NearTie> {
        near_ties(best, error, |_| error).unwrap()
    }

    fn tied(best: &[Best<4>], error: f64) -> Vec<u32> {
        ties_of(best, error).iter().map(|tie| tie.point).collect()
    }

    fn best(values: &[(u32, f32)]) -> Best<4> {
        let mut best = Best::default();
        for &(label, value) in values {
            best.offer(label, value);
        }
        best
    }

    #[test]
    fn of_equal_values_the_lowest_label_wins_in_any_order() {
        for values in [
            [(0, 0.5), (3, 0.5), (7, 0.25)],
            [(7, 0.25), (3, 0.5), (0, 0.5)],
        ] {
            assert_eq!(best(&values).labels[..3], [0, 3, 7]);
        }
    }

    #[test]
    fn of_values_that_rounding_tells_apart_the_lowest_label_wins_in_any_order() {
        let below = 0.5 * (1.0 - f64::EPSILON);
        for values in [
            [(3, 0.5), (0, below), (7, 0.5)],
            [(7, 0.5), (3, 0.5), (0, below)],
            [(0, below), (7, 0.5), (3, 0.25)],
        ] {
            let mut best = (0, f64::NEG_INFINITY);
            for (label, value) in values {
                offer(&mut best, label, value);
            }
            assert_eq!(best, (0, 0.5));
        }
        let mut best = (1, 0.5);
        offer(&mut best, 0, 0.5 * (1.0 - 1e-12));
        offer(&mut best, 2, 0.5 * (1.0 + 1e-12));
        assert_eq!(best.0, 2);
    }

    #[test]
    fn values_within_twice_their_error_are_near_ties() {
        let points = [
            best(&[(1, 0.500), (2, 0.499)]),
            best(&[(1, 0.5), (2, 0.25)]),
        ];
        assert!(
            tied(&points, 0.0).is_empty(),
            "far more than rounding apart"
        );
        assert_eq!(tied(&points, 0.001), [0]);
        assert_eq!(tied(&points, 0.2), [0, 1]);
        assert_eq!(tied(&[best(&[(1, 0.5), (2, 0.5)])], 0.0), [0]);
    }

    #[test]
    fn a_label_that_nothing_reached_is_no_candidate() {
        assert!(tied(&[best(&[(1, 0.5)])], 1.0).is_empty());
        assert!(tied(&[Best::default()], 1.0).is_empty());
    }

    #[test]
    fn where_a_fourth_label_may_win_all_are_candidates() {
        let two = best(&[(1, 0.5), (4, 0.5), (6, 0.1)]);
        let four = best(&[(1, 0.5), (4, 0.5), (6, 0.5), (8, 0.5)]);
        assert_eq!(candidates(&ties_of(&[two], 0.0), 9), [1, 4]);
        assert_eq!(candidates(&ties_of(&[two], 0.2), 9), [1, 4, 6]);
        let all: Vec<u32> = (0..9).collect();
        assert_eq!(candidates(&ties_of(&[two, four], 0.0), 9), all);
    }
}
