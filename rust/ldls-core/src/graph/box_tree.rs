//! Points in boxes within boxes, to tell whether two sets of them come near to one another.

use crate::memory::filled;
use crate::{Cancel, Result};
use std::ops::Range;

/// Points of the smallest boxes.
const LEAF: usize = 16;

/// Points, and the boxes around runs of them, each half as long as the one before. Points that follow one another should
/// be near. All in metres.
pub(super) struct BoxTree {
    points: Vec<[f64; 3]>,
    /// Box i lies in box i / 2; 1 holds all points, those from `leaves` on a run of [`LEAF`] points each.
    bounds: Vec<Bounds>,
    leaves: usize,
}

impl BoxTree {
    pub(super) fn around(points: Vec<[f64; 3]>, cancel: &Cancel) -> Result<Self> {
        let leaves = points.len().div_ceil(LEAF).next_power_of_two();
        let mut bounds = filled(Bounds::EMPTY, 2 * leaves, cancel)?;
        for (leaf, run) in bounds[leaves..].iter_mut().zip(points.chunks(LEAF)) {
            for point in run {
                leaf.include(point, point);
            }
        }
        for at in (2..2 * leaves).rev() {
            let Bounds { low, high } = bounds[at];
            bounds[at / 2].include(&low, &high);
        }
        Ok(Self {
            points,
            bounds,
            leaves,
        })
    }

    /// True if a point lies within `gap` metres of one of the other's.
    pub(super) fn come_near(&self, other: &Self, gap: f64, cancel: &Cancel) -> Result<bool> {
        self.near((1, other, 1), gap * gap, cancel)
    }

    /// True if points of box `at` and of box `beside` of the other come near, by the square of the gap.
    fn near(
        &self,
        (at, other, beside): (usize, &Self, usize),
        squared: f64,
        cancel: &Cancel,
    ) -> Result<bool> {
        cancel.check()?;
        if self.bounds[at].squared_gap(&other.bounds[beside]) > squared {
            return Ok(false);
        }
        if at >= self.leaves && beside >= other.leaves {
            let others = other.of_leaf(beside);
            let within = |one: &[f64; 3]| others.iter().any(|other| apart(one, other) <= squared);
            return Ok(self.of_leaf(at).iter().any(within));
        }
        for own in self.halves(at) {
            for beside in other.halves(beside) {
                if self.near((own, other, beside), squared, cancel)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// The boxes in box `at`, which is its own half if it is one of the smallest.
    fn halves(&self, at: usize) -> Range<usize> {
        if at < self.leaves {
            2 * at..2 * at + 2
        } else {
            at..at + 1
        }
    }

    fn of_leaf(&self, at: usize) -> &[[f64; 3]] {
        let first = (at - self.leaves) * LEAF;
        &self.points[first..self.points.len().min(first + LEAF)]
    }
}

/// Squared distance of two points.
fn apart(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    let along = |axis: usize| (one[axis] - other[axis]) * (one[axis] - other[axis]);
    along(0) + along(1) + along(2)
}

/// A box along the axes.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

impl Bounds {
    /// That of no point, infinitely far from all others.
    const EMPTY: Self = Self {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    fn include(&mut self, low: &[f64; 3], high: &[f64; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(low[axis]);
            self.high[axis] = self.high[axis].max(high[axis]);
        }
    }

    /// The square of a distance that no two points of both are nearer than.
    fn squared_gap(&self, other: &Self) -> f64 {
        let along = |axis: usize| {
            let gap = (self.low[axis] - other.high[axis]).max(other.low[axis] - self.high[axis]);
            gap.max(0.0) * gap.max(0.0)
        };
        along(0) + along(1) + along(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(most: usize) -> impl Strategy<Value = Vec<[f64; 3]>> {
        let point = proptest::array::uniform3(-20_i32..20).prop_map(|xyz| xyz.map(f64::from));
        proptest::collection::vec(point, 1..most)
    }

    proptest! {
        #[test]
        fn sets_come_near_where_two_points_do(one in points(90), other in points(40), shift in 0.0..60.0_f64, gap in 0.0..9.0_f64) {
            let other: Vec<_> = other.into_iter().map(|[x, y, z]| [x + shift, y, z]).collect();
            let expected = one.iter().any(|a| other.iter().any(|b| apart(a, b) <= gap * gap));
            let [one, other] = [one, other].map(|points| BoxTree::around(points, Cancel::never()).unwrap());
            prop_assert_eq!(one.come_near(&other, gap, Cancel::never()).unwrap(), expected);
            prop_assert_eq!(other.come_near(&one, gap, Cancel::never()).unwrap(), expected);
        }
    }
}
