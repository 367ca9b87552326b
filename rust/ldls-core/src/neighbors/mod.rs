//! The K nearest neighbours of every point, exactly.
//!
//! Distances are those of double precision; of equally distant points the one of lower index is nearer.

mod adjacency;
mod candidates;
mod coincident;
mod kdtree;
mod keys;
mod leaf_search;
mod lone_search;

pub(crate) use adjacency::Adjacency;
pub(crate) use candidates::squared_distance;
pub(crate) use kdtree::arrange;

use crate::memory::zeros;
use crate::{Cancel, Error, Result};
use kdtree::KdTree;
use rayon::prelude::*;

/// Points handled by one task of the thread pool, or between two looks at the flag.
const POINTS_A_TASK: usize = 4096;

/// The `k` nearest other points of every point, nearest first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Neighbors {
    /// Neighbours a point: what was asked for, or one less than there are points.
    pub k: usize,
    /// Neighbours of point i at `i * k..(i + 1) * k`.
    pub indices: Vec<u32>,
}

impl Neighbors {
    /// The `k` nearest neighbours of each of `points`, finite coordinates in metres; the point itself is none
    /// of them.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub fn search(points: &[[f64; 3]], k: usize, cancel: &Cancel) -> Result<Self> {
        let adjacency = search(points, k, cancel)?;
        let (order, k) = (&adjacency.order, adjacency.degree - 1);
        let mut indices = zeros(points.len() * k, cancel)?;
        if k > 0 {
            let rows = adjacency.columns.chunks(adjacency.degree);
            for (at, (&index, row)) in order.iter().zip(rows).enumerate() {
                if at % POINTS_A_TASK == 0 {
                    cancel.check()?;
                }
                let slots = &mut indices[index as usize * k..][..k];
                for (slot, &position) in slots.iter_mut().zip(&row[1..]) {
                    *slot = order[position as usize];
                }
            }
        }
        Ok(Self { k, indices })
    }

    /// Squared distances of the neighbours of `points`, in square metres, in the order of `indices`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub fn squared_distances(&self, points: &[[f64; 3]], cancel: &Cancel) -> Result<Vec<f64>> {
        let mut squared = zeros(self.indices.len(), cancel)?;
        let entries = self.k.max(1) * POINTS_A_TASK;
        let tasks = squared
            .par_chunks_mut(entries)
            .zip(self.indices.par_chunks(entries))
            .zip(points.par_chunks(POINTS_A_TASK));
        tasks.try_for_each(|((squared, indices), own)| {
            cancel.check()?;
            for (at, (squared, &j)) in squared.iter_mut().zip(indices).enumerate() {
                *squared = squared_distance(&own[at / self.k], &points[j as usize]);
            }
            Ok::<(), Error>(())
        })?;
        Ok(squared)
    }
}

