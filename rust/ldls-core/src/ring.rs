//! Several cameras around one lidar: one graph over all points that any of them sees.
//!
//! Every camera adds the pixel edges of the points that it sees, so that where images overlap, they vote. An object that
//! two images show has an instance in each; the two are one label if the points that both cameras see agree.

use crate::camera::{Sight, check_points};
use crate::segment::{Seeds, Stopwatch, check_edges, label_points};
use crate::{
    Camera, Cloud, InstanceMasks, Memory, Params, PixelLabels, Real, Result, Segmentation, View,
    ViewCounts,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Points handled by one task of the thread pool.
const BLOCK: usize = 4096;
/// Entry for points that a camera does not see.
const UNSEEN: u32 = u32::MAX;

/// What one camera of a ring took.
#[derive(Debug, Clone, Copy)]
pub struct RingView<'a> {
    /// Instance masks of its image.
    pub masks: &'a InstanceMasks,
    /// Category of each of them: only instances of one category become one object.
    pub categories: &'a [i32],
    /// The camera.
    pub camera: &'a Camera,
}

/// Points that one camera sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sighting {
    /// Positions in the list of points that any camera sees, ascending.
    pub seen: Vec<u32>,
    /// Where they fall: u (right), v (down), in pixels.
    pub uv: Vec<[f64; 2]>,
}

/// Labels of all points of a cloud by several images.
#[derive(Debug, Clone)]
pub struct RingSegmentation {
    /// Labels of points; its view has no pixels of its own.
    pub segmentation: Segmentation,
    /// What each camera sees.
    pub sightings: Vec<Sighting>,
    /// The instances that object l = 1, 2, ... consists of, at `objects[l - 1]`: camera and instance, the latter from 1.
    pub objects: Vec<Vec<(usize, u32)>>,
}

/// Segments `cloud` by the instance masks of the images that several cameras took at one moment; otherwise as
/// [`crate::segment`].
///
/// Instances of two images become one object if, of the points that both cameras see and that fall on one of the two
/// masks, at least the share `same_object` falls on both.
///
/// # Errors
/// As [`crate::segment`]; [`crate::Error::Mismatch`] where a view has not one category a mask.
pub fn segment_ring(
    cloud: Cloud,
    views: &[RingView],
    same_object: f64,
    params: &Params,
    keep_origin: bool,
    memory: &mut Memory,
) -> Result<RingSegmentation> {
    params.check()?;
    check_points(cloud.len())?;
    check_edges(cloud.len(), params.neighbors)?;
    for view in views {
        view.check()?;
    }
    let clock = Stopwatch::start();
    let (view, sightings) = sight_all(cloud, views, keep_origin)?;
    let slots: Vec<Vec<u32>> = sightings
        .iter()
        .map(|sighting| sighting.slots(view.indices.len()))
        .collect();
    let objects = same_objects(views, &sightings, &slots, same_object);
    let seeds = Images {
        views,
        sightings: &sightings,
        slots: &slots,
        labels: labels_of(views, &objects),
        count: objects.len() + 1,
    };
    let segmentation = label_points(cloud.len(), view, &seeds, params, clock, memory)?;
    Ok(RingSegmentation {
        segmentation,
        sightings,
        objects,
    })
}

impl RingView<'_> {
    fn check(&self) -> Result<()> {
        if self.masks.len() == self.categories.len() {
            return Ok(());
        }
        Err(crate::Error::Mismatch {
            name: "categories",
            problem: format!("{} for {} masks", self.categories.len(), self.masks.len()),
        })
    }
}

impl Sighting {
    /// Where each of `n` points stands in this sighting.
    fn slots(&self, n: usize) -> Vec<u32> {
        let mut slots = vec![UNSEEN; n];
        for (slot, &point) in self.seen.iter().enumerate() {
            slots[point as usize] = slot as u32;
        }
        slots
    }
}

