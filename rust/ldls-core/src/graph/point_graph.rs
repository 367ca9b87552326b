//! The point graph as a sparse matrix (method, steps 3 and 4).

use crate::masks::PixelLabels;
use crate::memory::{collect, tabulate, with_room, zeros};
use crate::neighbors::{Adjacency, Neighbors, squared_distance};
use crate::{Cancel, Error, Real, Result};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Rows handled by one task of the thread pool.
const ROWS_A_TASK: usize = 1024;

/// Share of a weight up to which that of the way back may differ by the rounding of single precision.
const SAME_WEIGHT: f64 = 1e-5;

/// Weighted edges between points in compressed sparse rows: row i lists the points that label flows
/// from to point i.
#[derive(Debug, Clone, PartialEq)]
pub struct PointGraph<T = f32> {
    layout: Layout,
    /// Shared by the graphs of one cloud in both precisions.
    columns: Arc<Vec<u32>>,
    weights: Vec<T>,
}

/// The layout of the rows of a sparse matrix.
#[derive(Debug, Clone, PartialEq)]
enum Layout {
    /// All of one length.
    Uniform { count: usize, degree: usize },
    /// Row i at `offsets[i]..offsets[i + 1]`.
    Varied { offsets: Vec<usize> },
}

impl Layout {
    fn count(&self) -> usize {
        match self {
            Self::Uniform { count, .. } => *count,
            Self::Varied { offsets } => offsets.len() - 1,
        }
    }

    #[inline(always)]
    fn range(&self, rows: Range<usize>) -> Range<usize> {
        match self {
            Self::Uniform { degree, .. } => rows.start * degree..rows.end * degree,
            Self::Varied { offsets } => offsets[rows.start]..offsets[rows.end],
        }
    }
}

impl<T: Real> PointGraph<T> {
    /// The graph in which each of `points` (metres) is joined to itself with weight 1 and to its
    /// neighbours with weight exp(-d^2 / `sigma`). Rows are not normalised.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `neighbors` is of other points, [`Error::OutOfMemory`] and [`Error::Cancelled`].
    pub fn from_neighbors(
        points: &[[f64; 3]],
        neighbors: &Neighbors,
        sigma: f64,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (n, k) = (points.len(), neighbors.k);
        if neighbors.indices.len() != n * k || neighbors.indices.iter().any(|&j| j as usize >= n) {
            let problem = format!("expected {k} numbers below {n} for each of {n} points");
            return Err(Error::Mismatch {
                name: "neighbors",
                problem,
            });
        }
        let mut columns = with_room(n * (k + 1))?;
        for i in 0..n {
            columns.push(i as u32);
            columns.extend_from_slice(&neighbors.indices[i * k..(i + 1) * k]);
        }
        let adjacency = Adjacency {
            order: Vec::new(),
            points: collect(points.iter().copied(), cancel)?,
            degree: k + 1,
            columns: Arc::new(columns),
        };
        Self::from_adjacency(&adjacency, sigma, cancel)
    }

    /// The same graph from rows that begin with the point itself.
    pub(crate) fn from_adjacency(
        adjacency: &Adjacency,
        sigma: f64,
        cancel: &Cancel,
    ) -> Result<Self> {
        let points = &adjacency.points;
        let (count, degree) = (points.len(), adjacency.degree);
        let mut weights = zeros(count * degree, cancel)?;
        let tasks = weights
            .par_chunks_mut(degree * ROWS_A_TASK)
            .zip(adjacency.columns.par_chunks(degree * ROWS_A_TASK))
            .zip(points.par_chunks(ROWS_A_TASK));
        tasks.try_for_each(|((weights, columns), own)| {
            cancel.check()?;
            let rows = weights
                .chunks_mut(degree)
                .zip(columns.chunks(degree))
                .zip(own);
            for ((weights, columns), point) in rows {
                for (weight, &j) in weights.iter_mut().zip(columns) {
                    let squared = squared_distance(point, &points[j as usize]);
                    *weight = T::from_f64(-squared / sigma);
                }
            }
            T::exp(weights);
            Ok::<(), Error>(())
        })?;
        Ok(Self {
            layout: Layout::Uniform { count, degree },
            columns: Arc::clone(&adjacency.columns),
            weights,
        })
    }

    /// Multiplies the weights of edges between a point of the ground and one that is not by `factor`.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `ground` does not say of each point whether it belongs to the ground, and
    /// [`Error::Cancelled`].
    pub fn weaken_ground_edges(
        &mut self,
        ground: &[bool],
        factor: f64,
        cancel: &Cancel,
    ) -> Result<()> {
        if ground.len() != self.len() {
            let problem = format!(
                "{} values, the graph has {} points",
                ground.len(),
                self.len()
            );
            return Err(Error::Mismatch {
                name: "ground",
                problem,
            });
        }
        let range = |rows| self.layout.range(rows);
        let weaken = |i: usize, weights: &mut [T]| {
            let edges = weights.iter_mut().zip(&self.columns[range(i..i + 1)]);
            for (weight, _) in edges.filter(|(_, j)| ground[**j as usize] != ground[i]) {
                *weight = T::from_f64(weight.to_f64() * factor);
            }
        };
        for_each_row(&mut self.weights, ground.len(), range, weaken, cancel)
    }

