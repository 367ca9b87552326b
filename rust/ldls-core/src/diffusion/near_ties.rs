//! The points at which single precision cannot decide between labels.
//!
//! Labels of many of them are equal, as where two masks show the same few points that nothing else flows to: their seeds are the
//! same wherever one comes from. The others are decided in double precision: by the part of the graph that flows to them, with a
//! series that leaves out little, and where this does not tell them apart, with one that leaves out next to nothing. Where
//! what flows to them is much of the graph, all of it is diffused again.

use super::errors::Errors;
use super::lanes::WIDTH_F64;
use super::pass::Pass;
use super::passes::{TOLERANCE_F64, for_each_pass};
use super::reach::Reach;
use super::series::Series;
use super::winners::{self, Best};
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{collect, filled};
use crate::{Cancel, Result};
use std::collections::BTreeMap;

/// What the first series leaves out, as a share of the largest value: a hundredth of what that of single precision does.
const FIRST_TOLERANCE: f64 = 1e-9;
/// By how much a label must be ahead for the first series to be believed, as a share of the error in single precision.
const LEAD: f64 = 0.05;
/// Weight of an edge that can be neglected where the winner is 1: after any number of products it moves no value that counts.
const NEGLIGIBLE: f32 = 1e-18;
/// Most points that labels are followed over to see whether they are equal.
const MOST_FOLLOWED: usize = 4096;

