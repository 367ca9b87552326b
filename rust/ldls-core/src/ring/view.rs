//! The masks of one image and the camera that took it.

use crate::masks::InstanceMasks;
use crate::projection::Camera;
use crate::{Error, Result};

/// Masks of one image and the camera that took it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Instance masks of the image.
    pub masks: &'a InstanceMasks,
    /// Category of each of them: only instances of one category become one object.
    pub categories: &'a [i32],
    /// The camera.
    pub camera: &'a Camera,
}

impl View<'_> {
    /// Refuses a view that has not one category a mask.
    pub(crate) fn check(&self) -> Result<()> {
        if self.masks.len() == self.categories.len() {
            return Ok(());
        }
        Err(Error::Mismatch {
            name: "categories",
            problem: format!("{} for {} masks", self.categories.len(), self.masks.len()),
        })
    }
}