/// The points that any camera sees, and which cameras see them.
fn sight_all(cloud: Cloud, views: &[RingView], keep_origin: bool) -> Result<(View, Vec<Sighting>)> {
    let n = cloud.len();
    let starts: Vec<usize> = (0..n).step_by(BLOCK).collect();
    let blocks: Vec<Result<(View, Vec<Sighting>)>> = starts
        .into_par_iter()
        .map(|start| sight_rows(cloud, start..n.min(start + BLOCK), views, keep_origin))
        .collect();
    let mut all = View::default();
    let mut sightings = vec![Sighting::default(); views.len()];
    // taken in order, so that the first bad row is the one reported
    for block in blocks {
        let (view, seen_by) = block?;
        let before = all.indices.len() as u32;
        for (sighting, part) in sightings.iter_mut().zip(seen_by) {
            sighting.seen.extend(part.seen.iter().map(|at| before + at));
            sighting.uv.extend(part.uv);
        }
        all.indices.extend(view.indices);
        all.points.extend(view.points);
        all.counts.merge(&view.counts);
    }
    Ok((all, sightings))
}

fn sight_rows(
    cloud: Cloud,
    rows: Range<usize>,
    views: &[RingView],
    keep_origin: bool,
) -> Result<(View, Vec<Sighting>)> {
    let mut view = View::default();
    let mut sightings = vec![Sighting::default(); views.len()];
    for row in rows {
        let Some(xyz) = view.counts.usable(cloud, row, keep_origin)? else {
            continue;
        };
        let mut seen = false;
        let mut in_front = false;
        for (sighting, one) in sightings.iter_mut().zip(views) {
            let (height, width) = (one.masks.height(), one.masks.width());
            match one.camera.sight(&xyz, height, width) {
                Sight::Behind => {}
                Sight::Outside => in_front = true,
                Sight::Seen(uv) => {
                    seen = true;
                    sighting.seen.push(view.indices.len() as u32);
                    sighting.uv.push(uv);
                }
            }
        }
        if seen {
            view.indices.push(row as u32);
            view.points.push(xyz);
        } else {
            count_unseen(&mut view.counts, in_front);
        }
    }
    Ok((view, sightings))
}

fn count_unseen(counts: &mut ViewCounts, in_front: bool) {
    if in_front {
        counts.outside += 1;
    } else {
        counts.behind += 1;
    }
}

