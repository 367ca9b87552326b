//! The label that wins at each point, and the points at which single precision cannot decide.

use super::lanes::{Lanes, WIDTH_F32};
use super::pass::Pass;
use super::schedule::ROWS_A_TASK;
use crate::memory::{filled, push};
use crate::{Cancel, Error, Result};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// By how much rounding may move one likelihood of a point against another with each sweep, as a share of the largest. On real
/// frames it is 1.5e-7 with a sweep of a series and 3e-8 with a product, at most; no bound.
const ROUNDING_A_SWEEP: f32 = 2.5e-7;
/// The same with all sweeps: at least as much as weights of single precision are off by, and of products that come to an end, the
/// last ones move nothing.
const ROUNDING: [f32; 2] = [4e-6, 2.5e-5];

/// Share of the largest value of a point that errors are at most where labels of less than half of it cannot win.
const SMALL_ERROR: f64 = 1.0 / 32.0;

/// The best label of a point so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Best {
    /// Of equal ones the lowest.
    pub(super) label: u32,
    pub(super) value: f32,
    /// Of the values of all labels.
    sum: f32,
}

impl Best {
    #[inline]
    fn offer(&mut self, label: u32, value: f32) {
        if value > self.value || (value == self.value && label < self.label) {
            (self.label, self.value) = (label, value);
        }
    }

    pub(super) fn confidence(&self) -> f32 {
        if self.sum > 0.0 {
            (self.value / self.sum).min(1.0)
        } else {
            0.0
        }
    }
}

/// A label that may win at a point, where another may too.
#[derive(Debug, Clone, Copy)]
struct Rival {
    point: u32,
    label: u32,
    value: f32,
}

/// True if `value` may really be the largest at a point where `best` is: `rounding` moves one against the other by so large a
/// share, and each may be off by `error`, even to below zero, which it is where the label never came.
fn may_win(value: f32, best: f32, rounding: f32, error: f64) -> bool {
    value != 0.0 && f64::from(best - value) <= f64::from(rounding * best) + 2.0 * error
}

/// The best label of every point, and those that single precision cannot tell from it.
#[derive(Debug, Default)]
pub(super) struct Winners {
    pub(super) best: Vec<Best>,
    /// Of each share of the points, pass after pass; some of the earlier ones may be far behind since.
    rivals: Vec<Vec<Rival>>,
    /// By which share of the largest rounding may move one value of a point against another.
    rounding: f32,
    /// By how much values may be off because smaller ones counted as zero.
    lost: f64,
}

