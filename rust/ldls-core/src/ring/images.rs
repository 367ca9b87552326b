//! The pixel edges of all images, added up by object.

use super::same_objects::{Objects, same_objects};
use super::view::View;
use crate::masks::PixelLabels;
use crate::neighbors::arrange;
use crate::projection::{Cloud, InView, Sighting, project};
use crate::{Params, Real, Result};

/// Slot of points that an image does not see.
const UNSEEN: u32 = u32::MAX;

/// The images of one moment, the points in view that each of them sees and the objects that they show.
pub(crate) struct Images<'a> {
    views: &'a [View<'a>],
    pub(crate) sightings: Vec<Sighting>,
    /// Position of each point in view in the sighting of each image.
    slots: Vec<Vec<u32>>,
    /// Label of each instance of each image, at the number of the instance; entry 0 is the background.
    labels: Vec<Vec<u32>>,
    pub(crate) objects: Objects,
}

impl<'a> Images<'a> {
    /// The points of `cloud` in view, less their sightings, and the images that see them. Arguments as in
    /// [`crate::segment()`].
    pub(crate) fn project(
        cloud: Cloud,
        views: &'a [View<'a>],
        same_object: f64,
        keep_origin: bool,
    ) -> Result<(InView, Self)> {
        let size = |view: &View| [view.masks.height(), view.masks.width()];
        let images: Vec<_> = views.iter().map(|view| (view.camera, size(view))).collect();
        let mut in_view = project(cloud, &images, keep_origin)?;
        let sightings = std::mem::take(&mut in_view.sightings);
        let points = in_view.indices.len();
        let slots: Vec<Vec<u32>> = sightings.iter().map(|own| slots(own, points)).collect();
        let shared = |one: usize, other: usize| {
            let slots = slots[one].iter().zip(&slots[other]);
            let both = slots.filter(|(one, other)| **one != UNSEEN && **other != UNSEEN);
            both.map(|(&at, &also_at)| {
                [
                    sightings[one].uv[at as usize],
                    sightings[other].uv[also_at as usize],
                ]
            })
            .collect()
        };
        let objects = same_objects(views, shared, same_object);
        let images = Self {
            views,
            labels: labels_of(views, &objects),
            slots,
            sightings,
            objects,
        };
        Ok((in_view, images))
    }

    /// Number of labels, the background counted.
    pub(crate) fn n_labels(&self) -> usize {
        self.objects.len() + 1
    }

    /// The pixel edges of the points in view, in `order`.
    pub(crate) fn pixel_labels<T: Real>(
        &self,
        order: &[u32],
        params: &Params,
    ) -> Result<PixelLabels<T>> {
        let of_view = |view: &View, uv: &[[f64; 2]]| {
            view.masks
                .pixel_labels(uv, params.window, params.pixel_weight)
        };
        if let [view] = self.views {
            // the image sees every point, and its instances are the labels: nothing to add up
            return of_view(view, &arrange(order, &self.sightings[0].uv));
        }
        let views = self.views.iter().zip(&self.sightings).zip(&self.slots);
        let parts = views.map(|((view, sighting), slots)| {
            let slots = order.iter().map(|&point| slots[point as usize]);
            let seen = slots.filter(|&slot| slot != UNSEEN);
            let uv: Vec<[f64; 2]> = seen.map(|slot| sighting.uv[slot as usize]).collect();
            of_view(view, &uv)
        });
        Ok(self.together(order, &parts.collect::<Result<Vec<_>>>()?))
    }

    /// Rows of all images that see a point added up, their instances named by the objects they show.
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
            for (image, part) in parts.iter().enumerate() {
                if self.slots[image][point as usize] == UNSEEN {
                    continue;
                }
                let at = next[image];
                next[image] += 1;
                mass += part.mass[at];
                for (instance, weight) in part.row(at) {
                    let label = self.labels[image][instance];
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

/// Position of each of `n` points in view in a sighting.
fn slots(sighting: &Sighting, n: usize) -> Vec<u32> {
    let mut slots = vec![UNSEEN; n];
    for (slot, &point) in sighting.seen.iter().enumerate() {
        slots[point as usize] = slot as u32;
    }
    slots
}

/// Label of each instance of each view: the number of its object.
fn labels_of(views: &[View], objects: &Objects) -> Vec<Vec<u32>> {
    let background = |view: &View| vec![0; view.masks.len() + 1];
    let mut labels: Vec<Vec<u32>> = views.iter().map(background).collect();
    for (label, members) in (1..).zip(objects) {
        for &(image, m) in members {
            labels[image][m as usize] = label;
        }
    }
    labels
}
