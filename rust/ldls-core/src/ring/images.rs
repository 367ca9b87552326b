//! The pixel edges of all images, added up by object.

use super::moments::Moments;
use super::same_objects::{Objects, same_objects};
use super::shown::Shown;
use super::slots::Slots;
use super::view::View;
use crate::depth::DepthGroups;
use crate::ground::{ground_heights, is_ground};
use crate::masks::{LabelImage, PixelLabels};
use crate::memory::{collect, filled, push, tabulate, with_room};
use crate::neighbors::arrange;
use crate::projection::{Cloud, InView, Sighting, project};
use crate::{Cancel, Params, Result};
use rayon::prelude::*;

/// Fewest points for a task of the thread pool.
const POINTS_A_TASK: usize = 4096;

/// The images of one moment or of several, the points in view that each of them sees and the objects that they show.
pub(crate) struct Images<'a> {
    views: &'a [View<'a>],
    /// Positions of the points of each image's own moment among those in view: the first, and one after the last.
    own: Vec<[usize; 2]>,
    /// The points that take their pixels from each image.
    sightings: Vec<Sighting>,
    /// Those that it sees of its own moment, where that is not the same.
    seen: Option<Vec<Sighting>>,
    /// Where points stand in the sighting of each image.
    slots: Vec<Slots>,
    /// The masks of each image, painted.
    painted: Vec<LabelImage>,
    /// Label of each instance of each image, at the number of the instance; entry 0 is the background.
    labels: Vec<Vec<u32>>,
    pub(crate) objects: Objects,
    /// Height of each point in view above the ground, in metres; NaN where it is not known.
    pub(crate) heights: Vec<f64>,
    /// What depth says of the points that each image sees; empty where nobody asked.
    depths: Vec<DepthGroups>,
}

