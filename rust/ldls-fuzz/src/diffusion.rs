//! Label diffusion: the series and its winners against plain products z <- A z + b in double precision.

use crate::clouds::random_cloud;
use crate::{Bytes, Outcome};
use ldls_core::{Cancel, Neighbors, PixelLabels, PointGraph, Products, Real, diffuse, likelihoods};

/// Largest error of a likelihood on the graph of a cloud, in units of the error that the diffusion itself tells, which is
/// estimated by one probe.
const TOLD: f64 = 4.0;
/// What rounding of single precision adds to it, as a share of the largest likelihood there is.
const SINGLE: f64 = 5e-5;
/// Largest change of a likelihood by one more product where a diffusion is said to have converged.
const CONVERGED: f64 = 1e-5;
/// Share of the largest likelihood of a point up to which two labels may be taken for each other: rounding of sums.
const ROUNDING: f64 = 1e-9;
/// Share of the largest seed below which a likelihood is nothing.
const NEGLIGIBLE: f64 = 1e-9;

/// The edges of points.
enum Graph {
    /// Those of the nearest neighbours of a cloud.
    Cloud {
        points: Vec<[f64; 3]>,
        neighbors: Neighbors,
        sigma: f64,
    },
    Any(Csr),
}

impl Graph {
    fn points(&self) -> usize {
        match self {
            Self::Cloud { points, .. } => points.len(),
            Self::Any(edges) => edges.offsets.len() - 1,
        }
    }

    fn weighted<T: Real>(&self) -> PointGraph<T> {
        match self {
            Self::Cloud {
                points,
                neighbors,
                sigma,
            } => PointGraph::from_neighbors(points, neighbors, *sigma, Cancel::never())
                .expect("neighbours of these points"),
            Self::Any(edges) => PointGraph::from_csr(
                edges.offsets.clone(),
                edges.columns.clone(),
                edges.weights.iter().copied().map(T::from_f64).collect(),
            )
            .expect("it is a square matrix"),
        }
    }
}

/// The arrays of a sparse matrix.
struct Csr {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
}

/// The diffusion of labels over a random graph.
///
/// # Panics
/// If likelihoods or winners are not those of plain products.
pub fn diffusion(data: &[u8]) -> Outcome {
    let mut bytes = Bytes::new(data);
    let of_cloud = bytes.below(3) > 0;
    let graph = if of_cloud {
        cloud_graph(&mut bytes)
    } else {
        Graph::Any(any_graph(&mut bytes))
    };
    let n_labels = 1 + [bytes.below(3), bytes.below(9), bytes.below(40)][bytes.below(3)];
    let (labels, mass) = random_labels(&mut bytes, graph.points(), n_labels);
    let some = [12, 300, 1200].map(|most| Some(1 + bytes.below(most)));
    let iterations = [some[0], some[1], some[2], None][bytes.below(4)];
    let (a, b) = system::<f32>(&graph, &labels, &mass);

    let (found, convergence) =
        likelihoods(&a, &b, n_labels, iterations, Cancel::never()).expect("the system fits");
    let products = iterations.unwrap_or(convergence.sweeps);
    let plain = plain_products(&a, &b, n_labels, products);
    match iterations {
        Some(_) => assert_near(&found, &plain, SINGLE, TOLD * convergence.error),
        None if convergence.converged() => {
            let z: Vec<f64> = found.iter().copied().map(f64::from).collect();
            let next = plain_product(&a, &b, n_labels, &z);
            let change = z
                .iter()
                .zip(&next)
                .map(|(x, y)| (x - y).abs())
                .fold(0.0, f64::max);
            assert!(
                change <= 1.1 * CONVERGED,
                "converged, and one product more changes {change:e}"
            );
        }
        None => assert!(
            found.iter().all(|value| value.is_finite()),
            "not converged, and not finite"
        ),
    }
    if let Some(iterations) = iterations {
        let mut products = Products::new(
            a.clone(),
            b.clone(),
            n_labels,
            Some(iterations),
            Cancel::never(),
        )
        .expect("the system fits");
        while !products.is_finished() {
            products
                .advance(1 + bytes.below(9), Cancel::never())
                .expect("nobody cancels");
        }
        let plain: Vec<f32> = plain.iter().map(|&value| value as f32).collect();
        assert_eq!(
            products.likelihoods(Cancel::never()).expect("memory"),
            plain,
            "products one by one"
        );
        if of_cloud {
            check_winners(&graph, (&labels, &mass), (&a, &b), n_labels, iterations);
        }
    }
    Outcome::Accepted
}

