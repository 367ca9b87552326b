//! The instance masks of an image.

use super::rle::{Rle, check_size};
use crate::{Error, Result};
use rayon::prelude::*;

/// Most instances: SemanticKITTI's labels and the panoptic formats hold 16 bits.
const MAX_INSTANCES: usize = 65_535;

/// Instance masks of one image. Instance m = 1, 2, ... is the mask at position m - 1; 0 is the background.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InstanceMasks {
    height: usize,
    width: usize,
    masks: Vec<Rle>,
}

impl InstanceMasks {
    /// Masks of an image of `height` x `width` pixels.
    ///
    /// # Errors
    /// [`Error::MaskSize`] for a mask of another size, [`Error::TooManyInstances`], [`Error::ImageSize`].
    pub fn new(height: usize, width: usize, masks: Vec<Rle>) -> Result<Self> {
        check_size(height, width)?;
        if masks.len() > MAX_INSTANCES {
            return Err(Error::TooManyInstances {
                found: masks.len(),
                limit: MAX_INSTANCES,
            });
        }
        for (index, mask) in masks.iter().enumerate() {
            let found = (mask.height(), mask.width());
            if found != (height, width) {
                let hint = if found == (width, height) {
                    "; swapped?"
                } else {
                    ""
                };
                let (found_height, found_width) = found;
                return Err(Error::MaskSize {
                    index,
                    found_height,
                    found_width,
                    height,
                    width,
                    hint,
                });
            }
        }
        Ok(Self {
            height,
            width,
            masks,
        })
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of instances, the background not counted.
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// True if there is no instance.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// The masks in their order.
    pub fn masks(&self) -> &[Rle] {
        &self.masks
    }

    /// Sets the pixels of mask m in image m of `pixels`, row by row, all `false` before.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `pixels` does not hold one image a mask.
    pub fn paint(&self, pixels: &mut [bool]) -> Result<()> {
        let image = self.height * self.width;
        if self.masks.len().checked_mul(image) != Some(pixels.len()) {
            let problem = format!("{} values for {} masks", pixels.len(), self.masks.len());
            return Err(Error::Mismatch {
                name: "pixels",
                problem,
            });
        }
        let images = pixels.par_chunks_mut(image);
        images
            .zip(&self.masks)
            .for_each(|(pixels, mask)| mask.paint(pixels));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_of_another_size_is_named() {
        let rle = Rle::from_pixels(4, 3, &[false; 12]).unwrap();
        let error = InstanceMasks::new(3, 4, vec![rle]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "mask 0: 4 x 3 pixels, the image is 3 x 4; swapped?"
        );
    }
}