    /// A graph from the three arrays of a sparse matrix.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the arrays do not describe a square matrix of finite weights.
    pub fn from_csr(offsets: Vec<usize>, columns: Vec<u32>, weights: Vec<T>) -> Result<Self> {
        let mismatch = |problem: String| {
            Err(Error::Mismatch {
                name: "graph",
                problem,
            })
        };
        let entries = columns.len();
        let ascending = offsets.first() == Some(&0) && offsets.is_sorted();
        if !ascending || offsets.last() != Some(&entries) {
            let problem = format!("indptr must ascend from 0 to the number of entries, {entries}");
            return mismatch(problem);
        }
        if entries != weights.len() {
            return mismatch(format!(
                "{entries} column indices but {} weights",
                weights.len()
            ));
        }
        let n = offsets.len() - 1;
        if let Some(column) = columns.iter().find(|&&column| column as usize >= n) {
            let problem = format!("column {column} in {n} rows, expected a square matrix");
            return mismatch(problem);
        }
        if let Some(at) = weights
            .iter()
            .position(|weight| !weight.to_f64().is_finite())
        {
            return mismatch(format!(
                "entry {at} is {:?}, expected finite weights",
                weights[at]
            ));
        }
        Ok(Self {
            layout: Layout::Varied { offsets },
            columns: Arc::new(columns),
            weights,
        })
    }

    /// Divides every row, point edges and pixel edges together, by its sum.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `labels` is of another number of points, [`Error::OutOfMemory`] and
    /// [`Error::Cancelled`].
    pub fn normalize_rows(&mut self, labels: &mut PixelLabels<T>, cancel: &Cancel) -> Result<()> {
        if labels.rows() != self.len() {
            let problem = format!("{} rows, the graph has {}", labels.rows(), self.len());
            return Err(Error::Mismatch {
                name: "pixel_labels",
                problem,
            });
        }
        let scale = |i: usize| {
            let edges = &self.weights[self.layout.range(i..i + 1)];
            let sum = edges.iter().map(|w| w.to_f64()).sum::<f64>() + labels.mass[i].to_f64();
            // a row without edges stays empty rather than become NaN
            if sum > 0.0 { 1.0 / sum } else { 0.0 }
        };
        let scales = tabulate(self.len(), scale, cancel)?;
        let range = |rows| self.layout.range(rows);
        scale_rows(&mut self.weights, &scales, range, cancel)?;
        let range = |rows: Range<usize>| labels.offsets[rows.start]..labels.offsets[rows.end];
        scale_rows(&mut labels.weights, &scales, range, cancel)?;
        labels
            .mass
            .iter_mut()
            .zip(&scales)
            .for_each(|(mass, scale)| rescale(mass, *scale));
        Ok(())
    }

