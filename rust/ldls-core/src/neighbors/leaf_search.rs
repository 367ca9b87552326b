//! The nearest neighbours of the points of a leaf of the k-d tree, which search together.
//!
//! They go down the tree once, and each compares itself with 16 points of another leaf at a time, in single
//! precision. That cannot tell distances apart which differ by its rounding, so a search keeps a few points
//! more than it needs, and double precision decides among them. Where that is not enough (lattices, many
//! coincident points), the point searches alone.

use super::candidates::decide;
use super::kdtree::{Boxes, FAN, KdTree, larger};
use super::keys::{Key, key, position_of, squared_of};
use super::lone_search::search_alone;
use crate::bits::ones;
use multiversion::multiversion;
use wide::f32x8;

/// Squared distances in single precision are right to this share.
const ROUNDING: f32 = 2e-6;

/// Fills `rows` with the neighbours of the points of `leaf`, first with lists of at least `places` places; how
/// many the next leaf, which is near, had better begin with.
pub(crate) fn search_leaf(
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
        let row = &mut rows[slot * degree + 1..(slot + 1) * degree];
        if search.overflow >> slot & 1 == 1 {
            unsure |= 1 << slot;
        } else if search.tells_apart(slot) {
            // the nearest is the point itself
            for (column, &key) in row.iter_mut().zip(&search.lists[slot][1..]) {
                *column = position_of(key);
            }
        } else if !decide::<LEN>(tree, points, search.candidates(slot), position, row) {
            unsure |= 1 << slot;
        }
    }
    unsure
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2"))]
fn run<const LEN: usize>(search: &mut Search<LEN>) {
    search.run();
}

/// Visits the children of a node that are near enough, but for the one that is done.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2"))]
fn visit_node<const LEN: usize>(
    search: &mut Search<LEN>,
    boxes: &Boxes,
    level: usize,
    node: usize,
    done: Option<usize>,
) {
    if level == 0 {
        search.visit_children(boxes, node, done);
        return;
    }
    let tree = search.tree;
    let squared = boxes.squared_distances(&search.low, &search.high);
    for child in 0..FAN {
        if squared[child] <= search.farthest && Some(child) != done {
            let child = node * FAN + child;
            visit_node(
                search,
                &tree.levels[level - 1][child],
                level - 1,
                child,
                None,
            );
        }
    }
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

    /// True if single precision tells the neighbours of a slot from one another and from all other points.
    fn tells_apart(&self, slot: usize) -> bool {
        let nearest = &self.lists[slot][..self.last + 2];
        let mut pairs = nearest.iter().zip(&nearest[1..]);
        pairs.all(|(&key, &next)| squared_of(next) > self.reach_of(key))
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
        self.visit_own_leaf();
        let node = self.leaf / FAN;
        let tree = self.tree;
        self.visit_children(&tree.levels[0][node], node, Some(self.leaf % FAN));
        self.visit_ancestors(node);
    }

    /// Visits what is not below `node` of the lowest level, the nearest relatives first.
    #[inline(always)]
    fn visit_ancestors(&mut self, mut node: usize) {
        let tree = self.tree;
        for (level, nodes) in tree.levels.iter().enumerate().skip(1) {
            let child = node % FAN;
            node /= FAN;
            visit_node(self, &nodes[node], level, node, Some(child));
        }
    }

    /// Visits the leaves of a node of the lowest level, the nearest first.
    #[inline(always)]
    fn visit_children(&mut self, boxes: &Boxes, node: usize, done: Option<usize>) {
        let squared = boxes.squared_distances(&self.low, &self.high);
        let mut near = [0.0; FAN];
        let mut count = 0;
        for child in ones(bits(&squared, &[self.farthest; FAN])) {
            // distance and number in one value that sorts as the distance does
            near[count] = key(squared[child], child as u32);
            count += usize::from(Some(child) != done);
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
                let gap = larger(low - queries[axis][slot], queries[axis][slot] - high);
                let gap = larger(gap, 0.0);
                squared[slot] += gap * gap;
            }
        }
        let near = bits(&squared, &self.reach);
        if near != 0 {
            self.compare(node * FAN + child, near);
        }
    }

    /// Fills the lists with the points of the leaf itself, all slots at once.
    #[inline(always)]
    fn visit_own_leaf(&mut self) {
        let own = &self.tree.leaves[self.leaf];
        let mut ranks = [[0.0; FAN]; FAN];
        // one after the other: compilers that take several at a time shuffle more than they compute
        for other in ones(u32::from(u16::MAX)) {
            let squared = own.squared_distances(own.point(other));
            for slot in 0..FAN {
                ranks[other][slot] = key(squared[slot], (self.leaf * FAN + other) as u32);
            }
        }
        sort_ranks(&mut ranks);
        for (slot, list) in self.lists.iter_mut().enumerate() {
            for (place, keys) in list.iter_mut().zip(&ranks) {
                *place = keys[slot];
            }
        }
        for slot in ones(bits(&[0.0; FAN], &self.reach)) {
            self.update_reach(slot);
        }
        self.farthest = largest(self.reach);
    }

    /// Offers the points of `leaf` to the lists of the slots whose bits are set in `near`.
    #[inline(always)]
    fn compare(&mut self, leaf: usize, near: u32) {
        let [own, others] = [self.leaf, leaf].map(|leaf| &self.tree.leaves[leaf]);
        for slot in ones(near) {
            let squared = others.squared_distances(own.point(slot));
            let better = bits(&squared, &[self.reach[slot]; FAN]);
            if better == 0 {
                continue;
            }
            for other in ones(better) {
                self.insert(slot, key(squared[other], (leaf * FAN + other) as u32));
            }
            self.update_reach(slot);
        }
        self.farthest = largest(self.reach);
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
        let mut squared = squared_of(key);
        if squared == f32::INFINITY {
            // short of the places without a candidate: a list that is not filled yet has room
            return f32::MAX;
        }
        if self.tree.rounding > 0.0 {
            // either of two points may be off in each of three coordinates
            let distance = squared.sqrt() + 8.0 * self.tree.rounding;
            squared = distance * distance;
        }
        // squares below the least normal number have lost digits
        squared * (1.0 + ROUNDING) + f32::MIN_POSITIVE
    }
}

