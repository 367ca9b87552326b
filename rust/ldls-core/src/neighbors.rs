//! The K nearest neighbours of every point. The only file that names kiddo.
//!
//! Distances are those of double precision; of equally distant points the one of lower index is nearer. kiddo gives
//! ties in no order and slows down where many points coincide, so it holds every place once, and this file turns
//! places back into points.

use crate::graph::squared_distance;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Points handled by one task of the thread pool.
const BLOCK: usize = 256;

/// The `k` nearest other points of every point, nearest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Neighbors {
    /// Neighbours a point: what was asked for, or one less than there are points.
    pub k: usize,
    /// Neighbours of point i at `i * k..(i + 1) * k`.
    pub indices: Vec<u32>,
}

impl Neighbors {
    /// The `k` nearest neighbours of each of `points`, finite coordinates in metres; the point itself is none of them.
    pub fn search(points: &[[f64; 3]], k: usize) -> Self {
        let k = k.min(points.len().saturating_sub(1));
        if k == 0 {
            return Self::default();
        }
        let places = Places::new(points);
        let mut indices = vec![0; points.len() * k];
        indices.par_chunks_mut(k * BLOCK).enumerate().for_each_init(
            Vec::new,
            |candidates, (block, indices)| {
                for (point, indices) in (block * BLOCK..).zip(indices.chunks_mut(k)) {
                    places.nearest(points[point], point as u32, k, candidates);
                    for (slot, &(_, index)) in indices.iter_mut().zip(candidates.iter()) {
                        *slot = index;
                    }
                }
            },
        );
        Self { k, indices }
    }

    /// Squared distances of the neighbours of `points`, in square metres, in the order of `indices`.
    pub fn squared_distances(&self, points: &[[f64; 3]]) -> Vec<f64> {
        let rows = self.indices.par_chunks(self.k.max(1)).zip(points);
        rows.flat_map_iter(|(row, point)| {
            row.iter()
                .map(|&j| squared_distance(point, &points[j as usize]))
        })
        .collect()
    }

    /// Number of `points` that share their place with another one.
    pub fn duplicates(&self, points: &[[f64; 3]]) -> usize {
        self.coincident(points, 0)
            .filter(|&coincident| coincident)
            .count()
    }

    /// Whether the `k` neighbours of every one of `points` share its place, so that the graph falls into islands.
    pub fn only_islands(&self, points: &[[f64; 3]]) -> bool {
        self.k > 0
            && self
                .coincident(points, self.k - 1)
                .all(|coincident| coincident)
    }

    /// Whether the neighbour of each point at `rank` lies where the point lies.
    fn coincident(&self, points: &[[f64; 3]], rank: usize) -> impl Iterator<Item = bool> {
        let rows = self.indices.chunks(self.k.max(1));
        rows.zip(points)
            .map(move |(row, point)| *point == points[row[rank] as usize])
    }
}

/// Places that points lie at, each once, with the points at each in ascending order.
struct Places {
    tree: ImmutableKdTree<f64, 3>,
    coordinates: Vec<[f64; 3]>,
    offsets: Vec<usize>,
    members: Vec<u32>,
}

impl Places {
    fn new(points: &[[f64; 3]]) -> Self {
        let mut members: Vec<u32> = (0..points.len() as u32).collect();
        let key = |index: &u32| points[*index as usize].map(order);
        members.par_sort_unstable_by_key(|index| (key(index), *index));
        let mut offsets: Vec<usize> = (0..members.len())
            .filter(|&i| i == 0 || key(&members[i - 1]) != key(&members[i]))
            .collect();
        let coordinates: Vec<[f64; 3]> = offsets
            .iter()
            .map(|&start| points[members[start] as usize])
            .collect();
        offsets.push(members.len());
        let tree = ImmutableKdTree::new_from_slice(&coordinates)
            .expect("places are fewer than 2^31: the view checks the number of points");
        Self {
            tree,
            coordinates,
            offsets,
            members,
        }
    }