impl Winners {
    /// Offers the values of a pass, where each may be off by `error`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn update(
        &mut self,
        pass: &Pass<f32, WIDTH_F32>,
        error: f64,
        cancel: &Cancel,
    ) -> Result<()> {
        let sweeps = pass.convergence.sweeps as f32;
        let [least, most] = ROUNDING;
        let rounding = (ROUNDING_A_SWEEP * sweeps).clamp(least, most);
        self.rounding = self.rounding.max(rounding);
        self.lost = pass.lost().max(self.lost);
        let offers = Offers {
            pass,
            groups: pass.groups().collect(),
            rounding: self.rounding,
            error: error + self.lost,
        };
        if self.best.is_empty() {
            // not before, since a pass takes the most memory while it runs
            self.best = filled(Best::default(), offers.points(), cancel)?;
            self.rivals = vec![Vec::new(); offers.points().div_ceil(ROWS_A_TASK)];
        }
        let shares = self.best.par_chunks_mut(ROWS_A_TASK);
        let shares = shares.zip(&mut self.rivals).enumerate();
        shares.try_for_each(|(share, (best, rivals))| {
            cancel.check()?;
            let mut points = (share * ROWS_A_TASK..).zip(best);
            points.try_for_each(|(point, best)| offers.put_to(point, best, rivals))
        })
    }

    /// All near-ties, where each value may be off by the `error` of the point, none by more than the `largest`, and the least share of
    /// its value by which the best label of one is ahead.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`].
    pub(super) fn near_ties(
        &mut self,
        largest: f64,
        error: impl Fn(u32) -> f64 + Sync,
    ) -> Result<(NearTies, f32)> {
        let (best, rounding, lost) = (&self.best, self.rounding, self.lost);
        let of_share = |rivals: &mut Vec<Rival>| {
            rivals.sort_by_key(|rival| rival.point);
            let (mut ties, mut labels, mut ahead) = (NearTies::new(), Vec::new(), 1.0_f32);
            for rivals in rivals.chunk_by(|one, other| one.point == other.point) {
                let point = rivals[0].point;
                let Best {
                    label, value: best, ..
                } = best[point as usize];
                let within = |error: f64| {
                    let rivals = rivals.iter();
                    rivals.filter(move |rival| may_win(rival.value, best, rounding, error + lost))
                };
                // to find the error at a point takes a look around
                let error = if within(0.0).count() == within(largest).count() {
                    0.0
                } else {
                    error(point).min(largest)
                };
                labels.clear();
                labels.extend(within(error).map(|rival| rival.label));
                labels.sort_unstable();
                labels.dedup();
                // one alone may be ahead of nothing by less than nothing
                if !labels.is_empty() && labels != [label] {
                    let others = within(error).filter(|rival| rival.label != label);
                    let next = others.map(|rival| rival.value).fold(0.0, f32::max);
                    ahead = ahead.min((best - next) / best);
                    match ties.get_mut(&labels) {
                        Some(points) => push(points, point)?,
                        None => _ = ties.insert(labels.clone(), vec![point]),
                    }
                }
            }
            Ok((ties, ahead))
        };
        let shares = self.rivals.par_iter_mut().map(of_share);
        let (mut all, mut least) = (NearTies::new(), 1.0);
        for (ties, ahead) in shares.collect::<Result<Vec<_>>>()? {
            least = ahead.min(least);
            for (labels, points) in ties {
                let of_labels = all.entry(labels).or_default();
                for point in points {
                    push(of_labels, point)?;
                }
            }
        }
        Ok((all, least))
    }
}

/// The values of a pass, and how far they may be off (see [`may_win`]).
struct Offers<'a> {
    pass: &'a Pass<'a, f32, WIDTH_F32>,
    /// As [`Pass::groups`] has them.
    groups: Vec<(&'a [Lanes<f32, WIDTH_F32>], [f32; WIDTH_F32])>,
    rounding: f32,
    error: f64,
}