/// Holds the label of each point against plain products over the same graph in double precision.
fn check_winners(
    graph: &Graph,
    (labels, mass): (&Csr, &[f64]),
    (a, b): (&PointGraph, &PixelLabels),
    n_labels: usize,
    iterations: usize,
) {
    let exact = system::<f64>(graph, labels, mass);
    let plain = plain_products(&exact.0, &exact.1, n_labels, iterations);
    let weights =
        (0..labels.offsets.len() - 1).flat_map(|i| exact.1.row(i).map(|(_, weight)| weight));
    let seeds = weights.fold(0.0, f64::max);
    let found = diffuse(
        a,
        b,
        n_labels,
        Some(iterations),
        |among| {
            Ok(match among {
                Some(points) => (exact.0.among(points), exact.1.among(points)),
                None => exact.clone(),
            })
        },
        Cancel::never(),
    )
    .expect("the system fits");
    let seeds_of: Vec<Vec<(usize, f64)>> = (0..n_labels)
        .map(|label| {
            let rows = 0..labels.offsets.len() - 1;
            let own = rows.flat_map(|i| exact.1.row(i).map(move |(at, weight)| (i, at, weight)));
            let own = own.filter(|&(_, at, _)| at == label);
            own.map(|(i, _, weight)| (i, weight)).collect()
        })
        .collect();
    for (i, (row, &label)) in plain.chunks(n_labels).zip(&found.labels).enumerate() {
        let twins = |&lower: &usize| seeds_of[lower] == seeds_of[label as usize];
        let best = row.iter().copied().fold(0.0, f64::max);
        let own = row[label as usize];
        let nothing = best <= NEGLIGIBLE * seeds;
        assert!(
            own >= best - ROUNDING * best || nothing,
            "point {i} has label {label} of {own:e}, {row:?}"
        );
        let twin = (0..label as usize).find(twins);
        assert!(
            nothing || twin.is_none(),
            "point {i} has label {label}, and {twin:?} has the same seeds, {row:?}"
        );
        // of equal likelihoods the lowest label, where rounding cannot have told them apart
        let first = row.iter().position(|&value| value == best).unwrap_or(0);
        let near = row
            .iter()
            .filter(|&&value| value >= best - ROUNDING * best)
            .count();
        assert!(
            nothing || near > 1 || label as usize == first,
            "point {i} has label {label}, {row:?}"
        );
    }
}

/// Errors up to `share` of the largest value, and `more`.
fn assert_near(found: &[f32], plain: &[f64], share: f64, more: f64) {
    assert_eq!(found.len(), plain.len());
    let largest = plain.iter().copied().fold(0.0, f64::max);
    for (at, (&found, &plain)) in found.iter().zip(plain).enumerate() {
        let error = (f64::from(found) - plain).abs();
        assert!(
            error <= share * largest + more,
            "likelihood {at} is {found:e}, by plain products {plain:e}, of at most {largest:e}"
        );
    }
}

fn plain_products<T: Real>(
    a: &PointGraph<T>,
    b: &PixelLabels<T>,
    n_labels: usize,
    products: usize,
) -> Vec<f64> {
    let zeros = vec![0.0; a.len() * n_labels];
    (0..products).fold(zeros, |z, _| plain_product(a, b, n_labels, &z))
}

/// A z + b.
fn plain_product<T: Real>(
    a: &PointGraph<T>,
    b: &PixelLabels<T>,
    n_labels: usize,
    z: &[f64],
) -> Vec<f64> {
    let mut next = vec![0.0; z.len()];
    for i in 0..a.len() {
        for (label, weight) in b.row(i) {
            next[i * n_labels + label] += weight.to_f64();
        }
        for (j, weight) in a.row(i) {
            for label in 0..n_labels {
                next[i * n_labels + label] += weight.to_f64() * z[j * n_labels + label];
            }
        }
    }
    next
}

