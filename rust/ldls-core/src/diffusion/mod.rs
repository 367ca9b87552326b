//! Label diffusion z <- A z + b (method, steps 5 and 6).
//!
//! The products are not run one by one: their result is a polynomial of A times b, which a Chebyshev series
//! reaches with a third of the sweeps, in single precision. Both leave an error, which is estimated; where two
//! labels are nearer to one another than that and seeds alone do not show which wins, the point is decided in double
//! precision: by the part of the graph that flows to it, or where that is much, by diffusing such labels again. Where the
//! graph is such that no series can be trusted, the products are run as they stand.

mod convergence;
mod errors;
mod lane_order;
mod lanes;
mod leaders;
mod near_ties;
mod pass;
mod passes;
mod phases;
mod plan;
mod products;
mod reach;
mod schedule;
mod seeds;
mod series;
mod spread;
mod sweep;
mod values;
mod winners;

pub use convergence::Convergence;
pub use products::Products;

use self::errors::Errors;
use self::lanes::WIDTH_F32;
use self::pass::Pass;
use self::passes::for_each_pass;
use self::winners::Winners;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{tabulate, zeros};
use crate::{Cancel, Result};
use std::mem::take;

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

/// Diffuses labels 0 to `n_labels` - 1 from their seeds `b` over the graph `a` and picks the winner at every
/// point. `iterations` is the number of products, `None` as many as it takes. `exact` yields `a` and `b` in
/// double precision, for points at which single precision cannot decide: the rows of all points, or of those given, with
/// the edges among them, where rows are normalised with all their edges as far as these lead to points given.
///
/// # Errors
/// [`crate::Error::Mismatch`] where `b` does not fit `a` or `n_labels`, [`crate::Error::OutOfMemory`],
/// [`crate::Error::Cancelled`], and whatever `exact` returns.
pub fn diffuse(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
    exact: impl Fn(Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    cancel: &Cancel,
) -> Result<Diffused> {
    b.check(a.len(), n_labels)?;
    let labels: Vec<u32> = (0..n_labels as u32).collect();
    let (mut winners, mut estimates, mut error) = (Winners::default(), Vec::new(), 0.0);
    let choose = |pass: &mut Pass<f32, WIDTH_F32>| {
        error = pass.convergence.error.max(error);
        winners.update(pass, error, cancel)?;
        if !pass.errors.is_empty() {
            estimates = take(&mut pass.errors);
        }
        Ok(())
    };
    let (mut convergence, trusted, schedule) =
        for_each_pass(a, b, &labels, iterations, cancel, choose)?;
    convergence.refined = near_ties::decide(
        (a, b, &schedule),
        &mut winners,
        (&Errors { a, estimates }, convergence.error),
        (iterations, trusted.first()),
        exact,
        cancel,
    )?;
    let best = winners.best;
    Ok(Diffused {
        labels: tabulate(best.len(), |i| best[i].label, cancel)?,
        confidence: tabulate(best.len(), |i| best[i].confidence(), cancel)?,
        convergence,
    })
}

/// The likelihoods that [`diffuse`] compares, in single precision: `a.len()` rows of `n_labels`, row by row.
///
/// # Errors
/// As [`diffuse`].
pub fn likelihoods(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
    cancel: &Cancel,
) -> Result<(Vec<f32>, Convergence)> {
    b.check(a.len(), n_labels)?;
    let mut all = zeros(a.len().saturating_mul(n_labels), cancel)?;
    let labels: Vec<u32> = (0..n_labels as u32).collect();
    let write = |pass: &mut Pass<f32, WIDTH_F32>| {
        for (point, row) in all.chunks_mut(n_labels).enumerate() {
            for (label, value) in pass.at(point) {
                row[label as usize] = value;
            }
        }
        Ok(())
    };
    let (convergence, ..) = for_each_pass(a, b, &labels, iterations, cancel, write)?;
    Ok((all, convergence))
}

#[cfg(test)]
mod tests {
    use super::passes::TOLERANCE;
    use super::series::Series;
    use super::*;
    use crate::Real;
    use crate::neighbors::Neighbors;
    use crate::test_support::pair;
    use proptest::prelude::*;

    fn never(_: Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)> {
        panic!("single precision tells the winner")
    }

    #[test]
    fn the_first_product_yields_the_seeds_and_the_second_mixes_them() {
        let (a, b) = pair();
        assert_eq!(
            likelihoods(&a, &b, 2, Some(1), Cancel::never()).unwrap().0,
            [0.5, 0.0, 0.0, 0.5]
        );
        assert_eq!(
            likelihoods(&a, &b, 2, Some(2), Cancel::never()).unwrap().0,
            [0.625, 0.125, 0.125, 0.625]
        );
    }

    #[test]
    fn without_a_bound_it_runs_to_the_fixed_point() {
        let (a, b) = pair();
        let (z, convergence) = likelihoods(&a, &b, 2, None, Cancel::never()).unwrap();
        assert!(convergence.converged());
        for (value, expected) in z.iter().zip([0.75, 0.25, 0.25, 0.75]) {
            assert!((value - expected).abs() < 1e-5);
        }
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
        let diffused = diffuse(&a, &b, 3, Some(5), never, Cancel::never()).unwrap();
        assert_eq!((diffused.labels[0], diffused.confidence[0]), (0, 0.0));
    }

    #[test]
    fn a_graph_on_which_the_series_diverges_gets_its_products() {
        // a ring that passes values on: eigenvalues lie on a circle, far from any real interval
        let n = 1000_u32;
        let columns = (0..n).map(|i| (i + 1) % n).collect();
        let a =
            PointGraph::from_csr((0..=n as usize).collect(), columns, vec![0.99; 1000]).unwrap();
        let b = PixelLabels {
            offsets: (0..=n as usize).collect(),
            labels: (0..n).map(|i| i / 100).collect(),
            weights: vec![0.01; 1000],
            mass: vec![0.01; 1000],
        };
        let (z, convergence) = likelihoods(&a, &b, 10, Some(200), Cancel::never()).unwrap();
        assert!(convergence.sweeps >= 200);
        let expected: f64 = (0..100).map(|k| 0.01 * 0.99_f64.powi(k)).sum();
        assert!((f64::from(z[0]) - expected).abs() < 1e-5);
    }

    fn plain_products(
        a: &PointGraph<f64>,
        b: &PixelLabels<f64>,
        n_labels: usize,
        iterations: usize,
    ) -> Vec<f64> {
        let mut z = vec![0.0; a.len() * n_labels];
        for _ in 0..iterations {
            let mut next = vec![0.0; z.len()];
            for i in 0..a.len() {
                for (label, weight) in b.row(i) {
                    next[i * n_labels + label] = weight;
                }
                for (j, weight) in a.row(i) {
                    for label in 0..n_labels {
                        next[i * n_labels + label] += weight * z[j * n_labels + label];
                    }
                }
            }
            z = next;
        }
        z
    }

    fn assert_within(found: &[f32], expected: &[f64], most: f64) {
        let differences = found.iter().zip(expected);
        let differences = differences.map(|(found, expected)| (f64::from(*found) - expected).abs());
        let largest = differences.fold(0.0, f64::max);
        assert!(largest < most, "likelihoods differ by {largest}");
    }

    type System<T> = (PointGraph<T>, PixelLabels<T>);

    /// A and b of `points`, each joined to `k` others, of which each sees `pixels` windows of two labels, in both precisions.
    fn system<T: Real>(
        points: &[[f64; 3]],
        k: usize,
        seen: &[(u32, u32)],
        lambda: f64,
    ) -> System<T> {
        let neighbors = Neighbors::search(points, k, Cancel::never()).unwrap();
        let mut a = PointGraph::from_neighbors(points, &neighbors, 1.0, Cancel::never()).unwrap();
        let mut b = PixelLabels {
            offsets: vec![0],
            labels: vec![],
            weights: vec![],
            mass: vec![],
        };
        for &(label, count) in seen {
            for (label, count) in [(0, 25 - count), (label, count)] {
                if count > 0 {
                    b.labels.push(label);
                    b.weights.push(T::from_f64(lambda * f64::from(count)));
                }
            }
            b.offsets.push(b.labels.len());
            b.mass.push(T::from_f64(lambda * 25.0));
        }
        a.normalize_rows(&mut b, Cancel::never()).unwrap();
        (a, b)
    }

    #[test]
    fn a_large_cloud_whose_labels_share_lanes_gets_the_likelihoods_of_plain_products() {
        // a strip, and far points that are joined to both of its ends
        let strip = (0..100_000).map(|i| [f64::from(i / 20), f64::from(i % 20), 0.0]);
        let far = (0..40).map(|i| [2500.0, 3000.0 + f64::from(i % 2), f64::from(i)]);
        let points: Vec<[f64; 3]> = strip.chain(far).collect();
        let seen: Vec<(u32, u32)> = (0..points.len() as u32)
            .map(|i| (1 + i / 9000 % 12, i % 26))
            .collect();
        let (a, b) = system::<f32>(&points, 10, &seen, 0.01);
        let (found, _) = likelihoods(&a, &b, 13, Some(60), Cancel::never()).unwrap();
        let (a, b) = system::<f64>(&points, 10, &seen, 0.01);
        let expected = plain_products(&a, &b, 13, 60);
        assert_within(&found, &expected, 1e-5);
    }

    /// Points of a strip of 20 times 100, and what each sees.
    fn strip() -> (Vec<[f64; 3]>, Vec<(u32, u32)>) {
        let of_point = |i: u32| {
            let point = [f64::from(i / 20), f64::from(i % 20), 0.0];
            (point, (1 + i / 200 % 9, i % 26))
        };
        (0..2000).map(of_point).unzip()
    }

    #[test]
    fn many_products_in_legs_yield_the_likelihoods_of_plain_products() {
        let (points, seen) = strip();
        let (a, b) = system::<f32>(&points, 10, &seen, 1e-4);
        // three legs, and two products left
        let (found, convergence) = likelihoods(&a, &b, 10, Some(701), Cancel::never()).unwrap();
        assert!(convergence.sweeps < 250);
        let (a, b) = system::<f64>(&points, 10, &seen, 1e-4);
        let expected = plain_products(&a, &b, 10, 701);
        assert_within(&found, &expected, 5e-6);
    }

    #[test]
    fn small_seeds_have_not_converged_where_a_product_changes_as_much_as_they() {
        let (points, seen) = strip();
        let (a, b) = system::<f32>(&points, 10, &seen, 1e-7);
        let (_, convergence) = likelihoods(&a, &b, 10, None, Cancel::never()).unwrap();
        assert!(convergence.residual.unwrap() < 1e-5);
        assert!(!convergence.converged() && convergence.sweeps > 10_000);
    }

    #[test]
    fn endlessly_many_products_are_taken_in_legs_where_their_series_would_grow() {
        let (points, seen) = strip();
        let (a, b) = system::<f32>(&points, 10, &seen, 1e-3);
        let (found, convergence) = likelihoods(&a, &b, 10, None, Cancel::never()).unwrap();
        assert!(convergence.converged() && convergence.sweeps < 700);
        let (a, b) = system::<f64>(&points, 10, &seen, 1e-3);
        let expected = plain_products(&a, &b, 10, 4000);
        assert_within(&found, &expected, 1e-3);
    }

    fn clouds() -> impl Strategy<Value = Vec<[f64; 3]>> {
        let scattered = proptest::collection::vec([-5.0..5.0_f64, -5.0..5.0, -1.0..1.0], 1..400);
        let graded = (
            proptest::collection::vec((0.0..1.0_f64, 0.0..6.3_f64), 1..400),
            4.0..=8.0_f64,
            0.5..=2.0_f64,
        )
            .prop_map(|(points, powers, highest)| {
                // density falls by orders of magnitude with the distance from the origin
                points
                    .iter()
                    .map(|&(share, angle)| (10_f64.powf(highest - powers * share), angle))
                    .map(|(r, angle)| [r * angle.cos(), r * angle.sin(), 0.0])
                    .collect()
            });
        let nested = proptest::collection::vec((0_i32..5, 0_i32..9), 1..400).prop_map(|points| {
            // clusters within clusters, coincident points among them
            points
                .iter()
                .map(|&(level, place)| {
                    let size = 0.1_f64.powi(level);
                    [
                        f64::from(place % 3) * size,
                        f64::from(place / 3) * size,
                        size,
                    ]
                })
                .collect()
        });
        let coincident = (1_usize..40, 1_usize..30).prop_map(|(places, copies)| {
            (0..places * copies)
                .map(|i| [(i / copies) as f64 * 0.3, 0.0, 0.0])
                .collect()
        });
        // neighbours that next to nothing comes from
        let apart = proptest::collection::vec(0.0..6.0_f64, 1..400).prop_map(|steps| {
            let places = steps.iter().scan(0.0, |x, step| {
                *x += step;
                Some(*x)
            });
            places.map(|x| [x, 0.0, 0.0]).collect()
        });
        prop_oneof![scattered, graded, nested, coincident, apart]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn labels_equal_those_of_plain_products_in_double_precision(
            points in clouds(),
            seen in proptest::collection::vec((1_u32..30, 0_u32..26), 1200),
            k in prop_oneof![Just(5_usize), Just(10), Just(20)],
            iterations in prop_oneof![Just(1_usize), Just(20), Just(200), Just(500), Just(1000)],
            lambda in prop_oneof![Just(0.001), Just(0.1), Just(1e-5)],
        ) {
            let seen = &seen[..points.len()];
            let (a, b) = system::<f32>(&points, k, seen, lambda);
            let exact = system::<f64>(&points, k, seen, lambda);
            let double = |among: Option<&[u32]>| Ok(match among {
                Some(points) => (exact.0.among(points), exact.1.among(points)),
                None => exact.clone(),
            });
            let found = diffuse(&a, &b, 30, Some(iterations), double, Cancel::never()).unwrap();
            let (a, b) = system::<f64>(&points, k, seen, lambda);
            let expected = plain_products(&a, &b, 30, iterations);
            for (i, (label, z)) in found.labels.iter().zip(expected.chunks(30)).enumerate() {
                let best = z.iter().fold(0.0, |best: f64, &z| best.max(z));
                prop_assert!(
                    z[*label as usize] >= best * (1.0 - 1e-11),
                    "point {} has label {} with {:e}, the best has {:e}", i, label, z[*label as usize], best
                );
            }
        }
    }

    /// Lets two labels of these numbers share the points of a lattice at random, and compares winners with those of plain products.
    fn assert_told_apart(
        (points, k): (&[[f64; 3]], usize),
        numbers: [u32; 2],
        (iterations, lambda): (usize, f64),
    ) {
        let of_point = |i: usize| (i as u32).wrapping_mul(0x9e37_79b1) >> 20 & 1;
        let seen = |numbers: [u32; 2]| -> Vec<(u32, u32)> {
            let of_point = |i| (numbers[of_point(i) as usize], 25);
            (0..points.len()).map(of_point).collect()
        };
        let (a, b) = system::<f32>(points, k, &seen(numbers), lambda);
        let exact = system::<f64>(points, k, &seen(numbers), lambda);
        let double = |among: Option<&[u32]>| {
            Ok(among.map_or(exact.clone(), |points| {
                (exact.0.among(points), exact.1.among(points))
            }))
        };
        let n_labels = 1 + numbers[1] as usize;
        let found = diffuse(&a, &b, n_labels, Some(iterations), double, Cancel::never()).unwrap();
        let (a, b) = system::<f64>(points, k, &seen([0, 1]), lambda);
        let expected = plain_products(&a, &b, 2, iterations);
        for (i, (label, z)) in found.labels.iter().zip(expected.chunks(2)).enumerate() {
            let own = numbers.iter().position(|number| number == label).unwrap();
            let best = z[0].max(z[1]);
            assert!(
                z[own] >= best * (1.0 - 1e-11),
                "{numbers:?}: point {i} has {label}"
            );
        }
    }

    fn lattice(size: u32, pitch: f64, layers: u32) -> Vec<[f64; 3]> {
        let places =
            (0..size * size * layers).map(|i| [i % size, i / size % size, i / size / size]);
        places
            .map(|place| place.map(|steps| pitch * f64::from(steps)))
            .collect()
    }

    #[test]
    fn labels_that_share_points_are_told_apart_where_terms_grow_whatever_their_numbers() {
        let points = lattice(40, 0.39, 1);
        for other in [2, 14, 22, 35, 90] {
            assert_told_apart((&points, 4), [1, other], (200, 4e-5));
        }
    }

    #[test]
    fn labels_whose_values_a_series_makes_negative_may_win() {
        let corners = lattice(8, 0.316, 8);
        let middles = corners.iter().map(|place| place.map(|at| at + 0.158));
        let points: Vec<[f64; 3]> = corners.iter().copied().chain(middles).collect();
        assert_told_apart((&points, 8), [1, 2], (70, 4e-7));
    }

    #[test]
    fn a_series_that_grows_without_end_on_a_ring_of_one_way_is_given_up() {
        // of the edges of a point, which all weigh the same, more lead one way than the other; few points have pixel edges
        let (n, forward, back) = (9, 25, 24);
        let edges = (0..n).flat_map(|i| {
            let others = std::iter::repeat_n((i + 1) % n, forward);
            others.chain(std::iter::repeat_n((i + n - 1) % n, back))
        });
        let neighbors = Neighbors {
            k: forward + back,
            indices: edges.collect(),
        };
        let points = vec![[0.0; 3]; n as usize];
        let a = PointGraph::from_neighbors(&points, &neighbors, 1.0, Cancel::never());
        let b = PixelLabels {
            offsets: vec![0, 1, 2, 2, 2, 2, 3, 3, 3, 3],
            labels: vec![0; 3],
            weights: vec![0.6, 0.45, 0.1],
            mass: vec![0.6, 0.45, 0.05, 0.0, 0.0, 0.1, 0.0, 0.0, 0.05],
        };
        let (mut a, mut b) = (a.unwrap(), b);
        a.normalize_rows(&mut b, Cancel::never()).unwrap();
        assert!(!Series::of_graph(&a, None, TOLERANCE).is_empty());
        let [plain, endless] = [Some(MANY), None].map(|iterations| {
            let found = likelihoods(&a, &b, 1, iterations, Cancel::never());
            found.unwrap().0
        });
        for (endless, plain) in endless.iter().zip(&plain) {
            assert!((endless - plain).abs() < 0.01, "{endless} for {plain}");
        }
    }

    /// Products after which next to nothing changes.
    const MANY: usize = 20_000;
}