/// Puts the winner first in `best` where the seeds `b` and single precision, off by `errors`, leave it open; the number of such
/// points. `largest` is the largest error, and `trusted` are the series that served in single precision or would have, the
/// longest first. Other arguments as in [`super::diffuse`].
pub(super) fn decide(
    (a, b): (&PointGraph, &PixelLabels),
    best: &mut [Best],
    (errors, largest): (&Errors, f64),
    n_labels: usize,
    (iterations, trusted): (Option<usize>, &[Series]),
    exact: impl Fn(Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    cancel: &Cancel,
) -> Result<usize> {
    let error = |point: u32| errors.at(point as usize);
    // the largest error of all points leaves few to be looked at more closely
    let mut open = winners::contested(best, largest)?;
    open.retain(|&point| best[point as usize].may_win(1, error(point)));
    let contested = open.len();
    if contested <= MOST_FOLLOWED {
        open = settle_equal(a, b, best, &open, error, cancel)?;
    }
    // nobody watches what the last one leaves out, so it is on the interval that can be trusted on every graph
    let first = (trusted.last(), FIRST_TOLERANCE, LEAD);
    let last = (trusted.first(), TOLERANCE_F64, 0.0);
    for (alike, tolerance, share) in [first, last] {
        if open.is_empty() {
            break;
        }
        let candidates = winners::candidates(best, &open, n_labels, error);
        let series = alike.zip(iterations);
        let series = series.and_then(|(alike, products)| alike.within(tolerance, products));
        let series = series.as_ref();
        let leaders = leaders(a, &open, &candidates, series, iterations, &exact, cancel)?;
        let mut leaders = leaders.into_iter();
        open.retain(|&point| {
            let (label, lead) = leaders.next().unwrap_or_default();
            // labels that differ in no bit are equal: what the first series leaves out is smaller where they differ less
            let is_open = lead > 0.0 && lead < share * error(point);
            if !is_open {
                best[point as usize].labels[0] = label;
            }
            is_open
        });
    }
    Ok(contested)
}

/// Puts the lowest label first at those of `points` at which all that may win are equal; the others.
fn settle_equal(
    a: &PointGraph,
    b: &PixelLabels,
    best: &mut [Best],
    points: &[u32],
    error: impl Fn(u32) -> f64,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    let mut open = Vec::new();
    let mut sets: BTreeMap<Vec<u32>, Vec<u32>> = BTreeMap::new();
    for &point in points {
        match best[point as usize].rivals(error(point)) {
            Some(labels) => sets.entry(labels).or_default().push(point),
            None => open.push(point),
        }
    }
    let mut met = filled(false, a.len(), cancel)?;
    for (labels, points) in sets {
        cancel.check()?;
        let values = points.iter().map(|&point| best[point as usize].value());
        let least = NEGLIGIBLE * values.fold(1.0, f32::min);
        if are_equal((a, least), b, &labels, &points, &mut met) {
            for point in points {
                best[point as usize].labels[0] = labels[0];
            }
        } else {
            open.extend(points);
        }
    }
    open.sort_unstable();
    Ok(open)
}

/// True if `labels` have the same seeds at `points` and wherever anything flows to them from, by edges of more than the `least`
/// weight, which must not be far. `met` is of all points, and false.
fn are_equal(
    (a, least): (&PointGraph, f32),
    b: &PixelLabels,
    labels: &[u32],
    points: &[u32],
    met: &mut [bool],
) -> bool {
    let seed = |point: usize, label: u32| {
        let mut row = b.row(point);
        row.find_map(|(at, weight)| (at == label as usize).then_some(weight))
    };
    let mut followed = points.to_vec();
    for &point in points {
        met[point as usize] = true;
    }
    let (mut at, mut equal) = (0, true);
    while equal && at < followed.len() {
        let point = followed[at] as usize;
        let first = seed(point, labels[0]);
        equal = followed.len() <= MOST_FOLLOWED
            && labels.iter().all(|&label| seed(point, label) == first);
        for (column, weight) in a.row(point) {
            if weight > least && !std::mem::replace(&mut met[column], true) {
                followed.push(column as u32);
            }
        }
        at += 1;
    }
    for point in followed {
        met[point as usize] = false;
    }
    equal
}

/// Which of `candidates`, ascending, wins at each of `points` and by how much, in double precision, with `series` in the place
/// of the products where there is one. Where nothing more can be said the lead is endless.
fn leaders(
    a: &PointGraph,
    points: &[u32],
    candidates: &[u32],
    series: Option<&Series>,
    iterations: Option<usize>,
    exact: impl Fn(Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    cancel: &Cancel,
) -> Result<Vec<(u32, f64)>> {
    if let Some(products) = iterations {
        let steps = series.map_or(products.saturating_sub(1), Series::degree);
        if let Some(reach) = Reach::of(a, points, steps, cancel)? {
            let (a, b) = exact(Some(&reach.points))?;
            return reach.leaders((&a, &b), candidates, (series, products), cancel);
        }
    }
    let (a, b) = exact(None)?;
    let mut refined = filled((0, f64::NEG_INFINITY), points.len(), cancel)?;
    let choose = |pass: &Pass<f64, WIDTH_F64>| {
        winners::refine(points, &mut refined, pass);
        Ok(())
    };
    for_each_pass(&a, &b, candidates, iterations, cancel, choose)?;
    let leaders = refined.iter().map(|&(label, _)| (label, f64::INFINITY));
    collect(leaders, cancel)
}

#[cfg(test)]
mod tests {
    use super::super::diffuse;
    use super::*;

    type System<T> = (PointGraph<T>, PixelLabels<T>);

    /// A chain of points whose edges lead to themselves and to the next one, by the weight given.
    fn chain<T: crate::Real>(weights: &[f64], seeds: &[&[(u32, f64)]]) -> System<T> {
        let n = weights.len();
        let columns = (0..n as u32).flat_map(|i| [i, (i + 1).min(n as u32 - 1)]);
        let weights = weights.iter().flat_map(|&weight| [0.1, weight]);
        let a = PointGraph::from_csr(
            (0..=n).map(|i| 2 * i).collect(),
            columns.collect(),
            weights.map(T::from_f64).collect(),
        );
        let mut b = PixelLabels {
            offsets: vec![0],
            labels: vec![],
            weights: vec![],
            mass: vec![T::from_f64(0.5); n],
        };
        for row in seeds {
            b.labels.extend(row.iter().map(|(label, _)| *label));
            let weights = row.iter().map(|(_, weight)| T::from_f64(*weight));
            b.weights.extend(weights);
            b.offsets.push(b.labels.len());
        }
        (a.unwrap(), b)
    }

    /// Labels of a chain, and how many points were looked at in double precision.
    fn decided(weights: &[f64], seeds: &[&[(u32, f64)]]) -> (Vec<u32>, usize) {
        let asked = std::cell::Cell::new(0);
        let exact = |among: Option<&[u32]>| {
            let (a, b) = chain(weights, seeds);
            asked.set(among.map_or(weights.len(), <[_]>::len));
            Ok(among.map_or((a.clone(), b.clone()), |points| {
                (a.among(points), b.among(points))
            }))
        };
        let (a, b) = chain(weights, seeds);
        let found = diffuse(&a, &b, 3, Some(20), exact, Cancel::never()).unwrap();
        (found.labels, asked.get())
    }

    #[test]
    fn labels_of_the_same_seeds_are_equal_without_a_look_in_double_precision() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        assert_eq!(decided(&[0.2; 3], &[twins, &[], twins]), (vec![1, 1, 1], 0));
    }

    #[test]
    fn labels_whose_seeds_differ_farther_away_are_told_apart() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let (labels, asked) = decided(&[1e-7, 0.2, 0.2], &[twins, &[], &[(2, 0.25)]]);
        assert_eq!((labels, asked), (vec![2, 2, 2], 3));
    }

    #[test]
    fn what_lies_beyond_an_edge_of_no_weight_is_not_followed() {
        let twins: &[(u32, f64)] = &[(1, 0.25), (2, 0.25)];
        let (labels, asked) = decided(&[1e-19, 0.2, 0.2], &[twins, &[], &[(2, 0.25)]]);
        assert_eq!((labels, asked), (vec![1, 2, 2], 0));
    }
}