/// The instances of all views, those that show one object together.
fn same_objects(
    views: &[RingView],
    sightings: &[Sighting],
    slots: &[Vec<u32>],
    same_object: f64,
) -> Vec<Vec<(usize, u32)>> {
    let mut groups: Vec<Vec<(usize, u32)>> = Vec::new();
    let mut group_of: Vec<Vec<usize>> = Vec::new();
    for (camera, view) in views.iter().enumerate() {
        let first = groups.len();
        groups.extend((1..=view.masks.len() as u32).map(|m| vec![(camera, m)]));
        group_of.push((first..groups.len()).collect());
    }
    for [one, other] in best_first(agreements(views, sightings, slots), same_object) {
        let [kept, joined] = {
            let mut pair = [one, other].map(|(camera, m)| group_of[camera][m as usize - 1]);
            pair.sort_unstable();
            pair
        };
        let cameras = |group: usize| groups[group].iter().map(|&(camera, _)| camera);
        // two instances of one image are two objects
        if kept == joined || cameras(kept).any(|camera| cameras(joined).any(|c| c == camera)) {
            continue;
        }
        let moved = std::mem::take(&mut groups[joined]);
        for &(camera, m) in &moved {
            group_of[camera][m as usize - 1] = kept;
        }
        groups[kept].extend(moved);
        groups[kept].sort_unstable();
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// How many points of two instances agree.
#[derive(Debug, Clone, Copy)]
struct Agreement {
    /// Points on both masks.
    both: usize,
    /// Points on at least one of them.
    either: usize,
}

type Pair = [(usize, u32); 2];

/// Pairs that agree well enough, the best first.
fn best_first(agreements: BTreeMap<Pair, Agreement>, same_object: f64) -> Vec<Pair> {
    let mut pairs: Vec<(Pair, Agreement)> = agreements
        .into_iter()
        .filter(|(_, found)| found.both as f64 >= same_object * found.either as f64)
        .collect();
    // a / b > c / d where a d > c b; the order of the map among equals
    pairs.sort_by(|(_, a), (_, b)| (b.both * a.either).cmp(&(a.both * b.either)));
    pairs.into_iter().map(|(pair, _)| pair).collect()
}

/// Agreement of each two instances of one category in two images on which a point falls that both cameras see.
fn agreements(
    views: &[RingView],
    sightings: &[Sighting],
    slots: &[Vec<u32>],
) -> BTreeMap<Pair, Agreement> {
    let mut found = BTreeMap::new();
    for one in 0..views.len() {
        for other in one + 1..views.len() {
            let shared: Vec<usize> = (0..slots[one].len())
                .filter(|&point| slots[one][point] != UNSEEN && slots[other][point] != UNSEEN)
                .collect();
            let [here, there] = [one, other].map(|camera| {
                let uv = shared
                    .iter()
                    .map(|&point| sightings[camera].uv[slots[camera][point] as usize]);
                instances_at(views[camera].masks, uv)
            });
            let totals = [&here, &there].map(|lists| count(lists.iter().flatten().copied()));
            let pairs = here.iter().zip(&there).flat_map(|(here, there)| {
                here.iter()
                    .flat_map(|&m| there.iter().map(move |&other| (m, other)))
            });
            for ((m, k), both) in count(pairs) {
                let category = |camera: usize, m: u32| views[camera].categories[m as usize - 1];
                if category(one, m) == category(other, k) {
                    let either = totals[0][&m] + totals[1][&k] - both;
                    found.insert([(one, m), (other, k)], Agreement { both, either });
                }
            }
        }
    }
    found
}

fn count<T: Ord>(values: impl Iterator<Item = T>) -> BTreeMap<T, usize> {
    let mut counts = BTreeMap::new();
    for value in values {
        *counts.entry(value).or_default() += 1;
    }
    counts
}

/// The instances on whose masks each of `uv` falls.
fn instances_at(masks: &InstanceMasks, uv: impl Iterator<Item = [f64; 2]>) -> Vec<Vec<u32>> {
    let pixels: Vec<[usize; 2]> = uv
        .filter_map(|uv| crate::camera::nearest_pixel(uv, masks.height(), masks.width()))
        .collect();
    let mut found = vec![Vec::new(); pixels.len()];
    for (m, mask) in (1..).zip(masks.masks()) {
        let [top, left, height, width] = mask.bounding_box();
        let ends: Vec<usize> = mask
            .runs()
            .iter()
            .scan(0, |end, &run| {
                *end += run as usize;
                Some(*end)
            })
            .collect();
        for ([column, row], instances) in pixels.iter().zip(&mut found) {
            let near = (left..left + width).contains(column) && (top..top + height).contains(row);
            let at = column * masks.height() + row;
            // runs of ones have odd numbers
            if near && ends.partition_point(|&end| end <= at) % 2 == 1 {
                instances.push(m);
            }
        }
    }
    found
}

/// Label of each instance of each view: the number of its object; entry 0 is the background.
fn labels_of(views: &[RingView], objects: &[Vec<(usize, u32)>]) -> Vec<Vec<u32>> {
    let mut labels: Vec<Vec<u32>> = views
        .iter()
        .map(|view| vec![0; view.masks.len() + 1])
        .collect();
    for (label, members) in (1..).zip(objects) {
        for &(camera, m) in members {
            labels[camera][m as usize] = label;
        }
    }
    labels
}

/// The pixels of all images.
struct Images<'a> {
    views: &'a [RingView<'a>],
    sightings: &'a [Sighting],
    slots: &'a [Vec<u32>],
    /// Label of each instance of each view.
    labels: Vec<Vec<u32>>,
    count: usize,
}

impl Seeds for Images<'_> {
    fn labels(&self) -> usize {
        self.count
    }

    fn pixel_labels<T: Real>(
        &self,
        order: &[u32],
        params: &Params,
        memory: &mut Memory,
    ) -> Result<PixelLabels<T>> {
        let mut parts = Vec::with_capacity(self.views.len());
        for (camera, view) in self.views.iter().enumerate() {
            let slots = &self.slots[camera];
            let seen = order.iter().map(|&point| slots[point as usize]);
            let uv: Vec<[f64; 2]> = seen
                .filter(|&slot| slot != UNSEEN)
                .map(|slot| self.sightings[camera].uv[slot as usize])
                .collect();
            let labels =
                view.masks
                    .pixel_labels::<T>(&uv, params.window, params.pixel_weight, memory)?;
            parts.push(labels);
        }
        let all = self.together(order, &parts);
        for part in parts {
            part.keep_in(memory);
        }
        Ok(all)
    }
}

