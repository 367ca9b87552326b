//! Outlier removal: an instance keeps its largest connected component (method, step 7).

use super::point_graph::PointGraph;
use crate::{Error, Result};

/// Turns every point that is not in the largest connected component of its label into background (0). Edges are
/// taken as undirected; of components of one size, the one with the lowest point index is kept.
///
/// # Errors
/// [`Error::Mismatch`] where `labels` is of another length than the graph.
pub fn keep_largest_components(graph: &PointGraph, labels: &[u32]) -> Result<Vec<u32>> {
    let indices: Vec<u32> = (0..labels.len() as u32).collect();
    keep_largest_by_index(graph, labels, &indices)
}

/// The same for points whose rows are not in the order of their `indices`.
pub(crate) fn keep_largest_by_index(
    graph: &PointGraph,
    labels: &[u32],
    indices: &[u32],
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
    let mut sets = DisjointSets::new(labels.len());
    for (i, &label) in labels.iter().enumerate().filter(|(_, label)| **label > 0) {
        for (j, _) in graph.row(i).filter(|&(j, _)| labels[j] == label) {
            sets.join(i as u32, j as u32);
        }
    }
    let components: Vec<u32> = (0..labels.len() as u32).map(|i| sets.root(i)).collect();
    let largest = largest_of_each(labels, &components, indices);
    let kept = |(&label, &component): (&u32, &u32)| {
        if largest[label as usize].root == component {
            label
        } else {
            0
        }
    };
    Ok(labels.iter().zip(&components).map(kept).collect())
}

/// One component: its root, its size, and the lowest index of a point in it.
#[derive(Debug, Clone, Copy)]
struct Component {
    root: u32,
    size: u32,
    first: u32,
}

impl Component {
    const NONE: Self = Self {
        root: u32::MAX,
        size: 0,
        first: u32::MAX,
    };
}

fn largest_of_each(labels: &[u32], components: &[u32], indices: &[u32]) -> Vec<Component> {
    let mut all = vec![Component::NONE; labels.len()];
    for (&root, &index) in components.iter().zip(indices) {
        let component = &mut all[root as usize];
        let first = component.first.min(index);
        *component = Component {
            root,
            size: component.size + 1,
            first,
        };
    }
    let n_labels = labels.iter().max().map_or(1, |&label| label as usize + 1);
    let mut largest = vec![Component::NONE; n_labels];
    for &component in all.iter().filter(|component| component.size > 0) {
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
    fn new(n: usize) -> Self {
        Self {
            parents: (0..n as u32).collect(),
        }
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

    #[test]
    fn the_largest_run_of_a_label_stays() {
        let labels = [1, 1, 2, 1, 1, 1, 2, 2, 0];
        assert_eq!(
            keep_largest_components(&chain(9), &labels).unwrap(),
            [0, 0, 0, 1, 1, 1, 2, 2, 0]
        );
    }

    #[test]
    fn sets_are_joined_by_their_roots_whichever_elements_are_named() {
        // 3 is no root: joined itself, it would leave 2 behind
        for last in [[0, 3], [3, 0]] {
            let mut sets = DisjointSets::new(5);
            for [a, b] in [[2, 3], [3, 4], last] {
                sets.join(a, b);
            }
            let roots: Vec<u32> = (0..5).map(|i| sets.root(i)).collect();
            assert_eq!(roots, [0, 1, 0, 0, 0]);
        }
    }

    #[test]
    fn of_equal_components_the_one_with_the_lowest_index_stays() {
        assert_eq!(
            keep_largest_components(&chain(5), &[3, 3, 0, 3, 3]).unwrap(),
            [3, 3, 0, 0, 0]
        );
    }

    #[test]
    fn rows_may_come_in_another_order_than_indices() {
        let kept = keep_largest_by_index(&chain(5), &[3, 3, 0, 3, 3], &[4, 3, 2, 1, 0]).unwrap();
        assert_eq!(kept, [0, 0, 0, 3, 3]);
    }

    #[test]
    fn no_points_and_no_labels_are_fine() {
        let empty = PointGraph::from_csr(vec![0], vec![], vec![]).unwrap();
        assert!(keep_largest_components(&empty, &[]).unwrap().is_empty());
        assert_eq!(keep_largest_components(&chain(3), &[0; 3]).unwrap(), [0; 3]);
        assert!(keep_largest_components(&chain(3), &[0; 2]).is_err());
    }
}
