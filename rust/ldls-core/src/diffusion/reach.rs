//! The likelihoods of a few points in double precision, by the part of the graph that flows to them.
//!
//! The value of label l at point i is row i of a polynomial of A, times column l of b: of 1 + A + ... + A^(T - 1) after T
//! products, or of the series that stands for it. That row is a one at i diffused backwards, along the edges of each point
//! that it has come to, and ends as many edges away as the polynomial has powers. So few points need few rows of A and b,
//! and all labels come from one vector.

use super::series::Series;
use super::sweep::Step;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{filled, push, zeros};
use crate::{Cancel, Real, Result};
use rayon::prelude::*;

/// Most work, in sweeps of one label over the whole graph, before it is diffused as a whole instead.
const MOST_SWEEPS: usize = 32;
/// Share of the largest value within which values are equal: what a series and rounding leave of equal ones.
const EQUAL: f64 = 1e-13;

/// What some points may have labels from.
#[derive(Debug)]
pub(super) struct Reach {
    /// The terms of the polynomial, each by the two before it.
    terms: Vec<Step<f64>>,
    /// The points themselves, then all from which edges lead to them, those of the fewest edges first.
    pub(super) points: Vec<u32>,
    /// Number of points within 0, 1 and more edges.
    ends: Vec<usize>,
}