impl<'a> Images<'a> {
    /// The points of `cloud` in view, less their sightings, and the images that see them, given their masks `painted`.
    /// Other arguments as in [`crate::segment()`].
    pub(crate) fn project(
        cloud: Cloud,
        views: &'a [View<'a>],
        painted: Vec<LabelImage>,
        keep_origin: bool,
        cancel: &Cancel,
    ) -> Result<(InView, Self)> {
        let size = |view: &View| [view.masks.height(), view.masks.width()];
        let images: Vec<_> = views.iter().map(|view| (view.camera, size(view))).collect();
        let mut in_view = project(cloud, &images, keep_origin, cancel)?;
        let sightings = std::mem::take(&mut in_view.sightings);
        let points = in_view.indices.len();
        let own = views
            .iter()
            .map(|view| view.rows.map(|row| in_view.place(row)));
        let images = Self {
            views,
            own: own.collect(),
            slots: Slots::of_images(&sightings, points, cancel)?,
            painted,
            sightings,
            seen: None,
            labels: Vec::new(),
            objects: Objects::new(),
            heights: filled(f64::NAN, points, cancel)?,
            depths: Vec::new(),
        };
        Ok((in_view, images))
    }

    /// Finds out which instances of the images show one object, and where there are several moments, which image each of
    /// `points` in view takes its pixels from.
    ///
    /// A mask also shows what lies before and behind its object. At another moment that is elsewhere, so that there only
    /// the points as far away as the object are on the mask, where the parameters ask for depth.
    pub(crate) fn find_objects(
        &mut self,
        points: &[[f64; 3]],
        same_object: f64,
        params: &Params,
        cancel: &Cancel,
    ) -> Result<()> {
        let views = self.views;
        let of_moments = views.iter().any(|view| view.rows != View::ALL_ROWS);
        let mut seen = None;
        let mut depths = Vec::new();
        if of_moments {
            let own = self.sightings.iter().zip(&self.own);
            let own = own.map(|(all, &[start, end])| all.within(start..end, cancel));
            let own: Vec<Sighting> = own.collect::<Result<_>>()?;
            if params.need_depth() {
                depths = self.depth_groups(&own, points, params, cancel)?;
                for ((depths, view), all) in depths.iter_mut().zip(views).zip(&self.sightings) {
                    *depths = depths.at_other_moments(distances(view, all, points, cancel)?);
                }
            }
            seen = Some(own);
        }
        // what a single image of the whole cloud shows, nobody asks
        let asked = if views.len() > 1 || of_moments {
            &self.sightings[..]
        } else {
            &[]
        };
        let show = |(image, sighting)| {
            let (slots, painted) = (&self.slots[image], &self.painted[image]);
            Shown::new(sighting, slots, painted, depths.get(image), cancel)
        };
        let shown = asked.par_iter().enumerate().map(show);
        let shown: Vec<Shown> = shown.collect::<Result<_>>()?;
        self.objects = same_objects(views, &shown, same_object, cancel)?;
        self.labels = labels_of(views, &self.objects);
        if of_moments {
            let moments = Moments {
                views,
                shown: &shown,
                labels: &self.labels,
                objects: &self.objects,
            };
            self.sightings = moments.sightings(&self.own)?;
            self.slots = Slots::of_images(&self.sightings, points.len(), cancel)?;
            self.seen = seen;
        }
        Ok(())
    }

    /// The points that each image sees of its own moment, and the objects.
    pub(crate) fn into_parts(self) -> (Vec<Sighting>, Objects) {
        (self.seen.unwrap_or(self.sightings), self.objects)
    }

    /// Finds the ground below `points` in view, by the first camera, where the parameters ask for it.
    pub(crate) fn see_ground(
        &mut self,
        points: &[[f64; 3]],
        params: &Params,
        cancel: &Cancel,
    ) -> Result<()> {
        if let Some(first) = self.views.first().filter(|_| params.need_ground()) {
            self.heights = ground_heights(points, first.camera, params.local_ground, cancel)?;
        }
        Ok(())
    }

    /// Finds the object of each mask among `points` in view by depth, where the parameters ask for it.
    pub(crate) fn see_depth(
        &mut self,
        points: &[[f64; 3]],
        params: &Params,
        cancel: &Cancel,
    ) -> Result<()> {
        if !params.need_depth() {
            return Ok(());
        }
        self.depths = self.depth_groups(&self.sightings, points, params, cancel)?;
        Ok(())
    }

    /// What depth says of the points that each image sees, given their `sightings`.
    fn depth_groups(
        &self,
        sightings: &[Sighting],
        points: &[[f64; 3]],
        params: &Params,
        cancel: &Cancel,
    ) -> Result<Vec<DepthGroups>> {
        let standing = collect(
            self.heights.iter().map(|&height| !is_ground(height)),
            cancel,
        )?;
        let of_view = |(view, sighting): (&View, &Sighting)| {
            let distances = distances(view, sighting, points, cancel)?;
            let standing = arrange(&sighting.seen, &standing, cancel)?;
            view.masks
                .depth_groups(&sighting.uv, distances, &standing, params, cancel)
        };
        let views = self.views.par_iter().zip(sightings);
        views.map(of_view).collect()
    }

    /// Number of labels, the background counted.
    pub(crate) fn n_labels(&self) -> usize {
        self.objects.len() + 1
    }

    /// Score of each object, the highest of its masks.
    pub(crate) fn scores(&self) -> Vec<f32> {
        let score = |&(image, m): &(usize, u32)| self.views[image].scores[m as usize - 1];
        let objects = self.objects.iter();
        objects
            .map(|masks| masks.iter().map(score).fold(0.0, f32::max))
            .collect()
    }

    /// The pixel edges of the points in view, in `order`.
    pub(crate) fn pixel_labels(
        &self,
        order: &[u32],
        params: &Params,
        cancel: &Cancel,
    ) -> Result<PixelLabels> {
        let parts = self.painted.iter().enumerate().map(|(image, painted)| {
            cancel.check()?;
            let mut seen = with_room(self.sightings[image].seen.len())?;
            for points in order.chunks(POINTS_A_TASK) {
                cancel.check()?;
                let slots = &self.slots[image];
                seen.extend(points.iter().filter_map(|&point| slots.of(point)));
            }
            let uv = arrange(&seen, &self.sightings[image].uv, cancel)?;
            let depths = self.depths.get(image);
            let depths = depths.map(|depths| depths.of_points(&seen, cancel));
            let depths = depths.transpose()?;
            let admitted = |at: usize, label| depths.iter().all(|depths| depths.admits(at, label));
            let (window, weight) = (params.window, params.pixel_weight);
            painted.pixel_labels(&uv, window, weight, admitted, cancel)
        });
        let mut parts = parts.collect::<Result<Vec<_>>>()?;
        if parts.len() == 1 && parts[0].rows() == order.len() {
            // the image sees every point, and its instances are the labels: nothing to add up
            return Ok(parts.remove(0));
        }
        self.together(order, &parts, cancel)
    }

    /// Rows of all images that see a point added up, their instances named by the objects they show.
    fn together(
        &self,
        order: &[u32],
        parts: &[PixelLabels],
        cancel: &Cancel,
    ) -> Result<PixelLabels> {
        let mut next = vec![0; parts.len()];
        let mut all = PixelLabels::with_room(order.len())?;
        let mut row: Vec<(u32, f32)> = Vec::new();
        for (at, &point) in order.iter().enumerate() {
            if at % POINTS_A_TASK == 0 {
                cancel.check()?;
            }
            row.clear();
            let mut mass = 0.0;
            for (image, part) in parts.iter().enumerate() {
                if self.slots[image].of(point).is_none() {
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
            for &(label, weight) in &row {
                push(&mut all.labels, label)?;
                push(&mut all.weights, weight)?;
            }
            all.mass.push(mass);
            all.offsets.push(all.labels.len());
        }
        Ok(all)
    }
}

/// Distance of the points of a sighting to the camera, in metres.
fn distances(
    view: &View,
    sighting: &Sighting,
    points: &[[f64; 3]],
    cancel: &Cancel,
) -> Result<Vec<f64>> {
    let distance = |at: usize| view.camera.distance(&points[sighting.seen[at] as usize]);
    tabulate(sighting.seen.len(), distance, cancel)
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
