//! The points at which single precision cannot decide between labels.
//!
//! At most of many seeds alone show the winner, as where several masks show all that anything flows from. What seeds leave open, and
//! where they are few all, is decided in double precision: with a series, where a probe says that it leaves out as much as labels
//! differ by with one that leaves out less, and at last with the products.

use super::errors::Errors;
use super::lanes::WIDTH_F32;
use super::leaders::leaders;
use super::pass::Pass;
use super::schedule::Schedule;
use super::series::Series;
use super::spread::{TOGETHER, behind};
use super::winners::{Best, NearTies, Winners, candidates};
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::{Cancel, Result};
use std::collections::BTreeMap;

/// What the series of one round after the other leave out, as a share of the largest value: the first tells labels apart that single
/// precision sees [`APART`], the second knows equal ones, for which it leaves out less than rounding does nearly everywhere. What
/// neither is sure of is left for the products.
const ROUNDS: [Option<f64>; 3] = [Some(1e-9), Some(1e-20), None];
/// By which share of its value the best label must be ahead in single precision for the first round: closer ones are equal as a rule.
const APART: f32 = 2e-6;
/// Points up to which they are a few: what flows to these is diffused in double precision in the time that it takes to look at all
/// seeds. More are those of masks that lie over one another, most of whose labels are equal, which seeds show at most.
const FEW: usize = 1 << 8;