/// A and b from the weights of edges, rows that sum to 1 together.
fn system<T: Real>(graph: &Graph, labels: &Csr, mass: &[f64]) -> (PointGraph<T>, PixelLabels<T>) {
    let of =
        |values: &[f64]| -> Vec<T> { values.iter().map(|&value| T::from_f64(value)).collect() };
    let mut a = graph.weighted();
    let mut b = PixelLabels::from_csr(
        labels.offsets.clone(),
        labels.columns.clone(),
        of(&labels.weights),
        of(mass),
    )
    .expect("it is a matrix");
    a.normalize_rows(&mut b, Cancel::never())
        .expect("as many rows");
    (a, b)
}

/// The graph of a cloud's nearest neighbours.
fn cloud_graph(bytes: &mut Bytes<'_>) -> Graph {
    let mut points = random_cloud(bytes);
    points.truncate(200);
    let sigma = 10_f64.powf(bytes.between(-2.0, 2.0));
    let k = [10, 1 + bytes.below(12)][bytes.below(2)];
    let neighbors = Neighbors::search(&points, k, Cancel::never()).expect("memory");
    Graph::Cloud {
        points,
        neighbors,
        sigma,
    }
}

/// Edges from anywhere to anywhere, or a ring on which values flow more one way than the other.
fn any_graph(bytes: &mut Bytes<'_>) -> Csr {
    let n = 1 + bytes.below(120);
    let ring = bytes.below(3) == 0;
    let (drift, most) = (bytes.unit(), 1 + bytes.below(6));
    // to itself, as points of clouds have it
    let own = [0.0, 1.0][bytes.below(2)];
    let mut graph = Csr {
        offsets: vec![0],
        columns: Vec::new(),
        weights: Vec::new(),
    };
    for i in 0..n {
        let mut row: Vec<(u32, f64)> = if ring {
            vec![((i + 1) % n, 1.0), ((i + n - 1) % n, drift)]
                .into_iter()
                .map(|(j, w)| (j as u32, w))
                .collect()
        } else {
            (0..bytes.below(most + 1))
                .map(|_| (bytes.below(n) as u32, bytes.unit()))
                .collect()
        };
        row.retain(|&(j, _)| own == 0.0 || j as usize != i);
        row.extend((own > 0.0).then_some((i as u32, own)));
        row.sort_by_key(|&(j, _)| j);
        row.dedup_by_key(|&mut (j, _)| j);
        graph.columns.extend(row.iter().map(|&(j, _)| j));
        graph.weights.extend(row.iter().map(|&(_, weight)| weight));
        graph.offsets.push(graph.columns.len());
    }
    graph
}

/// Weights of pixel edges by label, and of all of them, for `points` points: none for some. Masks may be copies of others.
fn random_labels(bytes: &mut Bytes<'_>, points: usize, n_labels: usize) -> (Csr, Vec<f64>) {
    let pixel_weight = [0.001, 0.001, 1.0][bytes.below(3)];
    let share = bytes.unit();
    let originals = [n_labels, n_labels, 1 + bytes.below(n_labels.min(3))][bytes.below(3)];
    let mut labels = Csr {
        offsets: vec![0],
        columns: Vec::new(),
        weights: Vec::new(),
    };
    let mut mass = Vec::new();
    for _ in 0..points {
        let (mut largest, mut sum) = (0.0_f64, 0.0);
        let mut weights = Vec::new();
        for label in 0..originals {
            let seen = bytes.unit() < share / (1.0 + label as f64);
            weights.push(seen.then(|| pixel_weight * (1 + bytes.below(25)) as f64));
        }
        for label in 0..n_labels {
            if let Some(weight) = weights[label % originals] {
                labels.columns.push(label as u32);
                labels.weights.push(weight);
                (largest, sum) = (largest.max(weight), sum + weight);
            }
        }
        labels.offsets.push(labels.columns.len());
        // a pixel under two masks counts once, one that no mask may label counts as well
        mass.push([largest, sum, sum + pixel_weight * bytes.below(3) as f64][bytes.below(3)]);
    }
    (labels, mass)
}
