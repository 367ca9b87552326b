//! The choice, in double precision, of the nearest neighbours of a point among candidates, which the searches find.

use super::kdtree::KdTree;
use super::keys::{Key, position_of};

/// Squared distance, index and position of a candidate.
pub(crate) type Candidate = (f64, u32, u32);

/// Squared distance of two points, in double precision and always in the same order.
#[inline]
pub(crate) fn squared_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

#[inline(always)]
pub(crate) fn precedes(a: Candidate, b: Candidate) -> bool {
    a.0 < b.0 || (a.0 == b.0 && a.1 < b.1)
}

/// Fills `row` with the nearest of `candidates`, of which there are at most `LEN`, by double precision; false if they are
/// too few.
pub(crate) fn decide<const LEN: usize>(
    tree: &KdTree,
    points: &[[f64; 3]],
    candidates: &[Key],
    position: usize,
    row: &mut [u32],
) -> bool {
    let from = points[position];
    let mut exact = [(0.0, 0, 0); LEN];
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
