//! The likelihoods of a few points in double precision, by the part of the graph that flows to them.
//!
//! A step takes values one edge farther, so before the last step only the points themselves and those that they have edges
//! from matter, before the one before it those two edges away, and so on: a tenth of a frame on average.

use super::lanes::WIDTH_F64;
use super::sweep::Step;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{filled, push, zeros};
use crate::{Cancel, Error, Result};
use multiversion::multiversion;
use rayon::prelude::*;

/// Share of the work of diffusing the whole graph from which on that is done instead.
const MOST_WORK: f64 = 0.5;
/// Share of the largest value within which values are equal: what rounding leaves of equal ones.
const EQUAL: f64 = 1e-13;
/// Rows handled by one task of the thread pool.
const ROWS_A_TASK: usize = 1024;

/// What some points may have labels from.
#[derive(Debug)]
pub(super) struct Reach {
    /// The points themselves, then all from which edges lead to them, those of the fewest edges first.
    pub(super) points: Vec<u32>,
    /// Number of points within 0, 1 and more edges.
    ends: Vec<usize>,
}

impl Reach {
    /// The reach of `from` in so many steps over `a`, and what the rows that they need are normalised with; none where
    /// that is much of the graph.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn of(
        a: &PointGraph,
        from: &[u32],
        steps: usize,
        cancel: &Cancel,
    ) -> Result<Option<Self>> {
        let most = MOST_WORK * steps.max(1) as f64 * a.len() as f64;
        let mut met = filled(false, a.len(), cancel)?;
        let (mut points, mut ends) = (Vec::new(), Vec::new());
        for &point in from {
            met[point as usize] = true;
            push(&mut points, point)?;
        }
        push(&mut ends, points.len())?;
        let (mut first, mut work) = (0, 0);
        for _ in 0..=steps {
            cancel.check()?;
            let last = points.len();
            work += last;
            if work as f64 > most {
                return Ok(None);
            }
            for at in first..last {
                for (column, _) in a.row(points[at] as usize) {
                    if !std::mem::replace(&mut met[column], true) {
                        push(&mut points, column as u32)?;
                    }
                }
            }
            first = last;
            push(&mut ends, points.len())?;
        }
        Ok(Some(Self { points, ends }))
    }

    /// Which of `labels`, ascending, wins at each of the points themselves, of equal ones the lowest, after `steps` from
    /// `first` times the seeds. `a` and `b` are of `self.points`, in this order; rows of the outermost do not matter.
    pub(super) fn winners(
        &self,
        (a, b): (&PointGraph<f64>, &PixelLabels<f64>),
        labels: &[u32],
        (first, steps): (f64, &[Step<f64>]),
        cancel: &Cancel,
    ) -> Result<Vec<u32>> {
        let groups = labels.chunks(WIDTH_F64);
        let values = groups.map(|labels| self.values(a, b, labels, (first, steps), cancel));
        let values = values.collect::<Result<Vec<_>>>()?;
        let winner = |at: usize| {
            let of_labels = || values.iter().flat_map(|group| group[at]).zip(labels);
            let best = of_labels().fold(0.0, |best: f64, (value, _)| best.max(value));
            let mut winners = of_labels().filter(|(value, _)| *value >= best * (1.0 - EQUAL));
            winners.next().map_or(0, |(_, &label)| label)
        };
        Ok((0..self.ends[0]).map(winner).collect())
    }

    /// Likelihoods of a group of labels at the points themselves.
    fn values(
        &self,
        a: &PointGraph<f64>,
        b: &PixelLabels<f64>,
        labels: &[u32],
        (first, steps): (f64, &[Step<f64>]),
        cancel: &Cancel,
    ) -> Result<Vec<[f64; WIDTH_F64]>> {
        let mut seeds: Vec<[f64; WIDTH_F64]> = zeros(self.ends[steps.len()], cancel)?;
        for (at, seeds) in seeds.iter_mut().enumerate() {
            for (label, weight) in b.row(at) {
                if let Some(lane) = labels.iter().position(|&own| own as usize == label) {
                    seeds[lane] = weight;
                }
            }
        }
        let [mut values, mut next] = [zeros(seeds.len(), cancel)?, zeros(seeds.len(), cancel)?];
        for (value, seed) in values.iter_mut().zip(&seeds) {
            *value = seed.map(|seed| first * seed);
        }
        for (step, &end) in steps.iter().zip(self.ends[..steps.len()].iter().rev()) {
            let tasks = next[..end].par_chunks_mut(ROWS_A_TASK).enumerate();
            tasks.try_for_each(|(task, next)| {
                cancel.check()?;
                take_step(a, *step, &seeds, &values, task * ROWS_A_TASK, next);
                Ok::<(), Error>(())
            })?;
            std::mem::swap(&mut values, &mut next);
        }
        values.truncate(self.ends[0]);
        Ok(values)
    }
}

