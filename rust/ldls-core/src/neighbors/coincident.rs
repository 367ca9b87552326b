//! Clouds in which many points share their place: stored twice, rounded to a grid, or all at one spot.
//!
//! Where a place has more points than a search keeps candidates, each of its points would meet all the others. So each
//! place is searched once, and its points share what was found.

use super::adjacency::Adjacency;
use super::candidates::squared_distance;
use super::kdtree::{KdTree, Leaf, arrange};
use crate::memory::{collect, with_room, zeros};
use crate::{Cancel, Error, Result};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Leaves that are looked at to tell whether a cloud is crowded.
const LEAVES_LOOKED_AT: usize = 512;
/// Places handled by one task of the thread pool.
const PLACES_A_TASK: usize = 512;

/// True if half of the points or more share their place with another one, as far as some leaves tell.
pub(super) fn is_crowded(tree: &KdTree) -> bool {
    let some = tree
        .leaves
        .iter()
        .step_by(tree.leaves.len().div_ceil(LEAVES_LOOKED_AT).max(1));
    let points = |leaf: &Leaf| leaf.points().count();
    let shared = |leaf: &Leaf| {
        let shares = |slot: &usize| {
            let same = |(other, point)| other != *slot && point == leaf.point(*slot);
            leaf.points().enumerate().any(same)
        };
        (0..points(leaf)).filter(shares).count()
    };
    let (shared, points) = some.fold((0, 0), |(s, p), leaf| (s + shared(leaf), p + points(leaf)));
    points > 1 && 2 * shared >= points
}

/// The `k` nearest neighbours of each of `points`.
pub(super) fn search(points: &[[f64; 3]], k: usize, cancel: &Cancel) -> Result<Adjacency> {
    let (places, place_of) = number_places(points, cancel)?;
    let members = Members::new(&place_of, places.len(), cancel)?;
    // k other places are enough: the lowest point of each is among the nearest
    let tree = KdTree::new(&places, cancel)?;
    let nearest = Adjacency::search(tree, &places, k, cancel)?;
    let degree = k.min(points.len() - 1) + 1;

    let mut order = with_room(points.len())?;
    let mut first = with_room(nearest.order.len() + 1)?;
    for &place in &nearest.order {
        first.push(order.len());
        order.extend_from_slice(members.of(place));
    }
    first.push(order.len());
    let mut position = zeros(points.len(), cancel)?;
    for (at, &index) in order.iter().enumerate() {
        position[index as usize] = at as u32;
    }
    cancel.check()?;

    let mut columns = zeros(points.len() * degree, cancel)?;
    let mut tasks: Vec<(Range<usize>, &mut [u32])> = Vec::new();
    let mut rest = &mut columns[..];
    for start in (0..nearest.order.len()).step_by(PLACES_A_TASK) {
        let end = nearest.order.len().min(start + PLACES_A_TASK);
        let (rows, others) = rest.split_at_mut((first[end] - first[start]) * degree);
        tasks.push((start..end, rows));
        rest = others;
    }
    tasks.into_par_iter().try_for_each(|(task, rows)| {
        cancel.check()?;
        let mut rows = rows.chunks_mut(degree);
        let mut around = Vec::new();
        for at in task {
            nearest_points(&nearest, &members, at, degree, &mut around);
            let own = members.of(nearest.order[at]);
            for (&index, row) in own.iter().zip(&mut rows) {
                row[0] = position[index as usize];
                let others = around.iter().filter(|&&(_, other)| other != index);
                for (slot, &(_, other)) in row[1..].iter_mut().zip(others) {
                    *slot = position[other as usize];
                }
            }
        }
        Ok::<(), Error>(())
    })?;
    Ok(Adjacency {
        points: arrange(&order, points, cancel)?,
        order,
        degree,
        columns: Arc::new(columns),
    })
}

/// Fills `around` with squared distance and index of the `degree` points nearest to the place at position `at`, its own
/// among them; of equally near ones those of the lowest indices.
fn nearest_points(
    nearest: &Adjacency,
    members: &Members,
    at: usize,
    degree: usize,
    around: &mut Vec<(f64, u32)>,
) {
    around.clear();
    let row = &nearest.columns[at * nearest.degree..(at + 1) * nearest.degree];
    for &other in row {
        let squared = squared_distance(&nearest.points[at], &nearest.points[other as usize]);
        let enough = around.len() >= degree;
        if enough && around.last().is_some_and(|&(last, _)| squared > last) {
            break;
        }
        let own = members.of(nearest.order[other as usize]);
        around.extend(own.iter().take(degree).map(|&index| (squared, index)));
    }
    around.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
    around.truncate(degree);
}

/// The different places of `points` in the order of their first points, and the number of the place of each.
fn number_places(points: &[[f64; 3]], cancel: &Cancel) -> Result<(Vec<[f64; 3]>, Vec<u32>)> {
    let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
    let no_room = |_| Error::OutOfMemory {
        bytes: points.len() * size_of::<([u64; 3], u32)>(),
    };
    numbers.try_reserve(points.len()).map_err(no_room)?;
    let mut places = with_room(points.len())?;
    let mut place_of = with_room(points.len())?;
    for block in points.chunks(Cancel::ITEMS_A_LOOK) {
        cancel.check()?;
        for point in block {
            // zeros of both signs are one place
            let key = point.map(|c| (c + 0.0).to_bits());
            let number = *numbers.entry(key).or_insert_with(|| {
                places.push(*point);
                places.len() as u32 - 1
            });
            place_of.push(number);
        }
    }
    Ok((places, place_of))
}

/// The points of each place, ascending.
struct Members {
    offsets: Vec<usize>,
    indices: Vec<u32>,
}

impl Members {
    fn new(place_of: &[u32], places: usize, cancel: &Cancel) -> Result<Self> {
        let mut offsets = zeros(places + 1, cancel)?;
        for &place in place_of {
            offsets[place as usize + 1] += 1;
        }
        for place in 1..=places {
            offsets[place] += offsets[place - 1];
        }
        cancel.check()?;
        let mut next = collect(offsets[..places].iter().copied(), cancel)?;
        let mut indices = zeros(place_of.len(), cancel)?;
        for (index, &place) in place_of.iter().enumerate() {
            indices[next[place as usize]] = index as u32;
            next[place as usize] += 1;
        }
        Ok(Self { offsets, indices })
    }

    fn of(&self, place: u32) -> &[u32] {
        &self.indices[self.offsets[place as usize]..self.offsets[place as usize + 1]]
    }
}
