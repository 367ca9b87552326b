//! Label diffusion z <- A z + b (method, steps 5 and 6), in single precision.
//!
//! Labels are diffused a few columns at a time: memory stays the same whatever the number of instances, and no column
//! depends on which others share its sweep.

use crate::{Error, PixelLabels, PointGraph, Result};
use rayon::prelude::*;
use std::ops::Range;

/// Columns (instances) that share one sweep over the graph.
const LANES: usize = 8;
/// Rows handled by one task of the thread pool.
const BLOCK: usize = 512;
/// Where nothing changes by more in one product, the solution counts as converged.
const TOLERANCE: f32 = 1e-6;
/// Products after which an unbounded run gives up.
const MOST_PRODUCTS: usize = 100_000;

/// Values of `LANES` labels at one point.
type Lanes = [f32; LANES];

/// How far a diffusion came.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Products with the graph that the result stands for; the most of any label.
    pub products: usize,
    /// Largest change of any value in the last product.
    pub residual: f32,
}

/// The winning label of every point.
#[derive(Debug, Clone, PartialEq)]
pub struct Diffused {
    /// argmax over the labels; of equal ones the lowest.
    pub labels: Vec<u32>,
    /// Value of the winner over the sum of all values; 0 where nothing reached the point.
    pub confidence: Vec<f32>,
    /// How far the diffusion came.
    pub convergence: Convergence,
}

impl Convergence {
    /// Whether the last product changed next to nothing.
    pub fn converged(&self) -> bool {
        self.residual <= TOLERANCE
    }

    fn merge(&mut self, other: Self) {
        self.products = self.products.max(other.products);
        self.residual = self.residual.max(other.residual);
    }
}

/// Diffuses labels 0 to `n_labels` - 1 from their seeds `b` over the graph `a` and picks the winner at every point.
/// `iterations` is the number of products, `None` as many as it takes.
///
/// # Errors
/// [`Error::Mismatch`] where `b` does not fit `a` or `n_labels`.
pub fn diffuse(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
) -> Result<Diffused> {
    check(a, b, n_labels)?;
    let mut best = vec![Best::default(); a.len()];
    let mut convergence = Convergence::default();
    for_each_group(a, b, n_labels, iterations, |columns, z, group| {
        convergence.merge(group);
        best.par_iter_mut()
            .zip(z)
            .with_min_len(BLOCK)
            .for_each(|(best, values)| best.update(&columns, values));
    });
    Ok(Diffused {
        labels: best.iter().map(|best| best.label).collect(),
        confidence: best.iter().map(Best::confidence).collect(),
        convergence,
    })
}

/// The values that [`diffuse`] compares: `a.len()` rows of `n_labels`, row by row.
///
/// # Errors
/// As [`diffuse`].
pub fn likelihoods(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
) -> Result<(Vec<f32>, Convergence)> {
    check(a, b, n_labels)?;
    let mut all = vec![0.0; a.len() * n_labels];
    let mut convergence = Convergence::default();
    for_each_group(a, b, n_labels, iterations, |columns, z, group| {
        convergence.merge(group);
        for (row, values) in all.chunks_mut(n_labels).zip(z) {
            row[columns.clone()].copy_from_slice(&values[..columns.len()]);
        }
    });
    Ok((all, convergence))
}

fn check(a: &PointGraph, b: &PixelLabels, n_labels: usize) -> Result<()> {
    let mismatch = |problem: String| {
        Err(Error::Mismatch {
            name: "pixel_labels",
            problem,
        })
    };
    if b.rows() != a.len() {
        return mismatch(format!("{} rows, the graph has {}", b.rows(), a.len()));
    }
    match b.labels.iter().find(|&&label| label as usize >= n_labels) {
        Some(label) => mismatch(format!("label {label}, expected labels below {n_labels}")),
        None => Ok(()),
    }
}

/// Calls `done` with each group of labels, their values and how far they came.
fn for_each_group(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
    mut done: impl FnMut(Range<usize>, &[Lanes], Convergence),
) {
    for first in (0..n_labels).step_by(LANES) {
        let columns = first..n_labels.min(first + LANES);
        let seeds = dense_seeds(b, &columns);
        let (z, convergence) = repeat_products(a, &seeds, iterations);
        done(columns, &z, convergence);
    }
}

fn dense_seeds(b: &PixelLabels, columns: &Range<usize>) -> Vec<Lanes> {
    let dense_row = |i| {
        let mut row = [0.0; LANES];
        for (label, weight) in b.row(i).filter(|(label, _)| columns.contains(label)) {
            row[label - columns.start] = weight;
        }
        row
    };
    (0..b.rows())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(dense_row)
        .collect()
}