/// Puts right the best of `winners` where the seeds `b` and single precision, off by `errors`, leave it open; the number of such
/// points. The `schedule` is that of `a`, `largest` the largest error, and `series` one near whose interval all eigenvalues lie. Other
/// arguments as in [`super::diffuse`].
pub(super) fn decide(
    (a, b, schedule): (&PointGraph, &PixelLabels, &Schedule),
    winners: &mut Winners,
    (errors, largest): (&Errors, f64),
    (iterations, series): (Option<usize>, Option<&Series>),
    exact: impl Fn(Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    cancel: &Cancel,
) -> Result<usize> {
    let error = |point: u32| errors.at(point as usize);
    let (mut ties, ahead) = winners.near_ties(largest, error)?;
    let best = &mut winners.best;
    let contested = ties.values().map(Vec::len).sum();
    if contested == 0 {
        return Ok(0);
    }
    let are_many = contested > FEW;
    let (first, last) = match iterations {
        Some(_) => (usize::from(are_many || ahead < APART), ROUNDS.len() - 1),
        // endlessly many end where they change little, which says no more than a series
        None => (1, 1),
    };
    for round in first..=last {
        if are_many || round == last {
            let steps = Pass::<f32, WIDTH_F32>::steps(None, iterations);
            settle_lowest((a, b, schedule), steps, best, &mut ties, cancel)?;
        }
        if ties.is_empty() {
            break;
        }
        let within = |tolerance| series?.within(tolerance, iterations);
        let series = ROUNDS[round].and_then(within);
        let candidates = candidates(&ties);
        let points: Vec<u32> = ties.values().flatten().copied().collect();
        let values = points.iter().map(|&point| best[point as usize].value);
        let least = values.fold(f32::INFINITY, f32::min);
        let products = (series.as_ref(), iterations);
        let mut leaders =
            leaders(a, (&points, least), &candidates, products, &exact, cancel)?.into_iter();
        // all of them are asked about in this order
        let mut is_open = |point: &u32| {
            let leader = leaders.next().unwrap_or_default();
            best[*point as usize].label = leader.label();
            !leader.is_sure()
        };
        let sets = ties.values_mut();
        sets.for_each(|points| points.retain(&mut is_open));
        ties.retain(|_, points| !points.is_empty());
    }
    Ok(contested)
}

/// Makes the lowest label the best of those `ties` where none that it ties with anywhere is ahead of it by a seed that comes there
/// in so many `steps`, and leaves the other points: most are where all labels have the same seeds far around.
fn settle_lowest(
    (a, b, schedule): (&PointGraph, &PixelLabels, &Schedule),
    steps: usize,
    best: &mut [Best],
    ties: &mut NearTies,
    cancel: &Cancel,
) -> Result<()> {
    let mut rivals: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for labels in ties.keys() {
        rivals.entry(labels[0]).or_default().extend(&labels[1..]);
    }
    let rivals: Vec<(u32, Vec<u32>)> = rivals.into_iter().collect();
    for rivals in rivals.chunks(TOGETHER) {
        let behind = behind((a, b), schedule, rivals, steps, cancel)?;
        for (labels, points) in ties.iter_mut() {
            let bit = rivals.binary_search_by_key(&labels[0], |(lowest, _)| *lowest);
            points.retain(|&point| {
                let settled = bit.is_ok_and(|bit| behind[point as usize] >> bit & 1 == 0);
                if settled {
                    best[point as usize].label = labels[0];
                }
                !settled
            });
        }
    }
    ties.retain(|_, points| !points.is_empty());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::diffuse;
    use super::*;
    use crate::test_support::chain;

    /// Labels of a chain after so many products, and how many points were looked at in double precision.
    fn decided_after(
        iterations: Option<usize>,
        weights: &[f64],
        seeds: &[&[(u32, f64)]],
    ) -> (Vec<u32>, usize) {
        let asked = std::cell::Cell::new(0);
        let exact = |among: Option<&[u32]>| {
            let (a, b) = chain(weights, seeds);
            asked.set(among.map_or(weights.len(), <[_]>::len));
            Ok(among.map_or((a.clone(), b.clone()), |points| {
                (a.among(points), b.among(points))
            }))
        };
        let (a, b) = chain(weights, seeds);
        let found = diffuse(&a, &b, 8, iterations, exact, Cancel::never()).unwrap();
        (found.labels, asked.get())
    }

    /// The same after endlessly many, where seeds come before the look, which labels after twenty are equal to.
    fn decided(weights: &[f64], seeds: &[&[(u32, f64)]]) -> (Vec<u32>, usize) {
        let found = decided_after(None, weights, seeds);
        let (few, asked) = decided_after(Some(20), weights, seeds);
        assert_eq!((&few, asked), (&found.0, weights.len()));
        found
    }

    #[test]
    fn labels_of_the_same_seeds_are_equal_without_a_look_in_double_precision() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        assert_eq!(decided(&[0.2; 3], &[twins, &[], twins]), (vec![1, 1, 1], 0));
    }

    #[test]
    fn as_many_labels_may_be_equal_as_masks_lie_over_one_another() {
        let masks: Vec<(u32, f64)> = (2..8).map(|label| (label, 0.5)).collect();
        let seeds: [&[_]; 3] = [&masks, &[], &masks];
        assert_eq!(decided(&[0.2; 3], &seeds), (vec![2, 2, 2], 0));
    }

    #[test]
    fn the_lowest_needs_none_either_where_a_seed_farther_away_puts_it_ahead() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let one_ahead = |label| decided(&[1e-7, 0.2, 0.2], &[twins, &[], &[(label, 0.25)]]);
        assert_eq!(one_ahead(1), (vec![1, 1, 1], 0));
        assert_eq!(one_ahead(2), (vec![2, 2, 2], 3));
    }

    #[test]
    fn of_many_points_those_near_a_seed_of_one_label_have_it_and_all_others_the_lowest() {
        let (n, one) = (2048, 1024);
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let mut seeds = vec![twins; n];
        seeds[one] = &[(2, 0.25)];
        let (labels, _) = decided_after(Some(20), &vec![0.2; n], &seeds);
        // eighteen edges away label 1 lacks two parts in 1e13, nineteen away less than rounding leaves of equal ones
        let expected = |point| {
            if (one - 18..=one).contains(&point) {
                2
            } else {
                1
            }
        };
        assert_eq!(labels, (0..n).map(expected).collect::<Vec<u32>>());
    }

    #[test]
    fn labels_that_are_both_ahead_somewhere_are_told_apart_in_double_precision() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let seeds: [&[_]; 3] = [twins, &[(2, 0.1)], &[(1, 0.25)]];
        assert_eq!(decided(&[1e-7, 0.2, 0.2], &seeds), (vec![2, 2, 1], 3));
    }

    #[test]
    fn labels_are_told_apart_in_single_precision_as_far_as_the_rounding_of_its_sweeps() {
        // label 1 is ahead at the point itself, and label 2 by that and as much as `ahead` at the next
        let decided = |ahead: f64| {
            let own = [(1, 0.25), (2, 0.25 * (1.0 - 2e-5))];
            let next = [(2, 0.25 * (2e-5 + ahead) * 0.9 / 0.2)];
            let (labels, asked) = decided_after(Some(20), &[0.2; 3], &[&own, &next]);
            (labels[0], asked)
        };
        assert_eq!(decided(1e-5), (2, 0));
        assert_eq!(decided(1e-6), (2, 3));
    }

    #[test]
    fn what_comes_along_an_edge_of_next_to_no_weight_does_not_count() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let (labels, _) = decided(&[1e-19, 0.2, 0.2], &[twins, &[], &[(2, 0.25)]]);
        assert_eq!(labels, [1, 2, 2]);
    }
}
