//! Outlier removal: an instance keeps its largest connected component and the parts near it (method, step 7).

use super::box_tree::BoxTree;
use super::disjoint_sets::DisjointSets;
use super::point_graph::PointGraph;
use crate::memory::{collect, filled, push, tabulate, zeros};
use crate::{Cancel, Error, Result};
use std::ops::Range;

/// Turns every point that is not in the largest connected component of its label into background (0). Edges are
/// taken as undirected; of components of one size, the one with the lowest point index is kept.
///
/// If `part_gap`, in metres, is not 0, a component that comes so near to the largest stays too; `place` is where the point
/// of a row is, x, y and z in metres.
///
/// # Errors
/// [`Error::Mismatch`] where `labels` is of another length than the graph, [`Error::OutOfMemory`] and
/// [`Error::Cancelled`].
pub fn remove_outliers(
    graph: &PointGraph,
    labels: &[u32],
    part_gap: f64,
    place: impl Fn(usize) -> [f64; 3] + Sync,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    let indices = collect(0..labels.len() as u32, cancel)?;
    remove_outliers_by_index(graph, labels, &indices, part_gap, place, cancel)
}

/// The same for points whose rows are not in the order of their `indices`.
pub(crate) fn remove_outliers_by_index(
    graph: &PointGraph,
    labels: &[u32],
    indices: &[u32],
    part_gap: f64,
    place: impl Fn(usize) -> [f64; 3] + Sync,
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
    for rows in members.chunks(Cancel::ITEMS_A_LOOK) {
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
    for rows in members.chunks(Cancel::ITEMS_A_LOOK) {
        cancel.check()?;
        for &row in rows {
            components[sets.root(row) as usize].add(indices[row as usize]);
        }
    }
    cancel.check()?;
    let largest = largest_of_each(labels, &components);
    for &root in largest.iter().flatten() {
        components[root].stays = true;
    }
    if part_gap > 0.0 {
        let rows = rows_of_each(&mut components, &members, &mut sets, cancel)?;
        let tree = |component: &Component| {
            let rows = &rows[component.rows()];
            let points = tabulate(rows.len(), |at| place(rows[at] as usize), cancel)?;
            BoxTree::around(points, cancel)
        };
        keep_parts(&mut components, labels, &largest, (part_gap, tree), cancel)?;
    }
    let mut kept = collect(labels.iter().copied(), cancel)?;
    for &row in &members {
        if !components[sets.root(row) as usize].stays {
            kept[row as usize] = 0;
        }
    }
    Ok(kept)
}

/// One component, in the place of its root: its size, the lowest index of a point in it, and the end of its rows among
/// those of all.
#[derive(Debug, Clone, Copy)]
struct Component {
    size: u32,
    first: u32,
    end: u32,
    stays: bool,
}

impl Component {
    const NONE: Self = Self {
        size: 0,
        first: u32::MAX,
        end: 0,
        stays: false,
    };

    fn add(&mut self, index: u32) {
        self.size += 1;
        self.first = self.first.min(index);
    }

    /// Where its rows are among those of all.
    fn rows(&self) -> Range<usize> {
        (self.end - self.size) as usize..self.end as usize
    }
}

/// The root of the largest component of each label.
fn largest_of_each(labels: &[u32], components: &[Component]) -> Vec<Option<usize>> {
    let n_labels = labels.iter().max().map_or(1, |&label| label as usize + 1);
    let mut largest = vec![None; n_labels];
    let there = components.iter().enumerate();
    for (root, component) in there.filter(|(_, component)| component.size > 0) {
        let best = &mut largest[labels[root] as usize];
        let larger = best.is_none_or(|best: usize| {
            let best = &components[best];
            component.size > best.size
                || (component.size == best.size && component.first < best.first)
        });
        if larger {
            *best = Some(root);
        }
    }
    largest
}

/// The rows of the members, those of a component one after the other; each component then knows where.
fn rows_of_each(
    components: &mut [Component],
    members: &[u32],
    sets: &mut DisjointSets,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    let mut end = 0;
    for component in components.iter_mut().filter(|component| component.size > 0) {
        component.end = end;
        end += component.size;
    }
    let mut rows = zeros(members.len(), cancel)?;
    for block in members.chunks(Cancel::ITEMS_A_LOOK) {
        cancel.check()?;
        for &row in block {
            let component = &mut components[sets.root(row) as usize];
            rows[component.end as usize] = row;
            component.end += 1;
        }
    }
    Ok(rows)
}

/// Keeps the components that come within `gap` metres of the largest of their label.
fn keep_parts(
    components: &mut [Component],
    labels: &[u32],
    largest: &[Option<usize>],
    (gap, tree): (f64, impl Fn(&Component) -> Result<BoxTree>),
    cancel: &Cancel,
) -> Result<()> {
    let mut main: Vec<Option<BoxTree>> = largest.iter().map(|_| None).collect();
    for at in 0..components.len() {
        let (component, label) = (&components[at], labels[at] as usize);
        if component.size == 0 || component.stays {
            continue;
        }
        let Some(root) = largest[label] else { continue };
        let main = match &mut main[label] {
            Some(main) => main,
            none => none.insert(tree(&components[root])?),
        };
        components[at].stays = tree(component)?.come_near(main, gap, cancel)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points in a row, each with an edge to the next one only: connected as long as edges count both ways.
    fn chain(n: usize) -> PointGraph {
        let columns: Vec<u32> = (0..n as u32).map(|i| (i + 1).min(n as u32 - 1)).collect();
        PointGraph::from_csr((0..=n).collect(), columns, vec![1.0; n]).unwrap()
    }

    /// Those points, a metre from one to the next.
    fn along(row: usize) -> [f64; 3] {
        [row as f64, 0.0, 0.0]
    }

    fn keep_largest(graph: &PointGraph, labels: &[u32]) -> Vec<u32> {
        remove_outliers(graph, labels, 0.0, along, Cancel::never()).unwrap()
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
    fn of_equal_components_the_one_with_the_lowest_index_stays() {
        assert_eq!(keep_largest(&chain(5), &[3, 3, 0, 3, 3]), [3, 3, 0, 0, 0]);
    }

    #[test]
    fn rows_may_come_in_another_order_than_indices() {
        let (labels, indices) = ([3, 3, 0, 3, 3], [4, 3, 2, 1, 0]);
        let kept =
            remove_outliers_by_index(&chain(5), &labels, &indices, 0.0, along, Cancel::never());
        assert_eq!(kept.unwrap(), [0, 0, 0, 3, 3]);
    }

    #[test]
    fn a_part_stays_if_it_is_near_the_largest() {
        let labels = [1, 1, 1, 1, 0, 1, 1, 0, 0, 1, 2, 0, 0, 2];
        let kept = |part_gap| {
            remove_outliers(&chain(14), &labels, part_gap, along, Cancel::never()).unwrap()
        };
        let parts = [1, 1, 1, 1, 0, 1, 1, 0, 0, 0, 2, 0, 0, 0];
        assert_eq!(kept(2.0), parts, "2 m from the largest, 3 m from its part");
        assert_eq!(kept(1.9)[..7], [1, 1, 1, 1, 0, 0, 0]);
        assert_eq!(kept(6.0), labels);
        assert_eq!(kept(0.0), keep_largest(&chain(14), &labels));
    }

    #[test]
    fn no_points_and_no_labels_are_fine() {
        let empty = PointGraph::from_csr(vec![0], vec![], vec![]).unwrap();
        assert!(keep_largest(&empty, &[]).is_empty());
        assert_eq!(keep_largest(&chain(3), &[0; 3]), [0; 3]);
        let kept = remove_outliers(&chain(3), &[0; 2], 0.0, along, Cancel::never());
        assert!(kept.is_err());
    }
}
