//! The K nearest neighbours of every point, exactly.
//!
//! Distances are those of double precision; of equally distant points the one of lower index is nearer.
//!
//! All points of a leaf of the k-d tree search together: they go down the tree once, and each compares itself
//! with 16 points of another leaf at a time, in single precision. That cannot tell distances apart which
//! differ by its rounding, so a search keeps a few points more than it needs, and double precision decides
//! among them. Where that is not enough (lattices, many coincident points), the point searches alone.

use crate::Memory;
use crate::graph::squared_distance;
use crate::kdtree::{Boxes, FAN, KdTree};
use multiversion::multiversion;
use rayon::prelude::*;
use std::sync::Arc;

/// Leaves handled by one task of the thread pool.
const LEAVES_A_TASK: usize = 16;
/// Places of a list beyond the neighbours and the point itself.
const SPARE: usize = 4;
/// Squared distances in single precision are right to this share.
const ROUNDING: f32 = 2e-6;

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
    pub fn search(points: &[[f64; 3]], k: usize) -> Self {
        let memory = &mut Memory::of_one_frame();
        let tree = KdTree::new(points, memory);
        let found = Adjacency::search(&tree, &tree.arrange(points, memory), k, memory);
        let k = found.degree - 1;
        let mut indices = vec![0; points.len() * k];
        if k > 0 {
            for (&index, row) in tree.order.iter().zip(found.columns.chunks(found.degree)) {
                let slots = &mut indices[index as usize * k..][..k];
                for (slot, &position) in slots.iter_mut().zip(&row[1..]) {
                    *slot = tree.order[position as usize];
                }
            }
        }
        Self { k, indices }
    }

    /// Squared distances of the neighbours of `points`, in square metres, in the order of `indices`.
    pub fn squared_distances(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let rows = self.indices.par_chunks(self.k.max(1)).zip(points);
        let of_row = |(row, point): (&[u32], &[f64; 3])| {
            let point = *point;
            let distance = move |&j: &u32| squared_distance(&point, &points[j as usize]);
            row.iter().map(distance).collect::<Vec<_>>()
        };
        rows.flat_map_iter(of_row).collect()
    }
}

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
    pub(crate) fn search(
        tree: &KdTree,
        points: &[[f64; 3]],
        k: usize,
        memory: &mut Memory,
    ) -> Self {
        let degree = k.min(points.len().saturating_sub(1)) + 1;
        let mut columns = memory.filled(points.len() * degree, 0);
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

    /// Keeps the columns, if no graph has them any more.
    pub(crate) fn keep_in(self, memory: &mut Memory) {
        if let Ok(columns) = Arc::try_unwrap(self.columns) {
            memory.keep(columns);
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

/// Fills `rows` with the neighbours of the points of `leaf`, first with lists of at least `places` places; how
/// many the next leaf, which is near, had better begin with.
fn search_leaf(
    tree: &KdTree,
    points: &[[f64; 3]],
    degree: usize,
    leaf: usize,
    places: usize,
    rows: &mut [u32],
) -> usize {
    let count = rows.len() / degree;
    let mut unsure = u32::MAX >> (32 - count);
    let mut enough = places;
    // ties at the last neighbour are more than a list holds: a longer one holds more of them
    for (size, search) in SEARCHES.into_iter().filter(|(size, _)| *size >= places) {
        if unsure.count_ones() as usize * 2 > count {
            enough = size;
        }
        if unsure != 0 {
            unsure = search(tree, points, degree, leaf, unsure, rows);
        }
    }
    for slot in (0..count).filter(|slot| unsure >> slot & 1 == 1) {
        search_alone(
            tree,
            points,
            leaf * FAN + slot,
            &mut rows[slot * degree + 1..(slot + 1) * degree],
        );
    }
    enough
}

type LeafSearch = fn(&KdTree, &[[f64; 3]], usize, usize, u32, &mut [u32]) -> u32;

/// Searches of a leaf by the number of places in their lists.
const SEARCHES: [(usize, LeafSearch); 4] = [
    (16, search_with::<16>),
    (32, search_with::<32>),
    (64, search_with::<64>),
    (288, search_with::<288>),
];

/// Searches for the points of `leaf` whose bits are set in `wanted`, with lists of `LEN` places; the bits of
/// those for which that was not enough.
fn search_with<const LEN: usize>(
    tree: &KdTree,
    points: &[[f64; 3]],
    degree: usize,
    leaf: usize,
    wanted: u32,
    rows: &mut [u32],
) -> u32 {
    let mut search = Search::<LEN>::new(tree, degree - 1, leaf, wanted);
    run(&mut search);
    let mut unsure = 0;
    for slot in (0..FAN).filter(|slot| wanted >> slot & 1 == 1) {
        let position = leaf * FAN + slot;
        if search.overflow >> slot & 1 == 1
            || !decide(
                tree,
                points,
                search.candidates(slot),
                position,
                &mut rows[slot * degree + 1..(slot + 1) * degree],
            )
        {
            unsure |= 1 << slot;
        }
    }
    unsure
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2"))]
fn run<const LEN: usize>(search: &mut Search<LEN>) {
    search.run();
}

/// A candidate's squared distance and position as one number that sorts as they do.
///
/// The bits of a positive `f32` sort as its value does, and so do those of an `f64`: with the distance in its
/// upper half and the position in its lower, one floating-point comparison compares both. The lowest exponent
/// is added lest it be subnormal, which some processors take for zero.
type Key = f64;
const LOWEST_EXPONENT: u64 = 1 << 52;

#[inline(always)]
fn key(squared: f32, position: u32) -> Key {
    f64::from_bits((u64::from(squared.to_bits()) << 32 | u64::from(position)) + LOWEST_EXPONENT)
}

#[inline(always)]
fn squared_of(key: Key) -> f32 {
    f32::from_bits(((key.to_bits() - LOWEST_EXPONENT) >> 32) as u32)
}

#[inline(always)]
fn position_of(key: Key) -> u32 {
    (key.to_bits() - LOWEST_EXPONENT) as u32
}

/// The search of the points of one leaf.
struct Search<'a, const LEN: usize> {
    tree: &'a KdTree,
    /// Place of the last neighbour in a list: the point itself is in it too.
    last: usize,
    leaf: usize,
    low: [f32; 3],
    high: [f32; 3],
    /// Squared distance up to which a point of each slot still looks for candidates; negative if it does not.
    reach: [f32; FAN],
    /// The largest of these.
    farthest: f32,
    /// The nearest candidates of each slot, ascending.
    lists: [[Key; LEN]; FAN],
    /// Slots whose list is full of candidates that single precision does not tell apart.
    overflow: u32,
}

impl<'a, const LEN: usize> Search<'a, LEN> {
    fn new(tree: &'a KdTree, k: usize, leaf: usize, wanted: u32) -> Self {
        let mut search = Self {
            tree,
            last: k,
            leaf,
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
            reach: [-1.0; FAN],
            farthest: f32::MAX,
            lists: [[key(f32::INFINITY, 0); LEN]; FAN],
            overflow: 0,
        };
        for slot in (0..FAN).filter(|slot| wanted >> slot & 1 == 1) {
            search.reach[slot] = f32::MAX;
            for (axis, c) in tree.leaves[leaf].point(slot).into_iter().enumerate() {
                search.low[axis] = search.low[axis].min(c);
                search.high[axis] = search.high[axis].max(c);
            }
        }
        search
    }

    fn candidates(&self, slot: usize) -> &[Key] {
        let list = &self.lists[slot];
        let reach = self.reach_of(list[self.last]);
        let count = list
            .iter()
            .take_while(|&&key| squared_of(key) <= reach)
            .count();
        &list[..count]
    }

    #[inline(always)]
    fn run(&mut self) {
        self.visit_leaf(self.leaf);
        let node = self.leaf / FAN;
        let tree = self.tree;
        self.visit_children(&tree.levels[0][node], 0, node, Some(self.leaf % FAN));
        self.visit_ancestors(node);
    }

    /// Visits what is not below `node` of the lowest level, the nearest relatives first.
    #[inline(always)]
    fn visit_ancestors(&mut self, mut node: usize) {
        let tree = self.tree;
        for (level, nodes) in tree.levels.iter().enumerate().skip(1) {
            let child = node % FAN;
            node /= FAN;
            self.visit_node(&nodes[node], level, node, Some(child));
        }
    }

    /// Visits the children of a node that are near enough, but for the one that is done.
    fn visit_node(&mut self, boxes: &Boxes, level: usize, node: usize, done: Option<usize>) {
        if level == 0 {
            self.visit_children(boxes, level, node, done);
            return;
        }
        let tree = self.tree;
        let squared = boxes.squared_distances(&self.low, &self.high);
        for child in 0..FAN {
            if squared[child] <= self.farthest && Some(child) != done {
                let child = node * FAN + child;
                self.visit_node(&tree.levels[level - 1][child], level - 1, child, None);
            }
        }
    }

    /// Visits the leaves of a node of the lowest level, the nearest first.
    #[inline(always)]
    fn visit_children(&mut self, boxes: &Boxes, _level: usize, node: usize, done: Option<usize>) {
        let squared = boxes.squared_distances(&self.low, &self.high);
        let mut near = [0.0; FAN];
        let mut count = 0;
        for child in 0..FAN {
            // distance and number in one value that sorts as the distance does
            near[count] = key(squared[child], child as u32);
            let wanted = squared[child] <= self.farthest && Some(child) != done;
            count += usize::from(wanted);
        }
        let near = &mut near[..count];
        near.sort_unstable_by(f64::total_cmp);
        for &mut found in near {
            if squared_of(found) > self.farthest {
                break;
            }
            self.visit_leaf_in(boxes, node, position_of(found) as usize);
        }
    }

    /// Compares the points that are near enough to the box of a leaf with its points.
    #[inline(always)]
    fn visit_leaf_in(&mut self, boxes: &Boxes, node: usize, child: usize) {
        let queries = &self.tree.leaves[self.leaf].0;
        let mut squared = [0.0_f32; FAN];
        for axis in 0..3 {
            let (low, high) = (boxes.low[axis][child], boxes.high[axis][child]);
            for slot in 0..FAN {
                let gap = (low - queries[axis][slot])
                    .max(queries[axis][slot] - high)
                    .max(0.0);
                squared[slot] += gap * gap;
            }
        }
        let near = bits(&squared, &self.reach);
        if near != 0 {
            self.compare(node * FAN + child, near);
        }
    }

    #[inline(always)]
    fn visit_leaf(&mut self, leaf: usize) {
        let near = bits(&[0.0; FAN], &self.reach);
        self.compare(leaf, near);
    }

    /// Offers the points of `leaf` to the lists of the slots whose bits are set in `near`.
    #[inline(always)]
    fn compare(&mut self, leaf: usize, mut near: u32) {
        let others = &self.tree.leaves[leaf].0;
        while near != 0 {
            let slot = near.trailing_zeros() as usize;
            near &= near - 1;
            let point = self.tree.leaves[self.leaf].point(slot);
            let mut squared = [0.0_f32; FAN];
            for other in 0..FAN {
                let [x, y, z] = [
                    others[0][other] - point[0],
                    others[1][other] - point[1],
                    others[2][other] - point[2],
                ];
                squared[other] = x * x + y * y + z * z;
            }
            let mut better = bits(&squared, &[self.reach[slot]; FAN]);
            if better == 0 {
                continue;
            }
            while better != 0 {
                let other = better.trailing_zeros() as usize;
                better &= better - 1;
                self.insert(slot, key(squared[other], (leaf * FAN + other) as u32));
            }
            self.update_reach(slot);
        }
        self.farthest = self
            .reach
            .iter()
            .fold(-1.0, |a, &b| if b > a { b } else { a });
    }

    /// Puts `key` in its place in the list of `slot`; the largest one falls out.
    #[inline(always)]
    fn insert(&mut self, slot: usize, key: Key) {
        let list = &mut self.lists[slot];
        let mut shifted = [0.0; LEN];
        shifted[1..].copy_from_slice(&list[..LEN - 1]);
        for place in 0..LEN {
            // each place keeps its own, or takes the new one, or the one before it
            let lower = if shifted[place] > key {
                shifted[place]
            } else {
                key
            };
            list[place] = if list[place] < lower {
                list[place]
            } else {
                lower
            };
        }
    }

    #[inline(always)]
    fn update_reach(&mut self, slot: usize) {
        let list = &self.lists[slot];
        let reach = self.reach_of(list[self.last]);
        let full = squared_of(list[LEN - 1]) <= reach;
        self.overflow |= u32::from(full) << slot;
        self.reach[slot] = if full { -1.0 } else { reach };
    }

    /// Squared distance within which all points may be as near as the one with `key`.
    #[inline(always)]
    fn reach_of(&self, key: Key) -> f32 {
        let squared = squared_of(key);
        if self.tree.rounding == 0.0 || squared == f32::INFINITY {
            return squared.min(f32::MAX) * (1.0 + ROUNDING);
        }
        // either of two points may be off in each of three coordinates
        let distance = squared.sqrt() + 8.0 * self.tree.rounding;
        distance * distance * (1.0 + ROUNDING)
    }
}

/// Bit i where `values[i] <= limits[i]`.
#[inline(always)]
fn bits(values: &[f32; FAN], limits: &[f32; FAN]) -> u32 {
    let mut found = 0;
    for i in 0..FAN {
        found |= u32::from(values[i] <= limits[i]) << i;
    }
    found
}

/// Fills `row` with the nearest of `candidates` as double precision sees them.
fn decide(
    tree: &KdTree,
    points: &[[f64; 3]],
    candidates: &[Key],
    position: usize,
    row: &mut [u32],
) -> bool {
    let from = points[position];
    let mut exact = [(0.0, 0, 0); 288];
    let mut count = 0;
    for other in candidates
        .iter()
        .map(|&key| position_of(key))
        .filter(|&other| other as usize != position)
    {
        let index = tree.order[other as usize];
        let candidate = (
            squared_distance(&from, &points[other as usize]),
            index,
            other,
        );
        // nearly sorted already: an insertion sort moves next to nothing
        let mut place = count;
        while place > 0 && precedes(candidate, exact[place - 1]) {
            exact[place] = exact[place - 1];
            place -= 1;
        }
        exact[place] = candidate;
        count += 1;
    }
    if count < row.len() {
        return false;
    }
    for (slot, candidate) in row.iter_mut().zip(&exact) {
        *slot = candidate.2;
    }
    true
}

/// Squared distance, index and position of a candidate.
type Candidate = (f64, u32, u32);

#[inline(always)]
fn precedes(a: Candidate, b: Candidate) -> bool {
    a.0 < b.0 || (a.0 == b.0 && a.1 < b.1)
}

/// Fills `row` with the neighbours of the point at `position`, in double precision throughout.
fn search_alone(tree: &KdTree, points: &[[f64; 3]], position: usize, row: &mut [u32]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
            prop_assert_eq!(Neighbors::search(&points, k), brute_force(&points, k));
        }

        #[test]
        fn flat_clouds_equal_brute_force(mut points in quantised(0.1, 600), axis in 0_usize..3) {
            for point in &mut points {
                point[axis] = -0.0;
            }
            prop_assert_eq!(Neighbors::search(&points, 10), brute_force(&points, 10));
        }

        #[test]
        fn scattered_clouds_equal_brute_force(
            points in proptest::collection::vec([-9.0..9.0_f64, -9.0..9.0, -2.0..2.0], 0..600),
            k in prop_oneof![Just(1_usize), Just(10), Just(11), Just(12), Just(30), Just(100), Just(255)],
            far in prop_oneof![Just(0.0), Just(5e6)],
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| [p[0] + far, p[1] - far, p[2]]).collect();
            prop_assert_eq!(Neighbors::search(&points, k), brute_force(&points, k));
        }

        #[test]
        fn clouds_of_single_precision_equal_brute_force(
            points in proptest::collection::vec([-9.0..9.0_f32, -9.0..9.0, -2.0..2.0], 0..600)
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
            prop_assert_eq!(Neighbors::search(&points, 10), brute_force(&points, 10));
        }
    }

    #[test]
    fn coincident_points_are_each_others_neighbours() {
        let points = vec![[1.0, 2.0, 3.0]; 120_000];
        let neighbors = Neighbors::search(&points, 10);
        assert_eq!(neighbors.indices[..10], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        assert_eq!(
            neighbors.indices[119_999 * 10..],
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
        );
        let memory = &mut Memory::of_one_frame();
        let tree = KdTree::new(&points, memory);
        let adjacency = Adjacency::search(&tree, &points, 10, memory);
        assert_eq!(adjacency.duplicates(&points), 120_000);
        assert!(adjacency.only_islands(&points));
    }

    #[test]
    fn a_lattice_equals_brute_force_at_its_corners() {
        let side = |c: usize| (c as f64) * 0.5;
        let points: Vec<[f64; 3]> = (0..125_000)
            .map(|i| [side(i % 50), side(i / 50 % 50), side(i / 2500)])
            .collect();
        let neighbors = Neighbors::search(&points, 3);
        assert_eq!(neighbors.indices[..3], [1, 50, 2500]);
        assert_eq!(
            neighbors.indices[3 * 124_999..],
            [122_499, 124_949, 124_998]
        );
    }

    #[test]
    fn fewer_points_than_neighbours_are_joined_to_all_others() {
        let points = [[0.0; 3], [1.0; 3], [3.0; 3]];
        assert_eq!(Neighbors::search(&points, 10).indices, [1, 2, 0, 2, 1, 0]);
        assert_eq!(Neighbors::search(&[[0.0; 3]], 10), Neighbors::default());
    }
}