impl Reach {
    /// The reach of `from` in so many products over `a`, or in the `series` that stands for them, and what the rows that
    /// they need are normalised with; none where that is much of a large graph.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn of<T: Real>(
        a: &PointGraph<T>,
        from: &[u32],
        products: usize,
        series: Option<&Series>,
        cancel: &Cancel,
    ) -> Result<Option<Self>> {
        let terms = series.map_or_else(|| powers(products), chebyshev_terms);
        let most = MOST_SWEEPS.saturating_mul(a.len());
        let mut met = filled(false, a.len(), cancel)?;
        let (mut points, mut ends) = (Vec::new(), Vec::new());
        for &point in from {
            met[point as usize] = true;
            push(&mut points, point)?;
        }
        push(&mut ends, points.len())?;
        let (mut first, mut work) = (0, 0);
        for _ in &terms {
            cancel.check()?;
            let last = points.len();
            work += from.len() * last;
            if work > most {
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
        Ok(Some(Self {
            terms,
            points,
            ends,
        }))
    }

    /// The label that wins at each of the first `count` points, of equal ones the lowest. `a` and `b` are of `self.points`,
    /// in this order; rows of the outermost of them do not matter.
    pub(super) fn winners(
        &self,
        (a, b): (&PointGraph<f64>, &PixelLabels<f64>),
        n_labels: usize,
        count: usize,
        cancel: &Cancel,
    ) -> Result<Vec<u32>> {
        let winner = |point| {
            cancel.check()?;
            let values = self.values(a, b, n_labels, point, cancel)?;
            let best = values.iter().copied().fold(0.0, f64::max);
            let first = values
                .iter()
                .position(|&value| value >= best * (1.0 - EQUAL));
            Ok(first.unwrap_or(0) as u32)
        };
        (0..count).into_par_iter().map(winner).collect()
    }

    /// Likelihoods of all labels at the point in this place of `self.points`, which is one of those asked for.
    fn values(
        &self,
        a: &PointGraph<f64>,
        b: &PixelLabels<f64>,
        n_labels: usize,
        point: usize,
        cancel: &Cancel,
    ) -> Result<Vec<f64>> {
        let size = self.points.len();
        // a term, and the one before it, whose place the next one takes
        let (mut term, mut before) = (zeros(size, cancel)?, zeros(size, cancel)?);
        term[point] = 1.0;
        let mut sum = zeros(size, cancel)?;
        sum[point] = self.terms[0].seeds;
        for (step, ends) in self.terms[1..].iter().zip(self.ends.windows(2)) {
            cancel.check()?;
            let next = before[..ends[1]].iter_mut().zip(&term);
            next.for_each(|(next, term)| *next = -step.stay * term - step.back * *next);
            for (at, share) in term[..ends[0]].iter().enumerate() {
                for (column, weight) in a.row(at) {
                    before[column] += step.along * share * weight;
                }
            }
            std::mem::swap(&mut term, &mut before);
            let sums = sum[..ends[1]].iter_mut().zip(&term);
            sums.for_each(|(sum, term)| *sum += step.seeds * term);
        }
        let within = self.ends[self.terms.len() - 1];
        let mut values = vec![0.0; n_labels];
        for (at, share) in sum[..within].iter().enumerate() {
            for (label, weight) in b.row(at) {
                values[label] += share * weight;
            }
        }
        Ok(values)
    }
}

/// The terms of 1 + A + A^2 and so on.
fn powers(count: usize) -> Vec<Step<f64>> {
    let power = Step {
        seeds: 1.0,
        along: 1.0,
        stay: 0.0,
        back: 0.0,
    };
    vec![power; count]
}

/// The terms of a series: `T_k = 2 X T_(k-1) - T_(k-2)`, after 1 and X = (A - middle) / half width.
fn chebyshev_terms(series: &Series) -> Vec<Step<f64>> {
    let term = |(k, &seeds): (usize, &f64)| {
        let [times, back] = if k < 2 { [1.0, 0.0] } else { [2.0, 1.0] };
        Step {
            seeds,
            along: times / series.half_width,
            stay: times * series.middle / series.half_width,
            back,
        }
    };
    series.coefficients.iter().enumerate().map(term).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain whose every point has edges to itself and to the next one, the last to itself alone.
    fn chain(n: u32) -> PointGraph<f64> {
        let rows = (0..n).map(|i| if i + 1 < n { vec![i, i + 1] } else { vec![i] });
        let rows: Vec<Vec<u32>> = rows.collect();
        let offsets = (0..=n as usize).map(|i| rows[..i].iter().map(Vec::len).sum());
        let columns = rows.concat();
        let weights = vec![0.25; columns.len()];
        PointGraph::from_csr(offsets.collect(), columns, weights).unwrap()
    }

    #[test]
    fn it_ends_as_many_edges_away_as_there_are_products() {
        let reach = Reach::of(&chain(9), &[5, 2], 2, None, Cancel::never())
            .unwrap()
            .unwrap();
        assert_eq!(reach.points, [5, 2, 6, 3, 7, 4]);
        assert_eq!(reach.ends, [2, 4, 6]);
    }

    #[test]
    fn what_is_much_of_the_graph_is_left_to_a_diffusion_of_all() {
        let reach =
            |products| Reach::of(&chain(40), &[0], products, None, Cancel::never()).unwrap();
        assert!(reach(30).is_some());
        assert!(reach(200).is_none());
    }

    #[test]
    fn winners_are_those_of_the_products_and_of_equal_labels_the_lowest() {
        let a = chain(6);
        let b = PixelLabels {
            offsets: vec![0, 1, 2, 4, 5, 6, 6],
            labels: vec![3, 1, 1, 2, 2, 0],
            weights: vec![0.01, 0.5, 0.5, 0.5, 0.5, 0.75],
            mass: vec![1.0; 6],
        };
        let from = [1, 2, 3, 5];
        let reach = Reach::of(&a, &from, 3, None, Cancel::never())
            .unwrap()
            .unwrap();
        let (near_a, near_b) = (a.among(&reach.points), b.among(&reach.points));
        let found = reach.winners((&near_a, &near_b), 4, from.len(), Cancel::never());
        // point 2 has label 1 from itself, and label 2 from itself and from the next; nothing comes to point 5
        assert_eq!(found.unwrap(), [1, 2, 2, 0]);
        let one = Reach::of(&a, &[2], 1, None, Cancel::never())
            .unwrap()
            .unwrap();
        let near = (&a.among(&one.points), &b.among(&one.points));
        assert_eq!(one.winners(near, 4, 1, Cancel::never()).unwrap(), [1]);
    }
}
