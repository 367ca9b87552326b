//! Graphs on which a series leaves the likelihoods of plain products, unseen by the probe: what is then noticed of the
//! values themselves.

use ldls_core::{Cancel, PixelLabels, PointGraph, likelihoods};

const POINTS: usize = 400;
const PRODUCTS: usize = 200;

/// A ring on which values flow more one way than the other, by `drift`: its eigenvalues leave the real axis. Row i leaves
/// `mass(i)` to its pixels, of which labels 0 and 1 have `seed(i)` each; their signs in the probe cancel.
fn ring(
    drift: f32,
    mass: impl Fn(usize) -> f32,
    seed: impl Fn(usize) -> f32,
) -> (PointGraph, PixelLabels) {
    let edges = |i: usize| [i, (i + 1) % POINTS, (i + POINTS - 1) % POINTS].map(|j| j as u32);
    let weights = |i: usize| {
        let flow = 0.999 * (1.0 - mass(i));
        [
            0.001 * (1.0 - mass(i)),
            flow * (0.5 + drift),
            flow * (0.5 - drift),
        ]
    };
    let a = PointGraph::from_csr(
        (0..=POINTS).map(|i| 3 * i).collect(),
        (0..POINTS).flat_map(edges).collect(),
        (0..POINTS).flat_map(weights).collect(),
    );
    let b = PixelLabels::from_csr(
        (0..=POINTS).map(|i| 2 * i).collect(),
        (0..POINTS).flat_map(|_| [0, 1]).collect(),
        (0..POINTS).flat_map(|i| [seed(i); 2]).collect(),
        (0..POINTS).map(mass).collect(),
    );
    (a.unwrap(), b.unwrap())
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
    let (error, sweeps) = error_and_sweeps(&ring(0.03, |_| 0.02, |_| 0.01));
    assert!(
        error < 1e-4 && sweeps < PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}

#[test]
fn likelihoods_that_sum_to_more_than_the_seeds_allow_are_given_up_for_products() {
    let mass = |i: usize| if i % 4 < 2 { 0.2 } else { 0.02 };
    let (error, sweeps) = error_and_sweeps(&ring(0.13, mass, |i| mass(i) / 2.0));
    assert!(
        error < 1e-5 && sweeps == PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}

#[test]
fn negative_likelihoods_are_given_up_for_products() {
    let seed = |i: usize| if i % 100 < 2 { 0.005 } else { 0.0 };
    let (error, sweeps) = error_and_sweeps(&ring(0.11, |_| 0.02, seed));
    assert!(
        error < 1e-5 && sweeps == PRODUCTS,
        "{error} in {sweeps} sweeps"
    );
}
