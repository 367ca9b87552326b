//! The instances that an image shows at the points that it sees.

use super::slots::Slots;
use crate::depth::DepthGroups;
use crate::masks::LabelImage;
use crate::memory::{push, tabulate};
use crate::projection::{Sighting, nearest_pixel};
use crate::{Cancel, Result};

/// The points that an image sees, and on which instances each of them falls.
pub(super) struct Shown<'a> {
    pub(super) sighting: &'a Sighting,
    slots: &'a Slots,
    image: &'a LabelImage,
    /// Set of labels of `image` at each point of the sighting; 0 is on no mask.
    sets: Vec<u32>,
    /// How far away the objects of the masks are, and the points, where that is asked for.
    depths: Option<&'a DepthGroups>,
    /// Each point on the mask of an instance that is as far away, and the instance, in the order of the points.
    pub(super) marks: Vec<(u32, u32)>,
}

impl<'a> Shown<'a> {
    pub(super) fn new(
        sighting: &'a Sighting,
        slots: &'a Slots,
        image: &'a LabelImage,
        depths: Option<&'a DepthGroups>,
        cancel: &Cancel,
    ) -> Result<Self> {
        let set = |slot: usize| {
            let pixel = nearest_pixel(sighting.uv[slot], image.height, image.width);
            pixel.map_or(0, |pixel| image.set_at(pixel))
        };
        let sets = tabulate(sighting.uv.len(), set, cancel)?;
        let mut shown = Self {
            sighting,
            slots,
            image,
            sets,
            depths,
            marks: Vec::new(),
        };
        let mut marks = Vec::new();
        for (slot, &point) in (0..).zip(&sighting.seen) {
            for m in shown.instances(slot) {
                push(&mut marks, (point, m))?;
            }
        }
        shown.marks = marks;
        Ok(shown)
    }

    /// Position of a point in the sighting, if the image sees it.
    pub(super) fn slot(&self, point: u32) -> Option<u32> {
        self.slots.of(point)
    }

    /// The instances, from 1, on whose masks the point of a slot falls, as far away as their objects.
    pub(super) fn instances(&self, slot: u32) -> impl Iterator<Item = u32> {
        let labels = self.image.labels_of(self.sets[slot as usize]);
        let depths = self.depths;
        labels.filter(move |&m| depths.is_none_or(|depths| depths.admits(slot as usize, m)))
    }

    /// True if the point of a slot falls on no mask.
    pub(super) fn is_background(&self, slot: u32) -> bool {
        self.sets[slot as usize] == 0
    }
}
