//! A k-d tree over a point cloud: the order that keeps near points near in memory, and boxes around them.
//!
//! Leaves hold 16 consecutive points of that order; 16 leaves make a node, 16 nodes the next larger one,
//! so that a query compares itself with 16 boxes at a time and the tree needs no pointers. Coordinates are
//! kept in single precision. [`KdTree::rounding`] says by how much they differ from the points given: not
//! at all where those came in single precision.

use crate::memory::tabulate;
use crate::{Cancel, Result};
use rayon::prelude::*;

/// Points of a leaf, leaves of a node, nodes of a larger node.
pub(crate) const FAN: usize = 16;
/// Points above which the two sides of a split are built by two threads.
const PARALLEL: usize = 4096;

/// Items that a selection goes through without a look at the flag, and how many of more of them are its sample.
const ITEMS_A_PASS: usize = 1 << 20;
const SAMPLE: usize = 1000;

/// Coordinates of the points of one leaf; infinite where it has fewer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leaf(pub(crate) [[f32; FAN]; 3]);

/// The boxes around the children of one node; empty ones lie at infinity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Boxes {
    pub(crate) low: [[f32; FAN]; 3],
    pub(crate) high: [[f32; FAN]; 3],
    /// Lowest index of a point in each child.
    pub(crate) first: [u32; FAN],
}

/// Points in an order in which near ones are near, with boxes around 16, 256, 4096, ... of them.
#[derive(Debug)]
pub(crate) struct KdTree {
    /// Index of the point at each position.
    pub(crate) order: Vec<u32>,
    pub(crate) leaves: Vec<Leaf>,
    /// Nodes whose children are leaves, nodes whose children are those, and so on up to a single one.
    pub(crate) levels: Vec<Vec<Boxes>>,
    /// Subtracted from coordinates before they are rounded.
    pub(crate) origin: [f64; 3],
    /// Largest error of a coordinate, in metres.
    pub(crate) rounding: f32,
}

/// A point on its way to its place.
#[derive(Clone, Copy)]
struct Item {
    xyz: [f32; 3],
    index: u32,
}

impl KdTree {
    /// The tree of `points`, finite coordinates in metres.
    pub(crate) fn new(points: &[[f64; 3]], cancel: &Cancel) -> Result<Self> {
        let (origin, rounding) = frame(points);
        let local = |point: &[f64; 3]| {
            [
                point[0] - origin[0],
                point[1] - origin[1],
                point[2] - origin[2],
            ]
            .map(|c| c as f32)
        };
        let item = |index: usize| Item {
            xyz: local(&points[index]),
            index: index as u32,
        };
        let mut items = tabulate(points.len(), item, cancel)?;
        sort(&mut items, cancel)?;
        let leaves = of_fans(&items, Leaf::new, cancel)?;
        let levels = levels(&items, cancel)?;
        let order = tabulate(items.len(), |at| items[at].index, cancel)?;
        Ok(Self {
            order,
            leaves,
            levels,
            origin,
            rounding,
        })
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.order.len()
    }
}

/// `values` in the order of the tree.
pub(crate) fn arrange<T: Copy + Send + Sync>(
    order: &[u32],
    values: &[T],
    cancel: &Cancel,
) -> Result<Vec<T>> {
    tabulate(order.len(), |at| values[order[at] as usize], cancel)
}

/// What `make` makes of every [`FAN`] values that follow one another.
fn of_fans<T: Sync, U: Send>(
    values: &[T],
    make: impl Fn(&[T]) -> U + Sync,
    cancel: &Cancel,
) -> Result<Vec<U>> {
    let of_fan = |fan: usize| make(&values[fan * FAN..values.len().min((fan + 1) * FAN)]);
    tabulate(values.len().div_ceil(FAN), of_fan, cancel)
}

impl Leaf {
    fn new(items: &[Item]) -> Self {
        let mut leaf = Self([[f32::INFINITY; FAN]; 3]);
        for (slot, item) in items.iter().enumerate() {
            for axis in 0..3 {
                leaf.0[axis][slot] = item.xyz[axis];
            }
        }
        leaf
    }

