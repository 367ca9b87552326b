//! Outlier removal: an instance keeps its largest connected component and what is certainly part of it (method, step 7).

use super::point_graph::PointGraph;
use crate::memory::{collect, filled, push};
use crate::{Cancel, Error, Result};

/// Share of its points that a component beside the largest needs at the distance of its object.
const LEAST_AT_DEPTH: f64 = 0.8;

/// Turns every point that is not in the largest connected component of its label into background (0). Edges are
/// taken as undirected; of components of one size, the one with the lowest point index is kept.
///
/// A smaller component stays too if it has at least the share `part_size` of the points of the largest, below 1, and
/// four fifths of its points are `at_depth`: as far away, by their row and label, as the object.
///
/// # Errors
/// [`Error::Mismatch`] where `labels` is of another length than the graph, [`Error::OutOfMemory`] and
/// [`Error::Cancelled`].
pub fn remove_outliers(
    graph: &PointGraph,
    labels: &[u32],
    part_size: f64,
    at_depth: impl Fn(usize, u32) -> bool,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    let indices = collect(0..labels.len() as u32, cancel)?;
    remove_outliers_by_index(graph, labels, &indices, part_size, at_depth, cancel)
}

/// The same for points whose rows are not in the order of their `indices`.
pub(crate) fn remove_outliers_by_index(
    graph: &PointGraph,
    labels: &[u32],
    indices: &[u32],
    part_size: f64,
    at_depth: impl Fn(usize, u32) -> bool,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    if labels.len() != graph.len() {
        let problem = format!(
            "{} labels, the graph has {} points",
            labels.len(),
            graph.len()
        );
        return Err(Error::Mismatch {
            name: "labels",
            problem,
        });
    }
    let mut members = Vec::new();
    for (row, _) in (0..).zip(labels).filter(|&(_, &label)| label > 0) {
        push(&mut members, row)?;
    }
    let mut sets = DisjointSets::new(labels.len(), cancel)?;
    for rows in members.chunks(ROWS_A_BLOCK) {
        cancel.check()?;
        for &row in rows {
            let label = labels[row as usize];
            let edges = graph.row(row as usize);
            for (other, _) in edges.filter(|&(other, _)| labels[other] == label) {
                sets.join(row, other as u32);
            }
        }
    }
    let mut components = filled(Component::NONE, labels.len(), cancel)?;
    for rows in members.chunks(ROWS_A_BLOCK) {
        cancel.check()?;
        for &row in rows {
            let (at, root) = (row as usize, sets.root(row));
            let counts = part_size < 1.0 && at_depth(at, labels[at]);
            components[root as usize].add(root, indices[at], counts);
        }
    }
    cancel.check()?;
    let largest = largest_of_each(labels, &components);
    let mut kept = collect(labels.iter().copied(), cancel)?;
    for &row in &members {
        let (label, root) = (&mut kept[row as usize], sets.root(row));
        let (component, largest) = (&components[root as usize], &largest[*label as usize]);
        let stays =
            root == largest.root || (part_size < 1.0 && component.is_part_of(largest, part_size));
        if !stays {
            *label = 0;
        }
    }
    Ok(kept)
}

/// Points between two looks at the flag.
const ROWS_A_BLOCK: usize = 1 << 16;

/// One component: its root, its size, the points at the distance of its object, and the lowest index of a point in it.
#[derive(Debug, Clone, Copy)]
struct Component {
    root: u32,
    size: u32,
    at_depth: u32,
    first: u32,
}

impl Component {
    const NONE: Self = Self {
        root: u32::MAX,
        size: 0,
        at_depth: 0,
        first: u32::MAX,
    };

    fn add(&mut self, root: u32, index: u32, at_depth: bool) {
        self.root = root;
        self.size += 1;
        self.at_depth += u32::from(at_depth);
        self.first = self.first.min(index);
    }

    fn is_part_of(&self, largest: &Self, part_size: f64) -> bool {
        f64::from(self.size) >= part_size * f64::from(largest.size)
            && f64::from(self.at_depth) >= LEAST_AT_DEPTH * f64::from(self.size)
    }
}