/// Pairs of ranks that, put in order one after the other, leave all in order: Batcher's merge sort.
const EXCHANGES: [[usize; 2]; 63] = {
    let mut pairs = [[0; 2]; 63];
    let (mut count, mut sorted) = (0, 1);
    while sorted < FAN {
        let mut apart = sorted;
        while apart > 0 {
            let first = apart % sorted;
            let mut low = first;
            while low + apart < FAN {
                let of_one_run = low / (2 * sorted) == (low + apart) / (2 * sorted);
                if of_one_run && (low - first) / apart % 2 == 0 {
                    pairs[count] = [low, low + apart];
                    count += 1;
                }
                low += 1;
            }
            apart /= 2;
        }
        sorted *= 2;
    }
    pairs
};

/// Sorts the keys of each slot.
#[inline(always)]
fn sort_ranks(ranks: &mut [[Key; FAN]; FAN]) {
    for [low, high] in EXCHANGES {
        let (one, other) = (ranks[low], ranks[high]);
        for slot in 0..FAN {
            ranks[low][slot] = one[slot].min(other[slot]);
            ranks[high][slot] = one[slot].max(other[slot]);
        }
    }
}

/// Bit i where `values[i] <= limits[i]`.
#[inline(always)]
fn bits(values: &[f32; FAN], limits: &[f32; FAN]) -> u32 {
    let halves = values.as_chunks().0.iter().zip(limits.as_chunks().0);
    let bits = |(values, limits): (&[f32; 8], &[f32; 8])| {
        f32x8::from(*values)
            .simd_le(f32x8::from(*limits))
            .to_bitmask()
    };
    halves.map(bits).rev().fold(0, |all, half| all << 8 | half)
}

#[inline(always)]
fn largest(mut values: [f32; FAN]) -> f32 {
    let mut half = FAN / 2;
    while half > 0 {
        for i in 0..half {
            values[i] = larger(values[i], values[i + half]);
        }
        half /= 2;
    }
    values[0]
}
