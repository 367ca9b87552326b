//! The point graph as a sparse matrix (method, steps 3 and 4).

use crate::{Error, Neighbors, PixelLabels, Result};
use rayon::prelude::*;

/// Rows handled by one task of the thread pool.
const BLOCK: usize = 1024;

/// Weighted edges between points in compressed sparse rows: row i lists the points that label flows from to point i.
#[derive(Debug, Clone, PartialEq)]
pub struct PointGraph {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f32>,
}

impl PointGraph {
    /// The graph in which each of `n` points is joined to itself with weight 1 and to its neighbours with weight
    /// exp(-d^2 / `sigma`), d in metres. Rows are not normalised.
    pub fn from_neighbors(n: usize, neighbors: &Neighbors, sigma: f64) -> Self {
        let k = neighbors.k;
        let degree = k + 1;
        let mut columns = vec![0; n * degree];
        let mut weights = vec![0.0; n * degree];
        columns
            .par_chunks_mut(degree)
            .zip(weights.par_chunks_mut(degree))
            .with_min_len(BLOCK)
            .enumerate()
            .for_each(|(i, (columns, weights))| {
                columns[0] = i as u32;
                weights[0] = 1.0;
                let edges = i * k..(i + 1) * k;
                columns[1..].copy_from_slice(&neighbors.indices[edges.clone()]);
                for (weight, &d2) in weights[1..]
                    .iter_mut()
                    .zip(&neighbors.squared_distances[edges])
                {
                    *weight = (-f64::from(d2) / sigma).exp() as f32;
                }
            });
        Self {
            offsets: (0..=n).map(|i| i * degree).collect(),
            columns,
            weights,
        }
    }

    /// A graph from the three arrays of a sparse matrix.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the arrays do not describe a square matrix of finite weights.
    pub fn from_csr(offsets: Vec<usize>, columns: Vec<u32>, weights: Vec<f32>) -> Result<Self> {
        let mismatch = |problem: String| {
            Err(Error::Mismatch {
                name: "graph",
                problem,
            })
        };
        let ascending = offsets.first() == Some(&0)
            && offsets.is_sorted()
            && offsets.last() == Some(&columns.len());
        if !ascending {
            return mismatch(format!(
                "indptr must ascend from 0 to the number of entries, {}",
                columns.len()
            ));
        }
        if columns.len() != weights.len() {
            return mismatch(format!(
                "{} column indices but {} weights",
                columns.len(),
                weights.len()
            ));
        }
        let n = offsets.len() - 1;
        if let Some(column) = columns.iter().find(|&&column| column as usize >= n) {
            return mismatch(format!(
                "column index {column} in a matrix of {n} rows, expected a square matrix"
            ));
        }
        if let Some(at) = weights.iter().position(|weight| !weight.is_finite()) {
            return mismatch(format!(
                "entry {at} is {}, expected finite weights",
                weights[at]
            ));
        }
        Ok(Self {
            offsets,
            columns,
            weights,
        })
    }

    /// Divides every row, point edges and pixel edges together, by its sum.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `labels` is of another number of points.
    pub fn normalize_rows(&mut self, labels: &mut PixelLabels) -> Result<()> {
        if labels.rows() != self.len() {
            let problem = format!("{} rows, the graph has {}", labels.rows(), self.len());
            return Err(Error::Mismatch {
                name: "pixel_labels",
                problem,
            });
        }
        for i in 0..self.len() {
            let edges = &mut self.weights[self.offsets[i]..self.offsets[i + 1]];
            let pixels = &mut labels.weights[labels.offsets[i]..labels.offsets[i + 1]];
            let sum = edges.iter().map(|&w| f64::from(w)).sum::<f64>() + f64::from(labels.mass[i]);
            // a row without edges stays empty rather than become NaN
            let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            let normalise = |weight: &mut f32| *weight = (f64::from(*weight) * scale) as f32;
            edges.iter_mut().for_each(normalise);
            pixels.iter_mut().for_each(normalise);
            normalise(&mut labels.mass[i]);
        }
        Ok(())
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Columns and weights of row `i`.
    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f32)> {
        let range = self.offsets[i]..self.offsets[i + 1];
        self.columns[range.clone()]
            .iter()
            .map(|&column| column as usize)
            .zip(self.weights[range].iter().copied())
    }

    /// Row starts, column indices and weights.
    pub fn into_csr(self) -> (Vec<usize>, Vec<u32>, Vec<f32>) {
        (self.offsets, self.columns, self.weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain() -> PointGraph {
        let points: Vec<[f64; 3]> = (0..4).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        PointGraph::from_neighbors(4, &Neighbors::search(&points, 2), 2.0)
    }

    #[test]
    fn weights_fall_with_the_squared_distance() {
        let row: Vec<_> = chain().row(0).collect();
        let weight = |d2: f64| (-d2 / 2.0).exp() as f32;
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
        graph.normalize_rows(&mut labels).unwrap();
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
