//! The part of the graph that flows to a few points.
//!
//! A step takes values one edge farther, so before the last step only the points themselves and those that they have edges
//! from matter, before the one before it those two edges away, and so on: a tenth of a frame on average. Nothing comes along edges of
//! next to no weight, which join what lies far apart.

use super::errors::AROUND;
use super::schedule::Schedule;
use crate::graph::PointGraph;
use crate::memory::{filled, push};
use crate::{Cancel, Result};

/// Share of the work of diffusing the whole graph from which on that is done instead.
const MOST_WORK: f64 = 0.5;

/// Weight of an edge along which less comes than rounding moves, as a share of the value that it would come to.
const NEGLIGIBLE: f64 = 1e-19;

/// What some points may have labels from.
#[derive(Debug)]
pub(super) struct Reach {
    /// The points themselves, then all from which edges lead to them, those of the fewest edges first. Where these are negligible, those
    /// that lead to it in turn are not asked for.
    pub(super) points: Vec<u32>,
    /// Number of points within 0, 1 and more edges.
    ends: Vec<usize>,
}

/// How far a point is part of a reach.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Eq, Ord)]
enum Met {
    Not,
    /// Next to nothing comes from there.
    Beside,
    Within,
}

impl Reach {
    /// The reach of `from`, where the `least` value is at best, and of what is [`AROUND`], in so many steps over `a`, and what the
    /// rows that they need are normalised with; none where that is much of the graph.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn of(
        a: &PointGraph,
        (from, least): (&[u32], f32),
        steps: usize,
        cancel: &Cancel,
    ) -> Result<Option<Self>> {
        let most = MOST_WORK * steps.max(1) as f64 * a.len() as f64;
        let counts = |weight: f64| weight > NEGLIGIBLE * f64::from(least);
        let mut met = filled(Met::Not, a.len(), cancel)?;
        let (mut points, mut ends) = (Vec::new(), Vec::new());
        for &point in from {
            met[point as usize] = Met::Within;
            push(&mut points, point)?;
        }
        push(&mut ends, points.len())?;
        let (mut outermost, mut work) = (points.clone(), 0);
        for _ in 0..=steps + AROUND {
            cancel.check()?;
            work += points.len();
            if work as f64 > most {
                return Ok(None);
            }
            for point in std::mem::take(&mut outermost) {
                for (column, weight) in a.row(point as usize) {
                    let met = &mut met[column];
                    if *met == Met::Not {
                        push(&mut points, column as u32)?;
                    }
                    if *met < Met::Within && counts(weight.into()) {
                        push(&mut outermost, column as u32)?;
                        *met = Met::Within;
                    }
                    *met = (*met).max(Met::Beside);
                }
            }
            push(&mut ends, points.len())?;
        }
        Ok(Some(Self { points, ends }))
    }

    /// The steps that lead to the points themselves and what is around over the graph `a` of all, in this order.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn schedule(&self, a: &PointGraph<f64>, cancel: &Cancel) -> Result<Schedule> {
        // rows of the outermost do not matter
        let steps = AROUND..self.ends.len() - 2;
        Schedule::narrowing(a, self.ends[steps].iter().rev().copied(), cancel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::chain;

    #[test]
    fn it_ends_as_many_edges_away_as_there_are_steps_and_three_more() {
        let reach = Reach::of(
            &chain(&[0.25; 90], &[]).0,
            (&[5, 2], 1.0),
            2,
            Cancel::never(),
        );
        let reach = reach.unwrap().unwrap();
        assert_eq!(reach.points, [5, 2, 6, 3, 7, 4, 8, 9, 10]);
        assert_eq!(reach.ends, [2, 4, 6, 7, 8, 9]);
    }

    #[test]
    fn it_does_not_go_on_beyond_edges_of_next_to_no_weight_unless_another_leads_there() {
        let reach = |weights: Vec<f32>, least| {
            // 0 has edges from 1 and 2, these have edges from 3 and 1, and 3 has one from 4
            let others = vec![5; 100];
            let (offsets, columns) = ([vec![0, 2, 3, 4, 5], others].concat(), vec![1, 2, 3, 1, 4]);
            let a = PointGraph::from_csr(offsets, columns, weights).unwrap();
            Reach::of(&a, (&[0], least), 200, Cancel::never())
                .unwrap()
                .unwrap()
        };
        let beside = reach(vec![1e-20, 0.5, 0.5, 1e-20, 0.5], 1.0);
        assert_eq!(
            (beside.points, beside.ends[..3].to_vec()),
            (vec![0, 1, 2], vec![1, 3, 3])
        );
        let within = reach(vec![1e-20, 0.5, 0.5, 0.5, 0.5], 1.0);
        assert_eq!(
            (within.points, within.ends[..5].to_vec()),
            (vec![0, 1, 2, 3, 4], vec![1, 3, 3, 4, 5])
        );
        let of_next_to_nothing = reach(vec![1e-20, 0.5, 0.5, 1e-20, 0.5], 1e-2);
        assert_eq!(of_next_to_nothing.points, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn what_is_much_of_the_graph_is_left_to_a_diffusion_of_all() {
        let reach = |steps| {
            Reach::of(
                &chain(&[0.25; 40], &[]).0,
                (&[0], 1.0),
                steps,
                Cancel::never(),
            )
            .unwrap()
        };
        assert!(reach(30).is_some());
        assert!(reach(200).is_none());
    }
}
