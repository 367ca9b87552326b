//! Graphs on which a series leaves the likelihoods of plain products, and is given up for them.

use ldls_core::{Cancel, Neighbors, PixelLabels, PointGraph, likelihoods};

const POINTS: usize = 400;
const PRODUCTS: usize = 200;

/// Edges of a row to other points.
const EDGES: usize = 60;

/// A ring of points at one place that names `forward` of the edges of each the next point and the others the one before: its
/// eigenvalues leave the real axis. Row i leaves `mass(i)` to its pixels, of which labels 0 and 1 have `seed(i)` each.
fn ring(
    forward: usize,
    mass: impl Fn(usize) -> f32,
    seed: impl Fn(usize) -> f32,
) -> (PointGraph, PixelLabels) {
    let edges = |i: usize| {
        let next = std::iter::repeat_n((i + 1) % POINTS, forward);
        next.chain(std::iter::repeat_n(
            (i + POINTS - 1) % POINTS,
            EDGES - forward,
        ))
    };
    let neighbors = Neighbors {
        k: EDGES,
        indices: (0..POINTS).flat_map(edges).map(|j| j as u32).collect(),
    };
    let a = PointGraph::from_neighbors(&[[0.0; 3]; POINTS], &neighbors, 1.0, Cancel::never());
    // against the weight 1 of each edge, that to itself included
    let raw = |i: usize| (EDGES + 1) as f32 / (1.0 - mass(i));
    let b = PixelLabels::from_csr(
        (0..=POINTS).map(|i| 2 * i).collect(),
        (0..POINTS).flat_map(|_| [0, 1]).collect(),
        (0..POINTS).flat_map(|i| [raw(i) * seed(i); 2]).collect(),
        (0..POINTS).map(|i| raw(i) * mass(i)).collect(),
    );
    let (mut a, mut b) = (a.unwrap(), b.unwrap());
    a.normalize_rows(&mut b, Cancel::never()).unwrap();
    (a, b)
}

/// The largest difference of likelihoods from plain products in double precision, and the sweeps that they took.
fn error_and_sweeps((a, b): &(PointGraph, PixelLabels)) -> (f64, usize) {
    let (found, convergence) = likelihoods(a, b, 2, Some(PRODUCTS), Cancel::never()).unwrap();
    let mut z = vec![[0.0; 2]; POINTS];
    for _ in 0..PRODUCTS {
        let row = |i: usize| {
            [0, 1].map(|label| {
                let seed: f64 = b
                    .row(i)
                    .filter(|&(l, _)| l == label)
                    .map(|(_, w)| f64::from(w))
                    .sum();
                let flows = a.row(i).map(|(j, weight)| f64::from(weight) * z[j][label]);
                seed + flows.sum::<f64>()
            })
        };
        z = (0..POINTS).map(row).collect();
    }
    let pairs = found.iter().zip(z.as_flattened());
    let errors = pairs.map(|(found, expected)| (f64::from(*found) - expected).abs());
    (errors.fold(0.0, f64::max), convergence.sweeps)
}

#[test]
fn a_series_serves_where_eigenvalues_lie_near_the_real_axis() {
    let (error, sweeps) = error_and_sweeps(&ring(32, |_| 0.02, |_| 0.01));
    assert!(
        error < 1e-4 && sweeps < PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}

#[test]
fn likelihoods_that_sum_to_more_than_the_seeds_allow_are_given_up_for_products() {
    let mass = |i: usize| if i % 4 < 2 { 0.2 } else { 0.02 };
    let (error, sweeps) = error_and_sweeps(&ring(38, mass, |i| mass(i) / 2.0));
    assert!(
        error < 1e-5 && sweeps == PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}

#[test]
fn negative_likelihoods_are_given_up_for_products() {
    let seed = |i: usize| if i % 100 < 2 { 0.005 } else { 0.0 };
    let (error, sweeps) = error_and_sweeps(&ring(37, |_| 0.02, seed));
    assert!(
        error < 1e-5 && sweeps == PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}