impl Offers<'_> {
    fn points(&self) -> usize {
        self.groups.first().map_or(0, |(values, _)| values.len())
    }

    /// Puts all labels to a point, and those that may win to its `rivals` where there are several.
    #[inline]
    fn put_to(&self, point: usize, best: &mut Best, rivals: &mut Vec<Rival>) -> Result<()> {
        let (mut sums, mut largest) = ([0.0; WIDTH_F32], [best.value; WIDTH_F32]);
        for (values, counts) in &self.groups {
            for lane in 0..WIDTH_F32 {
                let value = counts[lane] * values[point][lane];
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
        let (before, met) = (*best, rivals.len());
        let mut offer = |label: u32, value: f32| {
            best.offer(label, value);
            if may_win(value, largest, self.rounding, self.error) {
                let point = point as u32;
                let rival = Rival {
                    point,
                    label,
                    value,
                };
                push(rivals, rival)?;
            }
            Ok::<(), Error>(())
        };
        offer(before.label, before.value)?;
        // most labels are far behind, and cannot win
        let is_sure = f64::from(largest) * SMALL_ERROR > self.error;
        let far_behind = if is_sure {
            largest / 2.0
        } else {
            f32::NEG_INFINITY
        };
        for (group, (values, counts)) in self.groups.iter().enumerate() {
            let values = &values[point];
            let is_near = |lane: usize| {
                let value = counts[lane] * values[lane];
                value > far_behind && value != 0.0
            };
            if (0..WIDTH_F32).fold(false, |any, lane| any | is_near(lane)) {
                let lanes = self.pass.labels_at(point, group).enumerate();
                for (lane, label) in lanes.filter(|(lane, _)| is_near(*lane)) {
                    if let Some(label) = label {
                        offer(label, values[lane])?;
                    }
                }
            }
        }
        if rivals.len() - met == 1 && rivals[met].label == best.label {
            rivals.pop();
        }
        Ok(())
    }
}

/// The points at which single precision cannot decide, ascending, by the labels that may win there, ascending too.
pub(super) type NearTies = BTreeMap<Vec<u32>, Vec<u32>>;

/// The labels that may win at any of `ties`, ascending.
pub(super) fn candidates(ties: &NearTies) -> Vec<u32> {
    let labels: BTreeSet<u32> = ties.keys().flatten().copied().collect();
    labels.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near-ties of points with these labels and values, each of which may be off by as much, and how far the best is ahead.
    fn ties_of(points: &[&[(u32, f32)]], error: f64) -> (NearTies, f32) {
        let (mut winners, mut rivals) = (Winners::default(), Vec::new());
        for (point, values) in (0..).zip(points) {
            let mut best = Best::default();
            for &(label, value) in *values {
                best.offer(label, value);
                rivals.push(Rival {
                    point,
                    label,
                    value,
                });
            }
            winners.best.push(best);
        }
        winners.rivals.push(rivals);
        winners.near_ties(error, |_| error).unwrap()
    }

    fn tied(points: &[&[(u32, f32)]], error: f64) -> Vec<u32> {
        let (ties, _) = ties_of(points, error);
        let mut tied = ties.into_values().collect::<Vec<_>>().concat();
        tied.sort_unstable();
        tied
    }

    #[test]
    fn of_equal_values_the_lowest_label_wins_in_any_order() {
        for values in [
            [(0, 0.5), (3, 0.5), (7, 0.25)],
            [(7, 0.25), (3, 0.5), (0, 0.5)],
        ] {
            let mut best = Best::default();
            for (label, value) in values {
                best.offer(label, value);
            }
            assert_eq!((best.label, best.value), (0, 0.5));
        }
    }

    #[test]
    fn values_within_twice_their_error_are_near_ties() {
        let points: [&[(u32, f32)]; 2] = [&[(1, 0.500), (2, 0.499)], &[(1, 0.5), (2, 0.25)]];
        assert!(
            tied(&points, 0.0).is_empty(),
            "far more than rounding apart"
        );
        assert_eq!(tied(&points, 0.001), [0]);
        assert_eq!(tied(&points, 0.2), [0, 1]);
        assert_eq!(tied(&[&[(1, 0.5), (2, 0.5)]], 0.0), [0]);
    }

    #[test]
    fn the_best_is_as_far_ahead_as_at_the_near_tie_where_that_is_least() {
        let points: [&[(u32, f32)]; 3] = [
            &[(1, 0.25), (2, 0.5), (3, 0.375)],
            &[(1, 1.0), (2, 0.5)],
            &[(1, 0.25), (2, 0.01)],
        ];
        let ahead = |error| ties_of(&points, error).1;
        assert_eq!([0.25, 0.1, 0.0].map(ahead), [0.25, 0.25, 1.0]);
        assert_eq!(ties_of(&[&[(1, 0.5), (2, 0.5)]], 0.0).1, 0.0);
    }

    #[test]
    fn a_value_below_zero_may_be_the_largest_as_far_as_it_may_be_off() {
        assert_eq!(tied(&[&[(1, 0.25), (2, -0.25)]], 0.25), [0]);
        assert!(tied(&[&[(1, 0.25), (2, -0.25)]], 0.125).is_empty());
        let (ties, _) = ties_of(&[&[(3, -0.25)]], 0.125);
        assert_eq!(ties[&vec![3]], [0], "nothing else came");
    }

    #[test]
    fn a_label_that_nothing_reached_is_no_rival() {
        assert!(tied(&[&[(1, 0.5), (2, 0.0)]], 1.0).is_empty());
        assert!(tied(&[&[]], 1.0).is_empty());
    }

    #[test]
    fn points_are_named_by_the_labels_that_may_win() {
        let points: [&[(u32, f32)]; 3] = [
            &[(4, 0.5), (1, 0.5), (6, 0.1)],
            &[(1, 0.5), (4, 0.5), (6, 0.5), (8, 0.5)],
            &[(1, 0.5), (4, 0.5), (1, 0.5)],
        ];
        let (ties, _) = ties_of(&points, 0.0);
        assert_eq!(ties[&vec![1, 4]], [0, 2]);
        assert_eq!(ties[&vec![1, 4, 6, 8]], [1]);
        assert_eq!(candidates(&ties), [1, 4, 6, 8]);
        assert_eq!(candidates(&ties_of(&points[..1], 0.21).0), [1, 4, 6]);
    }
}
