//! Images of several moments: which of them a point takes its pixels from.
//!
//! A point takes those of the images of its own moment, for what moves is elsewhere in the others. Where these overlook an
//! object, points on its place take those of the nearest other that shows it: the pixels look like background and say
//! nothing. A mask shows points as far away as its object. An object is overlooked where at least two other images show it,
//! at the moment before or after, or at some before and some after; a single mask may be a segmenter's mistake, and what is
//! not seen again may have left.

use super::same_objects::Objects;
use super::shown::Shown;
use super::view::View;
use crate::Result;
use crate::memory::push;
use crate::projection::Sighting;
use std::collections::BTreeSet;

/// Masks from which on an object may be where an image has none.
const MASKS_OF_AN_OBJECT: usize = 2;

/// What is known of the points in view before each has its images.
pub(super) struct Moments<'a> {
    pub(super) views: &'a [View<'a>],
    /// What each image shows of all points that it would see, if all were swept at its moment.
    pub(super) shown: &'a [Shown<'a>],
    /// Label of each instance of each image.
    pub(super) labels: &'a [Vec<u32>],
    pub(super) objects: &'a Objects,
}

impl Moments<'_> {
    /// The points that take their pixels from each image; `own` are the positions of those of its own moment.
    pub(super) fn sightings(&self, own: &[[usize; 2]]) -> Result<Vec<Sighting>> {
        let mut taken: Vec<Vec<(u32, u32)>> = vec![Vec::new(); self.views.len()];
        let moments = self.numbers();
        for (image, &[start, end]) in own.iter().enumerate() {
            let (lenders, objects) = self.lenders(moments[image], &moments);
            let shown = &self.shown[image];
            let seen = &shown.sighting.seen;
            let slot = |place: usize| seen.partition_point(|&point| (point as usize) < place);
            for slot in slot(start)..slot(end) {
                let (point, slot) = (seen[slot], slot as u32);
                // a mask of its own moment knows better
                let free = !lenders.is_empty() && shown.is_background(slot);
                let lends = |&lender: &usize| {
                    let slot = self.shown[lender].slot(point)?;
                    let shows = |m: u32| objects[self.labels[lender][m as usize] as usize];
                    let mut instances = self.shown[lender].instances(slot);
                    instances.any(shows).then_some((lender, slot))
                };
                let (image, slot) = lenders
                    .iter()
                    .filter(|_| free)
                    .find_map(lends)
                    .unwrap_or((image, slot));
                push(&mut taken[image], (point, slot))?;
            }
        }
        let sighting = |(shown, mut taken): (&Shown, Vec<(u32, u32)>)| {
            taken.sort_unstable();
            Sighting {
                seen: taken.iter().map(|&(point, _)| point).collect(),
                uv: taken
                    .iter()
                    .map(|&(_, slot)| shown.sighting.uv[slot as usize])
                    .collect(),
            }
        };
        Ok(self.shown.iter().zip(taken).map(sighting).collect())
    }

    /// Number of the moment of each image, from 0 in the order of their rows.
    fn numbers(&self) -> Vec<usize> {
        let starts = self.views.iter().map(|view| view.rows[0]);
        let sorted: BTreeSet<usize> = starts.clone().collect();
        starts.map(|start| sorted.range(..start).count()).collect()
    }

    /// The images of other moments than `own`, the nearest first and of these the earlier, and by label the objects that
    /// those of `own` overlook; no images where they overlook none.
    fn lenders(&self, own: usize, moments: &[usize]) -> (Vec<usize>, Vec<bool>) {
        let overlooked = |masks: &Vec<(usize, u32)>| {
            let shown = || masks.iter().map(|&(image, _)| moments[image]);
            let near = shown().any(|moment| moment.abs_diff(own) == 1);
            let around = shown().any(|moment| moment < own) && shown().any(|moment| moment > own);
            masks.len() >= MASKS_OF_AN_OBJECT
                && shown().all(|moment| moment != own)
                && (near || around)
        };
        let objects: Vec<bool> = [false]
            .into_iter()
            .chain(self.objects.iter().map(overlooked))
            .collect();
        let mut others: Vec<usize> = (0..self.views.len())
            .filter(|&other| moments[other] != own)
            .collect();
        others.sort_by_key(|&other| (moments[other].abs_diff(own), moments[other]));
        if !objects.contains(&true) {
            others.clear();
        }
        (others, objects)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{camera, masks, wall};
    use crate::{Cancel, Cloud, InstanceMasks, Params, Segmentation};

    /// The wall, swept once a moment, before a camera that finds `moments` of masks.
    fn segment(moments: &[InstanceMasks]) -> Segmentation {
        let (values, camera) = (wall().repeat(moments.len()), camera(20.0));
        let cloud = Cloud::F64 {
            values: &values,
            columns: 3,
        };
        let n = cloud.len() / moments.len();
        let views = moments.iter().enumerate().map(|(moment, masks)| View {
            masks,
            categories: &[1; 4][..masks.len()],
            scores: &[1.0; 4][..masks.len()],
            camera: &camera,
            rows: [moment * n, (moment + 1) * n],
        });
        let views: Vec<View> = views.collect();
        let params = Params {
            iterations: Some(2),
            ..Params::paper()
        };
        crate::segment(cloud, &views, 0.5, &params, false, Cancel::never()).unwrap()
    }

    /// Numbers of the points of each moment with each label.
    fn counts(found: &Segmentation, moments: usize) -> Vec<Vec<usize>> {
        let of_moment = |labels: &[i32]| {
            let count = |label: i32| labels.iter().filter(|&&own| own == label).count();
            (1..=found.objects.len() as i32).map(count).collect()
        };
        let moments = found.labels.chunks(found.labels.len() / moments);
        moments.map(of_moment).collect()
    }

    const OBJECT: [usize; 4] = [5, 8, 12, 10];
    const ELSEWHERE: [usize; 4] = [5, 28, 12, 8];

    #[test]
    fn an_image_that_misses_an_object_takes_it_from_those_that_show_it() {
        let found = segment(&[masks(&[OBJECT]), masks(&[]), masks(&[OBJECT])]);
        assert_eq!(found.objects, [[(0, 1), (2, 1)]]);
        let counts = counts(&found, 3);
        assert!(counts[0][0] > 10, "{counts:?}");
        assert_eq!(counts[0], counts[1]);
    }

    #[test]
    fn a_mask_that_a_single_image_has_counts_for_its_own_points_alone() {
        let found = segment(&[
            masks(&[OBJECT]),
            masks(&[]),
            masks(&[]),
            masks(&[]),
            masks(&[]),
        ]);
        let alone = counts(&segment(&[masks(&[OBJECT])]), 1);
        assert!(alone[0][0] > 10, "{alone:?} {:?}", counts(&found, 5));
        assert_eq!(counts(&found, 5)[1..].concat(), [0; 4]);
    }

    #[test]
    fn a_mask_of_its_own_moment_knows_better() {
        // what stands there at the second moment overlaps too little to be the same object
        let other = [5, 13, 12, 14];
        let found = segment(&[masks(&[OBJECT]), masks(&[other]), masks(&[OBJECT])]);
        assert_eq!(found.objects.len(), 2);
        let alone = segment(&[masks(&[]), masks(&[other]), masks(&[])]);
        let (found, alone) = (counts(&found, 3), counts(&alone, 3));
        assert!(found[1][1] >= alone[1][0] / 2, "{found:?} {alone:?}");
    }

    #[test]
    fn images_see_the_points_of_their_own_moment() {
        let found = segment(&[masks(&[OBJECT, ELSEWHERE]), masks(&[ELSEWHERE])]);
        let n = found.labels.len() / 2;
        for (moment, sighting) in found.sightings.iter().enumerate() {
            let rows = sighting
                .seen
                .iter()
                .map(|&at| found.in_view[at as usize] as usize);
            let (own, rows) = (moment * n..(moment + 1) * n, rows.collect::<Vec<_>>());
            assert!(!rows.is_empty() && rows.iter().all(|row| own.contains(row)));
        }
        assert_eq!(found.objects.len(), 2);
    }
}