    /// Coordinates of the points that it has.
    pub(crate) fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        let slots = (0..FAN).map(|slot| self.point(slot));
        slots.take_while(|point| point[0] < f32::INFINITY)
    }

    /// Squared distance of each of its points from `point`.
    #[inline(always)]
    pub(crate) fn squared_distances(&self, point: [f32; 3]) -> [f32; FAN] {
        let mut squared = [0.0; FAN];
        for slot in 0..FAN {
            let [x, y, z] = [
                self.0[0][slot] - point[0],
                self.0[1][slot] - point[1],
                self.0[2][slot] - point[2],
            ];
            squared[slot] = x * x + y * y + z * z;
        }
        squared
    }

    /// Coordinates of the point in `slot`.
    #[inline(always)]
    pub(crate) fn point(&self, slot: usize) -> [f32; 3] {
        [self.0[0][slot], self.0[1][slot], self.0[2][slot]]
    }
}

/// Origin, and largest error of a coordinate that is rounded to single precision relative to it.
fn frame(points: &[[f64; 3]]) -> ([f64; 3], f32) {
    let exact = |point: &[f64; 3]| point.iter().all(|&c| f64::from(c as f32) == c);
    let Some(first) = points.first().filter(|_| !points.par_iter().all(exact)) else {
        return ([0.0; 3], 0.0);
    };
    let extent = |point: &[f64; 3]| {
        point
            .iter()
            .zip(first)
            .map(|(c, origin)| (c - origin).abs())
            .fold(0.0, f64::max)
    };
    let farthest = points.par_iter().map(extent).reduce(|| 0.0, f64::max);
    (*first, (farthest * f64::from(f32::EPSILON)) as f32)
}

/// Orders `items` so that each run of 16, 256, 4096, ... from the start is compact.
fn sort(items: &mut [Item], cancel: &Cancel) -> Result<()> {
    if items.len() <= FAN {
        return Ok(());
    }
    let middle = split_at(items.len());
    let axis = widest_axis(items);
    select(items, middle, axis, cancel)?;
    let parallel = items.len() > PARALLEL;
    let (left, right) = items.split_at_mut(middle);
    if parallel {
        cancel.check()?;
        let (left, right) = rayon::join(|| sort(left, cancel), || sort(right, cancel));
        left.and(right)
    } else {
        sort(left, cancel)?;
        sort(right, cancel)
    }
}

/// Puts the `middle` lowest items along `axis` first. Of millions of items, a pivot from a sample narrows down where the
/// border lies, a pass at a time, so that there is a moment to look at the flag.
fn select(items: &mut [Item], middle: usize, axis: usize, cancel: &Cancel) -> Result<()> {
    let compare = |a: &Item, b: &Item| a.xyz[axis].total_cmp(&b.xyz[axis]);
    let (mut low, mut high) = (0, items.len());
    while high - low > ITEMS_A_PASS {
        cancel.check()?;
        let within = &mut items[low..high];
        let share = (middle - low) as f64 / within.len() as f64;
        // just beyond the border, on its longer side, which is thus left out
        let rank = share + if share > 0.5 { -0.04 } else { 0.04 };
        let mut sample: Vec<Item> = within
            .iter()
            .step_by(within.len() / SAMPLE)
            .copied()
            .collect();
        sample.sort_unstable_by(compare);
        let pivot = sample[(rank * sample.len() as f64) as usize];
        let below = partition(within, |item| compare(item, &pivot).is_lt());
        let up_to = below + partition(&mut within[below..], |item| compare(item, &pivot).is_eq());
        match middle - low {
            border if border < below => high = low + below,
            border if border < up_to => return Ok(()),
            _ => low += up_to,
        }
    }
    items[low..high].select_nth_unstable_by(middle - low, compare);
    Ok(())
}

/// Puts the items first that `belong` there; how many they are.
fn partition(items: &mut [Item], belong: impl Fn(&Item) -> bool) -> usize {
    let mut first = 0;
    for at in 0..items.len() {
        let belongs = belong(&items[at]);
        items.swap(first, at);
        first += usize::from(belongs);
    }
    first
}

/// Half of `len`, up to whole nodes of the largest size that is smaller than `len`.
fn split_at(len: usize) -> usize {
    let mut unit = FAN;
    while unit * FAN < len {
        unit *= FAN;
    }
    len.div_ceil(unit).div_ceil(2) * unit
}

fn widest_axis(items: &[Item]) -> usize {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for item in items {
        for axis in 0..3 {
            low[axis] = smaller(low[axis], item.xyz[axis]);
            high[axis] = larger(high[axis], item.xyz[axis]);
        }
    }
    let widths = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
    let wider = |a: usize, b: usize| if widths[b] > widths[a] { b } else { a };
    wider(wider(0, 1), 2)
}

/// One box.
#[derive(Clone, Copy)]
struct Hull {
    low: [f32; 3],
    high: [f32; 3],
    first: u32,
}

