//! The part of the graph that flows to a few points.
//!
//! A step takes values one edge farther, so before the last step only the points themselves and those that they have edges
//! from matter, before the one before it those two edges away, and so on: a tenth of a frame on average.

use super::schedule::Schedule;
use crate::graph::PointGraph;
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

    /// The steps that lead to the points themselves over the graph `a` of all, in this order.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn schedule(&self, a: &PointGraph<f64>, cancel: &Cancel) -> Result<Schedule> {
        // rows of the outermost do not matter
        let steps = self.ends.len() - 2;
        Schedule::narrowing(a, self.ends[..steps].iter().rev().copied(), cancel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::chain;

    #[test]
    fn it_ends_as_many_edges_away_as_there_are_steps_and_one_more() {
        let reach = Reach::of(&chain(&[0.25; 90], &[]).0, &[5, 2], 2, Cancel::never());
        let reach = reach.unwrap().unwrap();
        assert_eq!(reach.points, [5, 2, 6, 3, 7, 4, 8]);
        assert_eq!(reach.ends, [2, 4, 6, 7]);
    }

    #[test]
    fn what_is_much_of_the_graph_is_left_to_a_diffusion_of_all() {
        let reach =
            |steps| Reach::of(&chain(&[0.25; 40], &[]).0, &[0], steps, Cancel::never()).unwrap();
        assert!(reach(30).is_some());
        assert!(reach(200).is_none());
    }
}
