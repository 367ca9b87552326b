//! The instances of several images that show one object: those on which the points agree that both images see.

use super::shown::Shown;
use super::view::View;
use crate::memory::{push, with_room};
use crate::{Cancel, Result};
use rayon::prelude::*;

/// The instances that object l = 1, 2, ... consists of, at position l - 1: image and instance, the latter from 1.
pub type Objects = Vec<Vec<(usize, u32)>>;

/// Least share of common points of instances of two categories: an object has one category, but a segmenter that takes a
/// van for a lorry at one moment does not at the next.
const SAME_OBJECT_OF_OTHER_CATEGORY: f64 = 0.5;

/// The instances of all views, those that show one object together.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub(super) fn same_objects(
    views: &[View],
    shown: &[Shown],
    same_object: f64,
    cancel: &Cancel,
) -> Result<Objects> {
    let mut groups: Objects = Vec::new();
    let mut group_of: Vec<Vec<usize>> = Vec::new();
    for (image, view) in views.iter().enumerate() {
        let first = groups.len();
        groups.extend((1..=view.masks.len() as u32).map(|m| vec![(image, m)]));
        group_of.push((first..groups.len()).collect());
    }
    for pair in best_first(agreements(views, shown, cancel)?, same_object) {
        let mut pair = pair.map(|(image, m)| group_of[image][m as usize - 1]);
        pair.sort_unstable();
        let [kept, joined] = pair;
        let images = |group: usize| groups[group].iter().map(|&(image, _)| image);
        // two instances of one image are two objects
        if kept == joined || images(kept).any(|image| images(joined).any(|other| other == image)) {
            continue;
        }
        let moved = std::mem::take(&mut groups[joined]);
        for &(image, m) in &moved {
            group_of[image][m as usize - 1] = kept;
        }
        groups[kept].extend(moved);
        groups[kept].sort_unstable();
    }
    groups.retain(|group| !group.is_empty());
    Ok(groups)
}

/// Numbers of points on which two instances agree, and in all.
#[derive(Debug, Clone, Copy)]
struct Agreement {
    /// Whether they are of two categories.
    other_category: bool,
    /// Points on both masks.
    both: usize,
    /// Points on at least one of them.
    either: usize,
}

type Pair = [(usize, u32); 2];

/// Pairs that agree well enough, those of one category before others and the best first.
fn best_first(agreements: Vec<(Pair, Agreement)>, same_object: f64) -> Vec<Pair> {
    let agree = |agreement: &Agreement| {
        let least = if agreement.other_category {
            same_object.max(SAME_OBJECT_OF_OTHER_CATEGORY)
        } else {
            same_object
        };
        agreement.both as f64 >= least * agreement.either as f64
    };
    let pairs = agreements.into_iter();
    let mut pairs: Vec<(Pair, Agreement)> = pairs.filter(|(_, found)| agree(found)).collect();
    // a / b > c / d where a d > c b; the order of images and instances among equals
    pairs.sort_unstable_by(|(pair, a), (other, b)| {
        let better = (b.both * a.either).cmp(&(a.both * b.either));
        let by_category = a.other_category.cmp(&b.other_category);
        by_category.then(better).then(pair.cmp(other))
    });
    pairs.into_iter().map(|(pair, _)| pair).collect()
}

