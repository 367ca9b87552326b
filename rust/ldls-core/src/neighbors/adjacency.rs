//! The rows of the point graph: each point and its nearest neighbours, in an order in which near points are near in
//! memory.

use super::kdtree::{FAN, KdTree, arrange};
use super::leaf_search::search_leaf;
use crate::memory::{filled, zeros};
use crate::{Cancel, Error, Result};
use rayon::prelude::*;
use std::sync::Arc;

/// Leaves handled by one task of the thread pool.
const LEAVES_A_TASK: usize = 16;
/// Fewest rows for a task of the thread pool.
const ROWS_A_TASK: usize = 512;
/// Places of a list beyond the neighbours and the point itself.
const SPARE: usize = 4;

/// Points in the order of a tree, and the nearest neighbours of each, by their positions in that order.
#[derive(Debug, Clone)]
pub(crate) struct Adjacency {
    /// Index of the point at each position.
    pub(crate) order: Vec<u32>,
    /// Coordinates of the points in this order, in metres.
    pub(crate) points: Vec<[f64; 3]>,
    /// Length of a row: the neighbours and the point itself.
    pub(crate) degree: usize,
    /// Row after row, each the point itself first, then its neighbours, the nearest first.
    pub(crate) columns: Arc<Vec<u32>>,
}

impl Adjacency {
    /// The `k` nearest neighbours of each of `points`, of which `tree` is made; all others where there are fewer.
    pub(super) fn search(
        tree: KdTree,
        points: &[[f64; 3]],
        k: usize,
        cancel: &Cancel,
    ) -> Result<Self> {
        let points = arrange(&tree.order, points, cancel)?;
        let degree = k.min(points.len().saturating_sub(1)) + 1;
        let mut columns = zeros(points.len() * degree, cancel)?;
        let tasks = columns
            .par_chunks_mut(degree * FAN * LEAVES_A_TASK)
            .enumerate();
        tasks.try_for_each(|(task, rows)| {
            cancel.check()?;
            let mut places = degree + SPARE;
            for (leaf, rows) in (task * LEAVES_A_TASK..).zip(rows.chunks_mut(degree * FAN)) {
                for (position, row) in (leaf * FAN..).zip(rows.chunks_mut(degree)) {
                    row[0] = position as u32;
                }
                if degree > 1 {
                    places = search_leaf(&tree, &points, degree, leaf, places, rows);
                }
            }
            Ok::<(), Error>(())
        })?;
        Ok(Self {
            order: tree.order,
            points,
            degree,
            columns: Arc::new(columns),
        })
    }

    /// The rows of the points at some `places`, in this order. Rows of which not all points are among them begin with the
    /// point itself as ever, and hold it in the place of the others.
    pub(crate) fn among(&self, places: &[u32], cancel: &Cancel) -> Result<Self> {
        let mut new = filled(u32::MAX, self.points.len(), cancel)?;
        for (at, &place) in (0..).zip(places) {
            new[place as usize] = at;
        }
        let mut columns = zeros(places.len() * self.degree, cancel)?;
        let rows = columns.par_chunks_mut(self.degree).zip(places).enumerate();
        rows.with_min_len(ROWS_A_TASK)
            .for_each(|(at, (row, &place))| {
                let before = &self.columns[place as usize * self.degree..][..self.degree];
                for (column, &before) in row.iter_mut().zip(before) {
                    let known = new[before as usize];
                    *column = if known == u32::MAX { at as u32 } else { known };
                }
            });
        Ok(Self {
            order: arrange(places, &self.order, cancel)?,
            points: arrange(places, &self.points, cancel)?,
            degree: self.degree,
            columns: Arc::new(columns),
        })
    }

    /// Number of points that share their place with another one.
    pub(crate) fn duplicates(&self) -> usize {
        self.coincident(1).filter(|&coincident| coincident).count()
    }

    /// True if all neighbours of every point share its place, so that the graph falls into islands.
    pub(crate) fn only_islands(&self) -> bool {
        self.degree > 1
            && self
                .coincident(self.degree - 1)
                .all(|coincident| coincident)
    }

    /// For each point, true if its neighbour at `rank` lies at the same place; empty where there is none.
    fn coincident(&self, rank: usize) -> impl Iterator<Item = bool> {
        let rows = self
            .columns
            .chunks(self.degree)
            .filter(move |row| row.len() > rank);
        rows.zip(&self.points)
            .map(move |(row, point)| *point == self.points[row[rank] as usize])
    }
}
