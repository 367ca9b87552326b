//! The likelihoods of a few points in double precision, by the part of the graph that flows to them.
//!
//! A step takes values one edge farther, so before the last step only the points themselves and those that they have edges
//! from matter, before the one before it those two edges away, and so on: a tenth of a frame on average.

use super::lanes::WIDTH_F64;
use super::pass::Pass;
use super::plan::Planner;
use super::schedule::Schedule;
use super::seeds::Seeds;
use super::series::Series;
use super::winners::EQUAL;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{filled, push};
use crate::{Cancel, Result};

/// Share of the work of diffusing the whole graph from which on that is done instead.
const MOST_WORK: f64 = 0.5;

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

    /// Which of `labels` wins at each of the points themselves, of equal ones the lowest, and how far it is ahead of the others,
    /// by the `series` that stands for the products; or after `iterations` products, which is all there is to say, so that it
    /// is endlessly far. `a` and `b` are of `self.points`, in this order; rows of the outermost do not matter.
    pub(super) fn leaders(
        &self,
        (a, b): (&PointGraph<f64>, &PixelLabels<f64>),
        labels: &[u32],
        (series, iterations): (Option<&Series>, usize),
        cancel: &Cancel,
    ) -> Result<Vec<(u32, f64)>> {
        let steps = self.ends.len() - 2;
        let schedule = Schedule::narrowing(a, self.ends[..steps].iter().rev().copied(), cancel)?;
        let mut found = vec![Vec::new(); self.ends[0]];
        let planner = Planner {
            schedule: &schedule,
            width: WIDTH_F64,
            probe: false,
            steps,
        };
        for plan in planner.plan((a, b), labels, cancel)? {
            let seeds = Seeds::new(b, plan, cancel)?;
            let pass: Pass<f64, WIDTH_F64> =
                Pass::run(a, &schedule, &seeds, series, Some(iterations), cancel)?;
            for (point, of_point) in found.iter_mut().enumerate() {
                of_point.extend(pass.at(point));
            }
        }
        let leader = |of_point: &Vec<(u32, f64)>| {
            let [best, next] = of_point
                .iter()
                .fold([0.0_f64; 2], |[best, next], &(_, value)| {
                    [best.max(value), next.max(best.min(value))]
                });
            let equal = best * (1.0 - EQUAL);
            let labels = of_point.iter().filter(|(_, value)| *value >= equal);
            let label = labels.map(|(label, _)| *label).min().unwrap_or(0);
            let lead = if series.is_none() {
                f64::INFINITY
            } else if next < equal {
                best - next
            } else {
                0.0
            };
            (label, lead)
        };
        Ok(found.iter().map(leader).collect())
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
            let found = reach.leaders(near, &[0, 1, 2, 3], (None, products), Cancel::never());
            let found = found.unwrap().into_iter();
            found.map(|(label, _)| label).collect::<Vec<u32>>()
        };
        // point 2 has label 1 from itself, and label 2 from itself and from the next; nothing comes to point 5
        assert_eq!(winners(&[1, 2, 3, 5], 3), [1, 2, 2, 0]);
        assert_eq!(winners(&[2], 1), [1]);
    }
}