impl Images<'_> {
    /// Rows of all cameras that see a point added up, their instances named by the objects they show.
    fn together<T: Real>(&self, order: &[u32], parts: &[PixelLabels<T>]) -> PixelLabels<T> {
        let mut next = vec![0; parts.len()];
        let mut all = PixelLabels {
            offsets: vec![0],
            ..PixelLabels::default()
        };
        let mut row: Vec<(u32, T)> = Vec::new();
        for &point in order {
            row.clear();
            let mut mass = T::default();
            for (camera, part) in parts.iter().enumerate() {
                if self.slots[camera][point as usize] == UNSEEN {
                    continue;
                }
                let at = next[camera];
                next[camera] += 1;
                mass += part.mass[at];
                for (instance, weight) in part.row(at) {
                    let label = self.labels[camera][instance];
                    match row.iter_mut().find(|(known, _)| *known == label) {
                        Some((_, sum)) => *sum += weight,
                        None => row.push((label, weight)),
                    }
                }
            }
            row.sort_unstable_by_key(|&(label, _)| label);
            all.labels.extend(row.iter().map(|&(label, _)| label));
            all.weights.extend(row.iter().map(|&(_, weight)| weight));
            all.mass.push(mass);
            all.offsets.push(all.labels.len());
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rle;
    use proptest::prelude::*;

    const IDENTITY: [f64; 16] = [
        1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
    ];

    /// A camera whose image begins `left` pixels to the left of the axis, 40 x 30 pixels.
    fn camera(left: f64) -> Camera {
        let projection = [20., 0., left, 0., 0., 20., 15., 0., 0., 0., 1., 0.];
        Camera::new(&projection, &IDENTITY, 0.1).unwrap()
    }

    fn masks(rectangles: &[[usize; 4]]) -> InstanceMasks {
        let rle = |&[top, left, height, width]: &[usize; 4]| {
            let pixels: Vec<bool> = (0..30 * 40)
                .map(|at| {
                    (top..top + height).contains(&(at / 40))
                        && (left..left + width).contains(&(at % 40))
                })
                .collect();
            Rle::from_pixels(30, 40, &pixels).unwrap()
        };
        InstanceMasks::new(30, 40, rectangles.iter().map(rle).collect()).unwrap()
    }

    /// A wall of points at z = 1, one every tenth.
    fn wall() -> Vec<f64> {
        let steps = |n: i32| (-n..=n).map(|i| f64::from(i) / 10.0);
        steps(30)
            .flat_map(|x| steps(6).flat_map(move |y| [x, y, 1.0]))
            .collect()
    }

    fn segment(views: &[RingView]) -> RingSegmentation {
        let values = wall();
        let cloud = Cloud::F64 {
            values: &values,
            columns: 3,
        };
        let memory = &mut Memory::of_one_frame();
        segment_ring(cloud, views, 0.5, &Params::paper(), false, memory).unwrap()
    }

    #[test]
    fn a_ring_of_one_camera_gives_what_the_camera_gives() {
        let (masks, camera) = (masks(&[[5, 5, 10, 12], [8, 20, 12, 9]]), camera(20.0));
        let view = RingView {
            masks: &masks,
            categories: &[1, 1],
            camera: &camera,
        };
        let ring = segment(&[view]);
        let values = wall();
        let cloud = Cloud::F64 {
            values: &values,
            columns: 3,
        };
        let memory = &mut Memory::of_one_frame();
        let single =
            crate::segment(cloud, &masks, &camera, &Params::paper(), false, memory).unwrap();
        assert_eq!(ring.segmentation.labels, single.labels);
        assert_eq!(ring.segmentation.confidence, single.confidence);
        assert_eq!(ring.segmentation.view.indices, single.view.indices);
        assert_eq!(ring.sightings[0].uv, single.view.uv);
        assert_eq!(ring.objects, [[(0, 1)], [(0, 2)]]);
    }

    #[test]
    fn an_object_in_two_images_is_one_and_objects_of_one_image_are_not() {
        // the second image begins 20 pixels farther to the right
        let (left, right) = (camera(40.0), camera(20.0));
        let first = masks(&[[5, 24, 12, 10], [5, 2, 8, 8]]);
        let second = masks(&[[5, 4, 12, 10], [5, 5, 12, 10], [5, 30, 8, 8]]);
        let view = |masks, camera, categories| RingView {
            masks,
            categories,
            camera,
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
            let views: Vec<RingView> = parts.iter().zip(&cameras).map(|(masks, camera)| RingView {
                masks, camera, categories: &categories[..masks.len()],
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
            let highest = found.segmentation.labels.iter().max().copied().unwrap_or(0);
            prop_assert!(highest <= found.objects.len() as i32);
        }
    }
}