/// Takes `step` with the rows from `start` on, whose values before the last step are in `next`.
#[multiversion(targets("x86_64+avx2"))]
fn take_step(
    a: &PointGraph<f64>,
    step: Step<f64>,
    seeds: &[[f64; WIDTH_F64]],
    values: &[[f64; WIDTH_F64]],
    start: usize,
    next: &mut [[f64; WIDTH_F64]],
) {
    let points = next.iter_mut().zip(&seeds[start..]).zip(&values[start..]);
    for (at, ((next, seeds), own)) in (start..).zip(points) {
        let (columns, weights) = a.slices(at..at + 1);
        let mut sum = [0.0; WIDTH_F64];
        for (&column, &weight) in columns.iter().zip(weights) {
            let values = &values[column as usize];
            for lane in 0..WIDTH_F64 {
                sum[lane] += weight * values[lane];
            }
        }
        for lane in 0..WIDTH_F64 {
            next[lane] = step.seeds * seeds[lane]
                + step.along * sum[lane]
                + step.stay * own[lane]
                + step.back * next[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Real;

    /// A chain whose every point has edges to itself and to the next one, the last to itself alone.
    fn chain<T: Real>(n: u32) -> PointGraph<T> {
        let rows = (0..n).map(|i| if i + 1 < n { vec![i, i + 1] } else { vec![i] });
        let rows: Vec<Vec<u32>> = rows.collect();
        let offsets = (0..=n as usize).map(|i| rows[..i].iter().map(Vec::len).sum());
        let columns = rows.concat();
        let weights = vec![T::from_f64(0.25); columns.len()];
        PointGraph::from_csr(offsets.collect(), columns, weights).unwrap()
    }

    #[test]
    fn it_ends_as_many_edges_away_as_there_are_steps_and_one_more() {
        let reach = Reach::of(&chain(90), &[5, 2], 2, Cancel::never());
        let reach = reach.unwrap().unwrap();
        assert_eq!(reach.points, [5, 2, 6, 3, 7, 4, 8]);
        assert_eq!(reach.ends, [2, 4, 6, 7]);
    }

    #[test]
    fn what_is_much_of_the_graph_is_left_to_a_diffusion_of_all() {
        let reach = |steps| Reach::of(&chain(40), &[0], steps, Cancel::never()).unwrap();
        assert!(reach(30).is_some());
        assert!(reach(200).is_none());
    }

    #[test]
    fn winners_are_those_of_the_products_and_of_equal_labels_the_lowest() {
        let (a, n) = (chain(600), 600);
        let mut b = PixelLabels {
            offsets: vec![0, 1, 2, 4, 5, 6],
            labels: vec![3, 1, 1, 2, 2, 0],
            weights: vec![0.01, 0.5, 0.5, 0.5, 0.5, 0.75],
            mass: vec![1.0; n],
        };
        b.offsets.resize(n + 1, 6);
        let winners = |from: &[u32], products: usize| {
            let reach = Reach::of(&chain(600), from, products - 1, Cancel::never());
            let reach = reach.unwrap().unwrap();
            let near = (&a.among(&reach.points), &b.among(&reach.points));
            let steps = vec![Step::product(); products - 1];
            let found = reach.winners(near, &[0, 1, 2, 3], (1.0, &steps), Cancel::never());
            found.unwrap()
        };
        // point 2 has label 1 from itself, and label 2 from itself and from the next; nothing comes to point 5
        assert_eq!(winners(&[1, 2, 3, 5], 3), [1, 2, 2, 0]);
        assert_eq!(winners(&[2], 1), [1]);
    }
}