fn repeat_products(
    a: &PointGraph,
    b: &[Lanes],
    iterations: Option<usize>,
) -> (Vec<Lanes>, Convergence) {
    // from z = 0 the first product yields b
    let mut z = b.to_vec();
    let mut next = vec![[0.0; LANES]; b.len()];
    let mut convergence = Convergence {
        products: 1,
        residual: b.par_iter().map(largest).reduce(|| 0.0, f32::max),
    };
    let enough = |found: Convergence| match iterations {
        Some(products) => found.products == products,
        None => found.converged() || found.products == MOST_PRODUCTS,
    };
    while !enough(convergence) {
        convergence.products += 1;
        convergence.residual = product(a, b, &z, &mut next);
        std::mem::swap(&mut z, &mut next);
    }
    (z, convergence)
}

/// Writes A z + b to `next` and returns the largest change.
fn product(a: &PointGraph, b: &[Lanes], z: &[Lanes], next: &mut [Lanes]) -> f32 {
    next.par_chunks_mut(BLOCK)
        .enumerate()
        .map(|(block, rows)| {
            let mut change = 0.0_f32;
            for (i, row) in (block * BLOCK..).zip(rows) {
                // one row, one thread: sums keep their order, so results do too
                let mut sum = b[i];
                for (j, weight) in a.row(i) {
                    for (sum, value) in sum.iter_mut().zip(&z[j]) {
                        *sum += weight * value;
                    }
                }
                change = change.max(largest_difference(&sum, &z[i]));
                *row = sum;
            }
            change
        })
        .reduce(|| 0.0, f32::max)
}

fn largest(values: &Lanes) -> f32 {
    largest_difference(values, &[0.0; LANES])
}

fn largest_difference(a: &Lanes, b: &Lanes) -> f32 {
    a.iter()
        .zip(b)
        .fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

/// The best label of a point so far.
#[derive(Debug, Clone, Copy, Default)]
struct Best {
    label: u32,
    value: f32,
    sum: f32,
}

impl Best {
    fn update(&mut self, columns: &Range<usize>, values: &Lanes) {
        for (label, &value) in columns.clone().zip(values) {
            self.sum += value;
            if value > self.value {
                self.value = value;
                self.label = label as u32;
            }
        }
    }

    fn confidence(&self) -> f32 {
        if self.sum > 0.0 {
            self.value / self.sum
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points, each joined to the other with weight 1/4 and to its own pixel with weight 1/2.
    fn pair() -> (PointGraph, PixelLabels) {
        let a = PointGraph::from_csr(vec![0, 2, 4], vec![0, 1, 0, 1], vec![0.25; 4]).unwrap();
        let b = PixelLabels {
            offsets: vec![0, 1, 2],
            labels: vec![0, 1],
            weights: vec![0.5; 2],
            mass: vec![0.5; 2],
        };
        (a, b)
    }

    #[test]
    fn the_first_product_yields_the_seeds_and_the_second_mixes_them() {
        let (a, b) = pair();
        assert_eq!(
            likelihoods(&a, &b, 2, Some(1)).unwrap().0,
            [0.5, 0.0, 0.0, 0.5]
        );
        assert_eq!(
            likelihoods(&a, &b, 2, Some(2)).unwrap().0,
            [0.625, 0.125, 0.125, 0.625]
        );
    }

    #[test]
    fn without_a_bound_it_runs_to_the_fixed_point() {
        let (a, b) = pair();
        let (z, convergence) = likelihoods(&a, &b, 2, None).unwrap();
        assert!(convergence.converged() && convergence.products > 10);
        for (value, expected) in z.iter().zip([0.75, 0.25, 0.25, 0.75]) {
            assert!((value - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn equal_values_go_to_the_lowest_label() {
        let (a, mut b) = pair();
        b.labels = vec![9, 2];
        b.offsets = vec![0, 2, 2];
        let diffused = diffuse(&a, &b, 20, Some(30)).unwrap();
        assert_eq!(diffused.labels, [2, 2]);
        assert_eq!(diffused.confidence, [0.5, 0.5]);
    }

    #[test]
    fn a_point_that_nothing_reaches_is_background_without_confidence() {
        let a = PointGraph::from_csr(vec![0, 1], vec![0], vec![1.0]).unwrap();
        let b = PixelLabels {
            offsets: vec![0, 0],
            labels: vec![],
            weights: vec![],
            mass: vec![0.0],
        };
        let diffused = diffuse(&a, &b, 3, Some(5)).unwrap();
        assert_eq!((diffused.labels[0], diffused.confidence[0]), (0, 0.0));
    }
}