    /// Fills `candidates` with the squared distance and index of the `k` points nearest to point `index` at `from`.
    fn nearest(&self, from: [f64; 3], index: u32, k: usize, candidates: &mut Vec<(f64, u32)>) {
        // k neighbours, the point itself, and one more to see whether the last place is tied
        let wanted = NonZero::new(k + 2).expect("k + 2 is positive");
        let found = self
            .tree
            .query(&from)
            .nearest_n::<SquaredEuclidean<f64>>(wanted)
            .execute();
        candidates.clear();
        for place in &found {
            self.push_members(from, place.item as usize, index, k, candidates);
        }
        let last = found.last().map_or(0.0, |place| place.distance);
        let full = candidates.len() > k && candidates[k].0 > candidates[k - 1].0;
        if !full && found.len() == k + 2 && candidates[k - 1].0 * (1.0 + 1e-12) >= last {
            self.nearest_of_ties(from, index, k, last, candidates);
        }
        candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        candidates.truncate(k);
    }

    /// As `nearest`, from all places within the squared distance `within`, for the rare row whose last place is tied.
    fn nearest_of_ties(
        &self,
        from: [f64; 3],
        index: u32,
        k: usize,
        within: f64,
        candidates: &mut Vec<(f64, u32)>,
    ) {
        candidates.clear();
        let reach = within * (1.0 + 1e-12);
        for place in self
            .tree
            .query(&from)
            .within::<SquaredEuclidean<f64>>(reach)
            .unsorted()
            .execute()
        {
            self.push_members(from, place.item as usize, index, k, candidates);
        }
    }

    fn push_members(
        &self,
        from: [f64; 3],
        place: usize,
        index: u32,
        k: usize,
        candidates: &mut Vec<(f64, u32)>,
    ) {
        let squared_distance = squared_distance(&from, &self.coordinates[place]);
        let members = &self.members[self.offsets[place]..self.offsets[place + 1]];
        // of coincident points no more than k can be neighbours, and those are the first
        let others = members.iter().filter(|&&member| member != index).take(k);
        candidates.extend(others.map(|&member| (squared_distance, member)));
    }
}

/// A number that sorts as `c` does, the same for 0 and -0.
fn order(c: f64) -> i64 {
    let bits = (c + 0.0).to_bits() as i64;
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(points: &[[f64; 3]], k: usize) -> Neighbors {
        let k = k.min(points.len().saturating_sub(1));
        let mut neighbors = Neighbors {
            k,
            ..Neighbors::default()
        };
        for (i, &from) in points.iter().enumerate() {
            let mut row: Vec<(f64, usize)> = (0..points.len())
                .filter(|&j| j != i)
                .map(|j| (squared_distance(&from, &points[j]), j))
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
        fn quantised_clouds_equal_brute_force(points in quantised(0.25, 300), k in 1_usize..14) {
            prop_assert_eq!(Neighbors::search(&points, k), brute_force(&points, k));
        }

        #[test]
        fn flat_clouds_equal_brute_force(mut points in quantised(0.1, 300), axis in 0_usize..3) {
            for point in &mut points { point[axis] = -0.0; }
            prop_assert_eq!(Neighbors::search(&points, 10), brute_force(&points, 10));
        }

        #[test]
        fn scattered_clouds_equal_brute_force(
            points in proptest::collection::vec([-9.0..9.0_f64, -9.0..9.0, -2.0..2.0], 0..300)
        ) {
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
        assert_eq!(neighbors.duplicates(&points), 120_000);
        assert!(neighbors.only_islands(&points));
    }

    #[test]
    fn fewer_points_than_neighbours_are_joined_to_all_others() {
        assert_eq!(
            Neighbors::search(&[[0.0; 3], [1.0; 3], [3.0; 3]], 10).indices,
            [1, 2, 0, 2, 1, 0]
        );
        assert_eq!(Neighbors::search(&[[0.0; 3]], 10), Neighbors::default());
    }
}