/// The `k` nearest neighbours of each of `points`, finite coordinates in metres; all others where there are fewer.
pub(crate) fn search(points: &[[f64; 3]], k: usize, cancel: &Cancel) -> Result<Adjacency> {
    let tree = KdTree::new(points, cancel)?;
    if coincident::is_crowded(&tree) {
        drop(tree);
        return coincident::search(points, k, cancel);
    }
    Adjacency::search(tree, points, k, cancel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::num::NonZero;

    fn nearest(points: &[[f64; 3]], k: usize) -> Neighbors {
        Neighbors::search(points, k, Cancel::never()).unwrap()
    }

    fn brute_force(points: &[[f64; 3]], k: usize) -> Neighbors {
        let k = k.min(points.len().saturating_sub(1));
        let mut neighbors = Neighbors {
            k,
            indices: Vec::new(),
        };
        for (i, from) in points.iter().enumerate() {
            let others = (0..points.len()).filter(|&j| j != i);
            let mut row: Vec<(f64, usize)> = others
                .map(|j| (squared_distance(from, &points[j]), j))
                .collect();
            row.sort_by(|a, b| a.partial_cmp(b).unwrap());
            neighbors
                .indices
                .extend(row[..k].iter().map(|&(_, j)| j as u32));
        }
        neighbors
    }

    /// Coordinates on a lattice of `step` metres: ties and coincident points abound.
    fn quantised(step: f64, most: usize) -> impl Strategy<Value = Vec<[f64; 3]>> {
        let axis = || (-8_i32..8).prop_map(move |c| f64::from(c) * step);
        proptest::collection::vec([axis(), axis(), axis()], 0..most)
    }

    proptest! {
        #[test]
        fn quantised_clouds_equal_brute_force(points in quantised(0.25, 600), k in 1_usize..14) {
            prop_assert_eq!(nearest(&points, k), brute_force(&points, k));
        }

        #[test]
        fn crowded_clouds_equal_brute_force(
            points in quantised(4.0, 400), copies in 1_usize..30, k in 1_usize..40, seed in any::<u64>(),
        ) {
            let mut all: Vec<[f64; 3]> = points.iter().take(400 / copies).flat_map(|p| vec![*p; copies]).collect();
            // copies lie anywhere in a cloud
            all.sort_by_key(|p| (p[0] as i64).wrapping_mul(seed as i64 | 1) % 7);
            prop_assert_eq!(nearest(&all, k), brute_force(&all, k));
        }

        #[test]
        fn flat_clouds_equal_brute_force(mut points in quantised(0.1, 600), axis in 0_usize..3) {
            for point in &mut points {
                point[axis] = -0.0;
            }
            prop_assert_eq!(nearest(&points, 10), brute_force(&points, 10));
        }

        #[test]
        fn scattered_clouds_equal_brute_force(
            points in proptest::collection::vec([-9.0..9.0_f64, -9.0..9.0, -2.0..2.0], 0..600),
            k in prop_oneof![Just(1_usize), Just(10), Just(11), Just(12), Just(30), Just(100), Just(255)],
            far in prop_oneof![Just(0.0), Just(5e6)],
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + far, p[1] - far, p[2]]).collect();
            prop_assert_eq!(nearest(&points, k), brute_force(&points, k));
        }

        #[test]
        fn clouds_of_single_precision_equal_brute_force(
            points in proptest::collection::vec([-9.0..9.0_f32, -9.0..9.0, -2.0..2.0], 0..600),
            // squares of the second are not normal in single precision
            unit in prop_oneof![Just(1.0), Just(2.0_f32.powi(-74))],
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| f64::from(c * unit))).collect();
            prop_assert_eq!(nearest(&points, 10), brute_force(&points, 10));
        }
    }

    /// The squared distances that kiddo, an independent k-d tree, finds: with equal distances, it may name other points.
    fn distances_of_kiddo(points: &[[f64; 3]], k: usize) -> Vec<f64> {
        let tree = kiddo::ImmutableKdTree::<f64, 3>::new_from_slice(points).unwrap();
        // the point itself, or another one at its place, is the nearest
        let wanted = NonZero::new(k + 1).unwrap();
        let of_point = |point: &[f64; 3]| {
            let query = tree.query(point);
            let nearest = query.nearest_n::<kiddo::SquaredEuclidean<f64>>(wanted);
            nearest.execute().into_iter().skip(1)
        };
        let items = points.iter().flat_map(of_point);
        items.map(|item| item.distance).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn distances_are_those_of_an_independent_tree(
            points in proptest::collection::vec([-9.0..9.0_f64, -9.0..9.0, -2.0..2.0], 40..3000),
            k in 1_usize..30, far in prop_oneof![Just(0.0), Just(5e5)],
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + far, p[1] - far, p[2]]).collect();
            let distances = nearest(&points, k).squared_distances(&points, Cancel::never()).unwrap();
            let expected = distances_of_kiddo(&points, k);
            prop_assert_eq!(distances.len(), expected.len());
            // kiddo may add squares in another order
            for (distance, expected) in distances.iter().zip(&expected) {
                prop_assert!((distance - expected).abs() <= 4.0 * f64::EPSILON * expected);
            }
        }
    }

    #[test]
    fn coincident_points_are_each_others_neighbours() {
        let points = vec![[1.0, 2.0, 3.0]; 120_000];
        let neighbors = nearest(&points, 10);
        assert_eq!(neighbors.indices[..10], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        assert_eq!(
            neighbors.indices[119_999 * 10..],
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
        );
    }

    #[test]
    fn coincident_points_are_duplicates_and_islands() {
        let points = vec![[1.0, 2.0, 3.0]; 120_000];
        let adjacency = search(&points, 10, Cancel::never()).unwrap();
        assert_eq!(adjacency.duplicates(), 120_000);
        assert!(adjacency.only_islands());
    }

    #[test]
    fn a_lattice_equals_brute_force_at_its_corners() {
        let side = |c: usize| (c as f64) * 0.5;
        let points: Vec<[f64; 3]> = (0..125_000)
            .map(|i| [side(i % 50), side(i / 50 % 50), side(i / 2500)])
            .collect();
        let neighbors = nearest(&points, 3);
        assert_eq!(neighbors.indices[..3], [1, 50, 2500]);
        assert_eq!(
            neighbors.indices[3 * 124_999..],
            [122_499, 124_949, 124_998]
        );
    }

    #[test]
    fn fewer_points_than_neighbours_are_joined_to_all_others() {
        let points = [[0.0; 3], [1.0; 3], [3.0; 3]];
        assert_eq!(nearest(&points, 10).indices, [1, 2, 0, 2, 1, 0]);
        assert_eq!(nearest(&[[0.0; 3]], 10), Neighbors::default());
    }
}