fn largest_of_each(labels: &[u32], components: &[Component]) -> Vec<Component> {
    let n_labels = labels.iter().max().map_or(1, |&label| label as usize + 1);
    let mut largest = vec![Component::NONE; n_labels];
    for &component in components.iter().filter(|component| component.size > 0) {
        let best = &mut largest[labels[component.root as usize] as usize];
        let larger = component.size > best.size;
        if larger || (component.size == best.size && component.first < best.first) {
            *best = component;
        }
    }
    largest
}

/// Union-find in which the root of a set is its lowest element.
struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    fn new(n: usize, cancel: &Cancel) -> Result<Self> {
        Ok(Self {
            parents: collect(0..n as u32, cancel)?,
        })
    }

    fn root(&mut self, mut element: u32) -> u32 {
        while self.parents[element as usize] != element {
            let grandparent = self.parents[self.parents[element as usize] as usize];
            self.parents[element as usize] = grandparent;
            element = grandparent;
        }
        element
    }

    fn join(&mut self, a: u32, b: u32) {
        if self.parents[a as usize] == self.parents[b as usize] {
            return;
        }
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in a row, each with an edge to the next one only: connected as long as edges count both ways.
    fn chain(n: usize) -> PointGraph {
        let columns: Vec<u32> = (0..n as u32).map(|i| (i + 1).min(n as u32 - 1)).collect();
        PointGraph::from_csr((0..=n).collect(), columns, vec![1.0; n]).unwrap()
    }

    fn keep_largest(graph: &PointGraph, labels: &[u32]) -> Vec<u32> {
        remove_outliers(graph, labels, 1.0, |_, _| true, Cancel::never()).unwrap()
    }

    #[test]
    fn the_largest_run_of_a_label_stays() {
        let labels = [1, 1, 2, 1, 1, 1, 2, 2, 0];
        assert_eq!(
            keep_largest(&chain(9), &labels),
            [0, 0, 0, 1, 1, 1, 2, 2, 0]
        );
    }

    #[test]
    fn sets_are_joined_by_their_roots_whichever_elements_are_named() {
        // 3 is no root: joined itself, it would leave 2 behind
        for last in [[0, 3], [3, 0]] {
            let mut sets = DisjointSets::new(5, Cancel::never()).unwrap();
            for [a, b] in [[2, 3], [3, 4], last] {
                sets.join(a, b);
            }
            let roots: Vec<u32> = (0..5).map(|i| sets.root(i)).collect();
            assert_eq!(roots, [0, 1, 0, 0, 0]);
        }
    }

    #[test]
    fn of_equal_components_the_one_with_the_lowest_index_stays() {
        assert_eq!(keep_largest(&chain(5), &[3, 3, 0, 3, 3]), [3, 3, 0, 0, 0]);
    }

    #[test]
    fn rows_may_come_in_another_order_than_indices() {
        let (labels, indices) = ([3, 3, 0, 3, 3], [4, 3, 2, 1, 0]);
        let (graph, everywhere) = (chain(5), |_, _| true);
        let kept =
            remove_outliers_by_index(&graph, &labels, &indices, 1.0, everywhere, Cancel::never());
        assert_eq!(kept.unwrap(), [0, 0, 0, 3, 3]);
    }

    #[test]
    fn a_part_stays_if_it_is_large_and_at_the_distance_of_the_object() {
        let labels = [1, 1, 1, 1, 0, 1, 1, 0, 1];
        let kept = |part_size, at_depth: &dyn Fn(usize, u32) -> bool| {
            remove_outliers(&chain(9), &labels, part_size, at_depth, Cancel::never()).unwrap()
        };
        assert_eq!(kept(0.5, &|_, _| true), [1, 1, 1, 1, 0, 1, 1, 0, 0]);
        assert_eq!(kept(0.5, &|i, _| i < 6), [1, 1, 1, 1, 0, 0, 0, 0, 0]);
        assert_eq!(kept(0.25, &|_, _| true), labels);
        assert_eq!(kept(1.0, &|_, _| true), [1, 1, 1, 1, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn no_points_and_no_labels_are_fine() {
        let empty = PointGraph::from_csr(vec![0], vec![], vec![]).unwrap();
        assert!(keep_largest(&empty, &[]).is_empty());
        assert_eq!(keep_largest(&chain(3), &[0; 3]), [0; 3]);
        let kept = remove_outliers(&chain(3), &[0; 2], 1.0, |_, _| true, Cancel::never());
        assert!(kept.is_err());
    }
}
