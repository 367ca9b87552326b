//! The order in which labels take their lanes.
//!
//! A group of lanes costs time wherever one of its labels comes, so labels whose seeds lie in the same parts of the cloud make a
//! group, and it is zero over most of the rest.

use crate::Real;
use crate::masks::PixelLabels;
use rayon::prelude::*;
use std::cmp::Reverse;

/// Parts of the cloud that are told apart, a bit each: rows are in the order of the tree, so near rows are near points.
const PARTS: usize = u64::BITS as usize;

/// `labels` in the order of the lanes that they take after the first `own`, where `width` make a group. Label l has `extents[l]`.
///
/// The first group, if it has lanes of its own, is in use everywhere, so the labels with the most seeds are free there. The others
/// follow by the first part that they have seeds in, and then change places with others as long as that leaves groups with fewer
/// parts.
pub(super) fn in_order(
    mut labels: Vec<u32>,
    extents: &[Extent],
    own: usize,
    width: usize,
) -> Vec<u32> {
    let of = |label: &u32| extents[*label as usize];
    labels.sort_by_key(|label| Reverse(of(label).seeds));
    let in_first = if own > 0 { width - own } else { 0 };
    if let Some(rest) = labels.get_mut(in_first..) {
        rest.sort_by_key(|label| (of(label).parts.trailing_zeros(), *label));
    }
    let with_parts = labels.iter().map(|label| (*label, of(label).parts));
    let mut labels: Vec<(u32, u64)> = with_parts.collect();
    change_places(&mut labels, own, width);
    labels.into_iter().map(|(label, _)| label).collect()
}

/// How far the seeds of a label reach.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Extent {
    /// Number of its seeds.
    pub(super) seeds: u64,
    /// A bit for each part of the cloud that has one.
    parts: u64,
}

impl Extent {
    fn with(self, other: Self) -> Self {
        Self {
            seeds: self.seeds + other.seeds,
            parts: self.parts | other.parts,
        }
    }
}

/// That of the seeds in `b` of each label up to the highest of `labels`.
pub(super) fn extents<T: Real>(b: &PixelLabels<T>, labels: &[u32]) -> Vec<Extent> {
    let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
    let size = b.rows().div_ceil(PARTS).max(1);
    let none = || vec![Extent::default(); n_labels];
    let of_part = |mut found: Vec<Extent>, part: usize| {
        for row in part * size..b.rows().min((part + 1) * size) {
            for (label, _) in b.row(row).filter(|&(label, _)| label < n_labels) {
                let one = Extent {
                    seeds: 1,
                    parts: 1 << part,
                };
                found[label] = found[label].with(one);
            }
        }
        found
    };
    let both = |mut found: Vec<Extent>, other: Vec<Extent>| {
        let all = found.iter_mut().zip(other);
        all.for_each(|(one, other)| *one = one.with(other));
        found
    };
    let parts_a_task = PARTS / (4 * rayon::current_num_threads()).min(PARTS);
    let parts = (0..b.rows().div_ceil(size)).into_par_iter();
    let tasks = parts.with_min_len(parts_a_task).fold(none, of_part);
    tasks.reduce(none, both)
}

/// Lets each of `labels`, which have seeds in these parts, change places with the one of another group that leaves both groups
/// with the fewest parts, if any does.
fn change_places(labels: &mut [(u32, u64)], own: usize, width: usize) {
    let group = |place: usize| (own + place) / width;
    let cost = |place: usize, parts: u64| {
        let is_free = own > 0 && group(place) == 0;
        if is_free {
            0
        } else {
            parts.count_ones() as i32
        }
    };
    let mut others = vec![0; labels.len()];
    let unite_others = |labels: &[(u32, u64)], others: &mut [u64], group: usize| {
        let first = (group * width).saturating_sub(own);
        let places = first..((group + 1) * width - own).min(labels.len());
        for place in places.clone() {
            let of_group = places.clone().filter(|&other| other != place);
            others[place] = of_group.fold(0, |all, other| all | labels[other].1);
        }
    };
    (0..=group(labels.len())).for_each(|group| unite_others(labels, &mut others, group));
    for one in 0..labels.len() {
        let change = |&other: &usize| {
            let [parts, its] = [labels[one].1, labels[other].1];
            let before = cost(one, others[one] | parts) + cost(other, others[other] | its);
            cost(one, others[one] | its) + cost(other, others[other] | parts) - before
        };
        let elsewhere = (0..labels.len()).filter(|&other| group(other) != group(one));
        let best = elsewhere.min_by_key(change);
        if let Some(other) = best.filter(|other| change(other) < 0) {
            labels.swap(one, other);
            for place in [one, other] {
                unite_others(labels, &mut others, group(place));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::one_seed_each;
    use proptest::prelude::*;

    #[test]
    fn labels_of_the_same_parts_make_a_group() {
        let mut labels: Vec<(u32, u64)> = (0..9).map(|label| (label, 1 << (label % 3))).collect();
        change_places(&mut labels, 0, 3);
        let groups = labels
            .chunks(3)
            .map(|group| group.iter().map(|(_, parts)| parts));
        assert!(groups.clone().all(|mut group| {
            let first = group.next();
            group.all(|parts| Some(parts) == first)
        }));
    }

    #[test]
    fn labels_that_come_to_the_most_parts_go_to_the_group_that_is_in_use_everywhere() {
        let mut labels = [(1, 0b1), (2, 0b1), (3, 0b1111), (4, 0b1)];
        change_places(&mut labels, 2, 3);
        assert_eq!(labels[0].0, 3);
    }

    #[test]
    fn labels_of_one_place_lie_side_by_side_and_those_of_the_most_seeds_in_the_first_group() {
        let b = one_seed_each(640, &[0, 9, 600, 12, 610, 11, 620]);
        let mut extents = extents(&b, &[0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!((extents[6].seeds, extents[7].seeds), (1, 0));
        let order = |extents: &[Extent], own| in_order((1..7).collect(), extents, own, 3);
        assert_eq!(order(&extents, 0), [1, 3, 5, 2, 4, 6]);
        extents[4].seeds = 9;
        assert_eq!(order(&extents, 2)[0], 4);
    }

    proptest! {
        #[test]
        fn places_change_only_where_groups_come_to_have_fewer_parts(
            parts in proptest::collection::vec(any::<u64>(), 0..40),
            own in 0_usize..4,
        ) {
            let width = 4;
            let cost = |labels: &[(u32, u64)]| {
                let mut parts = vec![0; labels.len() / width + 2];
                for (place, (_, of_label)) in labels.iter().enumerate() {
                    parts[(own + place) / width] |= of_label;
                }
                let free = usize::from(own > 0);
                parts[free..].iter().map(|parts| parts.count_ones()).sum::<u32>()
            };
            let before: Vec<(u32, u64)> = (0..).zip(parts).collect();
            let mut after = before.clone();
            change_places(&mut after, own, width);
            prop_assert!(cost(&after) <= cost(&before));
            after.sort_unstable();
            prop_assert_eq!(after, before);
        }
    }
}
