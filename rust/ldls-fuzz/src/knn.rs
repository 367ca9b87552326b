//! Nearest neighbours: the tree against a look at every pair.

use crate::clouds::{Point, random_cloud};
use crate::{Bytes, Outcome};
use ldls_core::{Cancel, Neighbors};

/// Neighbours of a random cloud.
pub fn knn(data: &[u8]) -> Outcome {
    let mut bytes = Bytes::new(data);
    let k = [
        1,
        2,
        5,
        10,
        10,
        10,
        11,
        32,
        255,
        1 + usize::from(bytes.byte()) % 255,
    ][bytes.below(10)];
    let points = random_cloud(&mut bytes);
    check_neighbors(&points, k);
    Outcome::Accepted
}

/// Holds the `k` nearest neighbours of `points` against brute force.
///
/// # Panics
/// If they differ.
pub fn check_neighbors(points: &[Point], k: usize) {
    let found = Neighbors::search(points, k, Cancel::never()).expect("memory");
    assert_eq!(
        found.k,
        k.min(points.len().saturating_sub(1)),
        "k of {} points",
        points.len()
    );
    assert_eq!(found.indices.len(), points.len() * found.k);
    let distances = found
        .squared_distances(points, Cancel::never())
        .expect("memory");
    let mut others = Vec::new();
    for (i, from) in points.iter().enumerate() {
        brute_force(points, i, found.k, &mut others);
        let row = i * found.k..(i + 1) * found.k;
        let own = found.indices[row.clone()].iter().zip(&distances[row]);
        for (place, ((&index, &distance), &(expected_distance, expected))) in
            own.zip(&others).enumerate()
        {
            assert_eq!(
                (index, distance),
                (expected, expected_distance),
                "neighbour {place} of {k} of point {i} at {from:?}, one of {}",
                points.len()
            );
        }
    }
}

/// Squared distances and indices of the `k` nearest other points of point `i`, nearest first, ties by index.
fn brute_force(points: &[Point], i: usize, k: usize, others: &mut Vec<(f64, u32)>) {
    let from = points[i];
    let squared = |to: &Point| {
        let [x, y, z]: Point = std::array::from_fn(|axis| from[axis] - to[axis]);
        x * x + y * y + z * z
    };
    others.clear();
    let all = points.iter().enumerate().filter(|&(j, _)| j != i);
    others.extend(all.map(|(j, to)| (squared(to), j as u32)));
    let order = |a: &(f64, u32), b: &(f64, u32)| a.partial_cmp(b).expect("finite distances");
    if k < others.len() {
        others.select_nth_unstable_by(k, order);
        others.truncate(k);
    }
    others.sort_unstable_by(order);
}
