//! The masks of one image and the camera that took it.

use crate::masks::InstanceMasks;
use crate::projection::Camera;
use crate::{Error, Result};

/// Masks of one image and the camera that took it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Instance masks of the image.
    pub masks: &'a InstanceMasks,
    /// Category of each of them: of the instances of one moment, only those of one category become one object.
    pub categories: &'a [i32],
    /// Score of each of them, 0 to 1.
    pub scores: &'a [f32],
    /// The camera.
    pub camera: &'a Camera,
    /// First of the rows of the cloud that were swept when the image was taken, and the one after the last: its pixels
    /// label these alone.
    pub rows: [usize; 2],
}

impl View<'_> {
    /// Rows of a cloud that is swept all at one moment.
    pub const ALL_ROWS: [usize; 2] = [0, usize::MAX];

    /// Refuses a view that has not one category and one score a mask.
    pub(crate) fn check(&self) -> Result<()> {
        let (categories, scores) = (self.categories.len(), self.scores.len());
        for (name, found) in [("categories", categories), ("scores", scores)] {
            if self.masks.len() != found {
                let problem = format!("{found} for {} masks", self.masks.len());
                return Err(Error::Mismatch { name, problem });
            }
        }
        Ok(())
    }
}
