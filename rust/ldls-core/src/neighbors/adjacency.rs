//! Each point and its nearest neighbours as one row, by their positions in the order of a tree. The weights of
//! these edges are the business of [`crate::graph`].

use super::kdtree::{FAN, KdTree};
use super::leaf_search::search_leaf;
use rayon::prelude::*;
use std::sync::Arc;

/// Leaves handled by one task of the thread pool.
const LEAVES_A_TASK: usize = 16;
/// Places of a list beyond the neighbours and the point itself.
const SPARE: usize = 4;

/// The points themselves and their nearest neighbours, as positions in the order of a tree.
#[derive(Debug, Clone)]
pub(crate) struct Adjacency {
    /// Length of a row: the neighbours and the point itself.
    pub(crate) degree: usize,
    /// Row after row, each the point itself first, then its neighbours, the nearest first.
    pub(crate) columns: Arc<Vec<u32>>,
}

impl Adjacency {
    /// The `k` nearest neighbours of `points`, which are in the order of their `tree`.
    pub(crate) fn search(tree: &KdTree, points: &[[f64; 3]], k: usize) -> Self {
        let degree = k.min(points.len().saturating_sub(1)) + 1;
        let mut columns = vec![0; points.len() * degree];
        let tasks = columns
            .par_chunks_mut(degree * FAN * LEAVES_A_TASK)
            .enumerate();
        tasks.for_each(|(task, rows)| {
            let mut places = degree + SPARE;
            for (leaf, rows) in (task * LEAVES_A_TASK..).zip(rows.chunks_mut(degree * FAN)) {
                for (position, row) in (leaf * FAN..).zip(rows.chunks_mut(degree)) {
                    row[0] = position as u32;
                }
                if degree > 1 {
                    places = search_leaf(tree, points, degree, leaf, places, rows);
                }
            }
        });
        Self {
            degree,
            columns: Arc::new(columns),
        }
    }

    /// Number of `points` that share their place with another one.
    pub(crate) fn duplicates(&self, points: &[[f64; 3]]) -> usize {
        self.coincident(points, 1)
            .filter(|&coincident| coincident)
            .count()
    }

    /// Whether all neighbours of every one of `points` share its place, so that the graph falls into islands.
    pub(crate) fn only_islands(&self, points: &[[f64; 3]]) -> bool {
        self.degree > 1
            && self
                .coincident(points, self.degree - 1)
                .all(|coincident| coincident)
    }

    /// Whether the neighbour of each point at `rank` lies where the point lies; empty where there is none.
    fn coincident(&self, points: &[[f64; 3]], rank: usize) -> impl Iterator<Item = bool> {
        let rows = self
            .columns
            .chunks(self.degree)
            .filter(move |row| row.len() > rank);
        rows.zip(points)
            .map(move |(row, point)| *point == points[row[rank] as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coincident_points_are_duplicates_and_islands() {
        let points = vec![[1.0, 2.0, 3.0]; 120_000];
        let tree = KdTree::new(&points);
        let adjacency = Adjacency::search(&tree, &points, 10);
        assert_eq!(adjacency.duplicates(&points), 120_000);
        assert!(adjacency.only_islands(&points));
    }
}
