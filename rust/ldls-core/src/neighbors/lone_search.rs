//! The nearest neighbours of one point, in double precision throughout: slower than [`super::leaf_search`], for points
//! whose neighbours single precision does not tell apart.

use super::candidates::{Candidate, precedes, squared_distance};
use super::kdtree::{Boxes, FAN, KdTree};

/// Fills `row` with the neighbours of the point at `position`, in double precision throughout.
pub(crate) fn search_alone(tree: &KdTree, points: &[[f64; 3]], position: usize, row: &mut [u32]) {
    let (from, k) = (points[position], row.len());
    let mut search = Alone {
        tree,
        points,
        position,
        from,
        best: Vec::with_capacity(k + 1),
        k,
    };
    search.visit(tree.levels.len() - 1, 0);
    for (slot, candidate) in row.iter_mut().zip(&search.best) {
        *slot = candidate.2;
    }
}

/// The search of one point for neighbours that single precision does not tell apart.
struct Alone<'a> {
    tree: &'a KdTree,
    points: &'a [[f64; 3]],
    position: usize,
    from: [f64; 3],
    /// The best so far, ascending.
    best: Vec<Candidate>,
    k: usize,
}

impl Alone<'_> {
    fn visit(&mut self, level: usize, node: usize) {
        let boxes = &self.tree.levels[level][node];
        let mut children: Vec<Candidate> = (0..FAN)
            .map(|child| (self.gap(boxes, child), boxes.first[child], child as u32))
            .collect();
        children.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for child in children.into_iter().filter(|child| child.1 != u32::MAX) {
            if self.best.len() == self.k && !precedes(child, self.best[self.k - 1]) {
                continue;
            }
            let number = node * FAN + child.2 as usize;
            if level > 0 {
                self.visit(level - 1, number);
            } else {
                self.visit_leaf(number);
            }
        }
    }

    fn visit_leaf(&mut self, leaf: usize) {
        for position in leaf * FAN..self.tree.len().min((leaf + 1) * FAN) {
            let index = self.tree.order[position];
            let squared = squared_distance(&self.from, &self.points[position]);
            let candidate = (squared, index, position as u32);
            let better = self.best.len() < self.k || precedes(candidate, self.best[self.k - 1]);
            if position != self.position && better {
                let place = self
                    .best
                    .partition_point(|&other| precedes(other, candidate));
                self.best.insert(place, candidate);
                self.best.truncate(self.k);
            }
        }
    }

    /// A lower bound of the squared distance of any point of a child.
    fn gap(&self, boxes: &Boxes, child: usize) -> f64 {
        let slack = 2.0 * f64::from(self.tree.rounding);
        let mut squared = 0.0;
        for axis in 0..3 {
            let c = self.from[axis] - self.tree.origin[axis];
            let (low, high) = (
                f64::from(boxes.low[axis][child]),
                f64::from(boxes.high[axis][child]),
            );
            let gap = (low - c).max(c - high) - slack;
            squared += gap.max(0.0) * gap.max(0.0);
        }
        squared
    }
}