    /// The rows of `points`, in their order, with the edges that lead from one of them to another.
    #[must_use]
    pub fn among(&self, points: &[u32]) -> Self {
        let mut place = vec![u32::MAX; self.len()];
        for (at, &point) in (0..).zip(points) {
            place[point as usize] = at;
        }
        let (mut offsets, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for &point in points {
            for (column, weight) in self.row(point as usize) {
                if place[column] != u32::MAX {
                    columns.push(place[column]);
                    weights.push(weight);
                }
            }
            offsets.push(columns.len());
        }
        Self {
            layout: Layout::Varied { offsets },
            columns: Arc::new(columns),
            weights,
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.layout.count()
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Edges of each point, if it is known that all have as many, of which the first is to itself.
    pub(crate) fn degree(&self) -> Option<usize> {
        match self.layout {
            Layout::Uniform { degree, .. } => Some(degree),
            Layout::Varied { .. } => None,
        }
    }

    /// True if this may be the graph of a cloud, normalised or not: no weight is negative or more than that of the point's edge
    /// to itself, and two points with edges to each other are as near to each other.
    pub(crate) fn may_be_of_cloud(&self) -> bool {
        if self.degree().is_some() {
            return true;
        }
        let weight = |from: usize, to: usize| {
            let edges = self.row(from).filter(|(column, _)| *column == to);
            edges.map(|(_, weight)| weight.to_f64()).sum::<f64>()
        };
        let row_may_be = |i: usize| {
            let own = weight(i, i);
            self.row(i).all(|(j, there)| {
                let (there, back) = (there.to_f64() / own, weight(j, i) / weight(j, j));
                let differ = (there - back).abs() > SAME_WEIGHT * there;
                (0.0..=1.0 + SAME_WEIGHT).contains(&there) && !(back > 0.0 && differ)
            })
        };
        let rows = (0..self.len()).into_par_iter().with_min_len(ROWS_A_TASK);
        rows.map(row_may_be).all(|may_be| may_be)
    }

    /// Weight of the first edge of row `i`, which in the graph of a cloud is to the point itself: by how much normalising
    /// has multiplied the row.
    pub(crate) fn own_weight(&self, i: usize) -> T {
        self.slices(i..i + 1).1[0]
    }

    /// Columns and weights of row `i`.
    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, T)> {
        let (columns, weights) = self.slices(i..i + 1);
        columns
            .iter()
            .map(|&column| column as usize)
            .zip(weights.iter().copied())
    }

    /// Columns and weights of `rows`, row after row.
    #[inline(always)]
    pub(crate) fn slices(&self, rows: Range<usize>) -> (&[u32], &[T]) {
        let range = self.layout.range(rows);
        (&self.columns[range.clone()], &self.weights[range])
    }

    /// Row starts, column indices and weights.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] and [`Error::Cancelled`].
    pub fn into_csr(self, cancel: &Cancel) -> Result<(Vec<usize>, Vec<u32>, Vec<T>)> {
        let offsets = match self.layout {
            Layout::Varied { offsets } => offsets,
            Layout::Uniform { count, degree } => tabulate(count + 1, |i| i * degree, cancel)?,
        };
        let columns = Arc::try_unwrap(self.columns)
            .or_else(|shared| collect(shared.iter().copied(), cancel))?;
        Ok((offsets, columns, self.weights))
    }
}

/// Multiplies the values of each row, which lie at `range` of it, by its scale.
fn scale_rows<T: Real>(
    values: &mut [T],
    scales: &[f64],
    range: impl Fn(Range<usize>) -> Range<usize> + Sync,
    cancel: &Cancel,
) -> Result<()> {
    let scale = |i: usize, row: &mut [T]| {
        for value in row {
            rescale(value, scales[i]);
        }
    };
    for_each_row(values, scales.len(), range, scale, cancel)
}

/// Calls `work` with each of `count` rows and its values, which lie at `range` of it, on all threads of the pool.
fn for_each_row<T: Real>(
    mut values: &mut [T],
    count: usize,
    range: impl Fn(Range<usize>) -> Range<usize> + Sync,
    work: impl Fn(usize, &mut [T]) + Sync,
    cancel: &Cancel,
) -> Result<()> {
    let mut tasks = Vec::with_capacity(count.div_ceil(ROWS_A_TASK));
    for first in (0..count).step_by(ROWS_A_TASK) {
        let rows = first..count.min(first + ROWS_A_TASK);
        let (head, tail) = values.split_at_mut(range(rows.clone()).len());
        tasks.push((head, rows));
        values = tail;
    }
    tasks.into_par_iter().try_for_each(|(values, rows)| {
        cancel.check()?;
        let start = range(rows.start..rows.start).start;
        for i in rows {
            let row = range(i..i + 1);
            work(i, &mut values[row.start - start..row.end - start]);
        }
        Ok(())
    })
}

fn rescale<T: Real>(value: &mut T, scale: f64) {
    *value = T::from_f64(value.to_f64() * scale);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> PointGraph {
        let points: Vec<[f64; 3]> = (0..4).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        let neighbors = Neighbors::search(&points, 2, Cancel::never()).unwrap();
        PointGraph::from_neighbors(&points, &neighbors, 2.0, Cancel::never()).unwrap()
    }

    #[test]
    fn weights_fall_with_the_squared_distance() {
        let row: Vec<_> = chain().row(0).collect();
        let weight = |d2: f32| (-d2 / 2.0).exp();
        assert_eq!(row, [(0, 1.0), (1, weight(1.0)), (2, weight(4.0))]);
    }

    #[test]
    fn rows_sum_to_one_with_their_pixel_edges() {
        let mut labels = PixelLabels {
            offsets: vec![0, 1, 1, 1, 1],
            labels: vec![1],
            weights: vec![0.5],
            mass: vec![0.5; 4],
        };
        let mut graph = chain();
        graph.normalize_rows(&mut labels, Cancel::never()).unwrap();
        for i in 0..4 {
            let sum: f32 = graph.row(i).map(|(_, weight)| weight).sum::<f32>() + labels.mass[i];
            assert!((sum - 1.0).abs() < 1e-6, "row {i} sums to {sum}");
        }
        assert_eq!(labels.weights[0], labels.mass[0]);
    }

    #[test]
    fn arrays_that_are_no_square_matrix_are_refused() {
        for (offsets, columns, weights) in [
            (vec![], vec![], vec![]),
            (vec![0, 2], vec![0], vec![1.0]),
            (vec![0, 1], vec![1], vec![1.0]),
            (vec![0, 1], vec![0], vec![f32::NAN]),
            (vec![0, 1], vec![0], vec![]),
        ] {
            assert!(PointGraph::from_csr(offsets, columns, weights).is_err());
        }
    }
}