impl Hull {
    const EMPTY: Self = Self {
        low: [f32::INFINITY; 3],
        high: [f32::NEG_INFINITY; 3],
        first: u32::MAX,
    };

    fn around(hulls: impl Iterator<Item = Self>) -> Self {
        hulls.fold(Self::EMPTY, |mut all, hull| {
            for axis in 0..3 {
                all.low[axis] = smaller(all.low[axis], hull.low[axis]);
                all.high[axis] = larger(all.high[axis], hull.high[axis]);
            }
            all.first = all.first.min(hull.first);
            all
        })
    }
}

fn levels(items: &[Item], cancel: &Cancel) -> Result<Vec<Vec<Boxes>>> {
    let of_point = |item: &Item| Hull {
        low: item.xyz,
        high: item.xyz,
        first: item.index,
    };
    let around_leaf = |items: &[Item]| Hull::around(items.iter().map(of_point));
    let mut hulls = of_fans(items, around_leaf, cancel)?;
    let mut levels = Vec::new();
    loop {
        levels.push(of_fans(&hulls, Boxes::new, cancel)?);
        let around = |hulls: &[Hull]| Hull::around(hulls.iter().copied());
        hulls = of_fans(&hulls, around, cancel)?;
        if hulls.len() <= 1 {
            return Ok(levels);
        }
    }
}

impl Boxes {
    fn new(hulls: &[Hull]) -> Self {
        let mut boxes = Self {
            low: [[f32::INFINITY; FAN]; 3],
            high: [[f32::NEG_INFINITY; FAN]; 3],
            first: [u32::MAX; FAN],
        };
        for (child, hull) in hulls.iter().enumerate() {
            for axis in 0..3 {
                boxes.low[axis][child] = hull.low[axis];
                boxes.high[axis][child] = hull.high[axis];
            }
            boxes.first[child] = hull.first;
        }
        boxes
    }

    /// Squared distance of each child from the box `low` to `high`.
    #[inline(always)]
    pub(crate) fn squared_distances(&self, low: &[f32; 3], high: &[f32; 3]) -> [f32; FAN] {
        let mut squared = [0.0; FAN];
        for axis in 0..3 {
            for child in 0..FAN {
                let below = self.low[axis][child] - high[axis];
                let above = low[axis] - self.high[axis][child];
                let gap = larger(larger(below, above), 0.0);
                squared[child] += gap * gap;
            }
        }
        squared
    }
}

/// The larger of two numbers, the second where one is none: a single instruction, unlike `max`.
#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_hold_whole_powers_of_sixteen() {
        assert_eq!(
            [17, 32, 256, 257, 4097, 20_301].map(split_at),
            [16, 16, 128, 256, 4096, 12_288]
        );
    }

    #[test]
    fn every_point_has_one_place_and_lies_in_its_boxes() {
        let points: Vec<[f64; 3]> = (0..5000_i32)
            .map(|i| [f64::from(i % 71), f64::from(i % 37), f64::from(i % 13)])
            .collect();
        let tree = KdTree::new(&points, Cancel::never()).unwrap();
        let mut order = tree.order.clone();
        order.sort_unstable();
        assert!(
            order
                .iter()
                .enumerate()
                .all(|(i, &index)| i == index as usize)
        );
        assert_eq!(
            tree.levels.iter().map(Vec::len).collect::<Vec<_>>(),
            [20, 2, 1]
        );
        for (position, &index) in tree.order.iter().enumerate() {
            let point = tree.leaves[position / FAN].point(position % FAN);
            assert_eq!(point.map(f64::from), points[index as usize]);
            for (level, nodes) in tree.levels.iter().enumerate() {
                let child = position / FAN.pow(level as u32 + 1);
                let squared = nodes[child / FAN].squared_distances(&point, &point);
                assert_eq!(squared[child % FAN], 0.0);
                assert!(nodes[child / FAN].first[child % FAN] <= index);
            }
        }
    }

    #[test]
    fn map_coordinates_are_rounded_relative_to_a_point_of_theirs() {
        let points = [[5e5 + 0.125, 5e6 + 0.1, 100.0], [5e5 + 7.0, 5e6, 101.0]];
        let tree = KdTree::new(&points, Cancel::never()).unwrap();
        assert_eq!(tree.origin, points[0]);
        assert!(tree.rounding > 0.0 && tree.rounding < 2e-6);
        let near = KdTree::new(&[[0.5, 2.0, 3.0]], Cancel::never()).unwrap();
        assert_eq!(near.rounding, 0.0);
    }
}