/// Agreement of each two instances in two images on which a point falls that both images see; those of two categories
/// in images of two moments alone.
fn agreements(views: &[View], shown: &[Shown], cancel: &Cancel) -> Result<Vec<(Pair, Agreement)>> {
    let images = 0..views.len();
    let pairs = images.flat_map(|one| (one + 1..views.len()).map(move |other| [one, other]));
    let pairs = pairs.collect::<Vec<_>>().into_par_iter();
    let of_pair = |pair| agreements_of(views, shown, pair, cancel);
    let found: Vec<Vec<_>> = pairs.map(of_pair).collect::<Result<_>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// Those of the instances of two images.
fn agreements_of(
    views: &[View],
    shown: &[Shown],
    [one, other]: [usize; 2],
    cancel: &Cancel,
) -> Result<Vec<(Pair, Agreement)>> {
    cancel.check()?;
    let common = |image: usize, other: usize| {
        let mut counts = vec![0_usize; views[image].masks.len() + 1];
        let marks = shown[image].marks.iter();
        let seen = marks.filter(|(point, _)| shown[other].slot(*point).is_some());
        seen.for_each(|&(_, m)| counts[m as usize] += 1);
        counts
    };
    let (here, there) = (common(one, other), common(other, one));
    // instances that meet, not all that there are: of images of thousands each meets few
    let mut met: Vec<(u32, u32)> = with_room(shown[one].marks.len().min(shown[other].marks.len()))?;
    let mut marks = &shown[other].marks[..];
    for &(point, m) in &shown[one].marks {
        marks = &marks[marks.iter().take_while(|(at, _)| *at < point).count()..];
        for &(_, k) in marks.iter().take_while(|(at, _)| *at == point) {
            push(&mut met, (m, k))?;
        }
    }
    met.sort_unstable();
    let agreement = |same: &[(u32, u32)]| {
        let (m, k) = same[0];
        let (at, there_at) = (m as usize, k as usize);
        let other_category = views[one].categories[at - 1] != views[other].categories[there_at - 1];
        let compared = !other_category || views[one].rows != views[other].rows;
        compared.then(|| {
            let both = same.len();
            let either = here[at] + there[there_at] - both;
            let pair = [(one, m), (other, k)];
            (
                pair,
                Agreement {
                    other_category,
                    both,
                    either,
                },
            )
        })
    };
    Ok(met.chunk_by(PartialEq::eq).filter_map(agreement).collect())
}

#[cfg(test)]
mod tests {
    use super::super::slots::Slots;
    use super::*;
    use crate::Cancel;
    use crate::depth::DepthGroups;
    use crate::masks::LabelImage;
    use crate::projection::Sighting;
    use crate::test_support::{camera, masks, segment};
    use proptest::prelude::*;

    #[test]
    fn an_object_in_two_images_is_one_and_objects_of_one_image_are_not() {
        // the second image begins 20 pixels farther to the right
        let (left, right) = (camera(40.0), camera(20.0));
        let first = masks(&[[5, 24, 12, 10], [5, 2, 8, 8]]);
        let second = masks(&[[5, 4, 12, 10], [5, 5, 12, 10], [5, 30, 8, 8]]);
        let view = |masks, camera, categories: &'static [i32]| View {
            scores: &[1.0; 9][..categories.len()],
            masks,
            categories,
            camera,
            rows: View::ALL_ROWS,
        };
        let ring = segment(&[
            view(&first, &left, &[3, 3]),
            view(&second, &right, &[3, 3, 3]),
        ]);
        let expected: [&[(usize, u32)]; 4] = [&[(0, 1), (1, 1)], &[(0, 2)], &[(1, 2)], &[(1, 3)]];
        assert_eq!(ring.objects, expected);
        let other = segment(&[
            view(&first, &left, &[3, 3]),
            view(&second, &right, &[1, 1, 3]),
        ]);
        assert_eq!(
            other.objects.len(),
            5,
            "instances of two categories stay apart"
        );
    }

    #[test]
    fn instances_that_agree_on_exactly_the_share_asked_for_are_one_object() {
        // of the points on either mask, which lie in the same places of both images, half are on both
        let (first, second) = (masks(&[[5, 8, 6, 8]]), masks(&[[5, 8, 6, 4]]));
        let camera = camera(20.0);
        let view = |masks| View {
            scores: &[1.0],
            masks,
            categories: &[1],
            camera: &camera,
            rows: View::ALL_ROWS,
        };
        let views = [view(&first), view(&second)];
        let sighting = Sighting {
            seen: (0..8).collect(),
            uv: (8..16).map(|u| [f64::from(u), 7.0]).collect(),
        };
        let never = Cancel::never();
        let slots = &Slots::of_images(std::slice::from_ref(&sighting), 8, never).unwrap()[0];
        let painted = [&first, &second].map(|masks| LabelImage::paint(masks, never).unwrap());
        let shown = painted
            .each_ref()
            .map(|image| Shown::new(&sighting, slots, image, None, never).unwrap());
        let objects = |same_object| {
            same_objects(&views, &shown, same_object, never)
                .unwrap()
                .len()
        };
        assert_eq!((objects(0.5), objects(0.5_f64.next_up())), (1, 2));
    }

    #[test]
    fn points_before_and_behind_the_object_of_a_mask_are_not_on_it() {
        // eight points on the masks of both images, of which the second one's object is as far away as half of them
        let masks = masks(&[[5, 8, 6, 8]]);
        let camera = camera(20.0);
        let view = View {
            scores: &[1.0],
            masks: &masks,
            categories: &[1],
            camera: &camera,
            rows: View::ALL_ROWS,
        };
        let sighting = Sighting {
            seen: (0..8).collect(),
            uv: (8..16).map(|u| [f64::from(u), 7.0]).collect(),
        };
        let never = Cancel::never();
        let slots = &Slots::of_images(std::slice::from_ref(&sighting), 8, never).unwrap()[0];
        let painted = LabelImage::paint(&masks, never).unwrap();
        let depths = DepthGroups {
            intervals: vec![Some([2.0, 4.0])],
            distances: vec![2.0, 4.0, 3.0, 3.5, 1.9, 4.1, 9.0, 1.0],
            unsure: Vec::new(),
        };
        let shown = [None, Some(&depths)]
            .map(|depths| Shown::new(&sighting, slots, &painted, depths, never).unwrap());
        let objects = |same_object| {
            same_objects(&[view; 2], &shown, same_object, never)
                .unwrap()
                .len()
        };
        assert_eq!((objects(0.5), objects(0.5_f64.next_up())), (1, 2));
    }

    proptest! {
        #[test]
        fn every_instance_belongs_to_one_object(
            rectangles in proptest::collection::vec(
                (0_usize..20, 0_usize..30, 1_usize..10, 1_usize..10).prop_map(|(t, l, h, w)| [t, l, h, w]), 0..6),
            split in 0_usize..6,
        ) {
            let split = split.min(rectangles.len());
            let parts = [masks(&rectangles[..split]), masks(&rectangles[split..])];
            let cameras = [camera(30.0), camera(20.0)];
            let categories = [1; 6];
            let views: Vec<View> = parts.iter().zip(&cameras).map(|(masks, camera)| View {
                masks, camera, categories: &categories[..masks.len()], scores: &[1.0; 9][..masks.len()],
                rows: View::ALL_ROWS,
            }).collect();
            let found = segment(&views);
            let mut members: Vec<(usize, u32)> = found.objects.concat();
            members.sort_unstable();
            let all: Vec<(usize, u32)> = parts.iter().enumerate()
                .flat_map(|(camera, part)| (1..=part.len() as u32).map(move |m| (camera, m))).collect();
            prop_assert_eq!(members, all);
            for group in &found.objects {
                let cameras: std::collections::BTreeSet<usize> = group.iter().map(|&(camera, _)| camera).collect();
                prop_assert_eq!(cameras.len(), group.len());
            }
            let highest = found.labels.iter().max().copied().unwrap_or(0);
            prop_assert!(highest <= found.objects.len() as i32);
        }
    }
}
