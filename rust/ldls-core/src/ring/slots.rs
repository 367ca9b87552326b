//! Where points in view stand in the sighting of an image.

use crate::memory::filled;
use crate::projection::Sighting;
use crate::{Cancel, Result};
use rayon::prelude::*;

/// Slot of points that the image does not see.
const UNSEEN: u32 = u32::MAX;

/// Position of each point in view in the sighting of an image.
pub(super) struct Slots(Vec<u32>);

impl Slots {
    /// Those of so many points in view in each of `sightings`.
    pub(super) fn of_images(
        sightings: &[Sighting],
        points: usize,
        cancel: &Cancel,
    ) -> Result<Vec<Self>> {
        let of_image = |sighting: &Sighting| {
            let mut slots = filled(UNSEEN, points, cancel)?;
            for (slot, &point) in (0..).zip(&sighting.seen) {
                slots[point as usize] = slot;
            }
            Ok(Self(slots))
        };
        sightings.par_iter().map(of_image).collect()
    }

    /// Position of a point in the sighting, if the image sees it.
    #[inline]
    pub(super) fn of(&self, point: u32) -> Option<u32> {
        Some(self.0[point as usize]).filter(|&slot| slot != UNSEEN)
    }
}
