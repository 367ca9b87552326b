//! Instance masks of an image, and the labels that its pixels give to points (method, step 2).

mod compressed;
mod instance_masks;
mod label_image;
mod morphology;
mod pixel_labels;
mod polygon;
mod rle;

pub use instance_masks::InstanceMasks;
pub use label_image::LabelImage;
pub(crate) use pixel_labels::Most;
pub use pixel_labels::PixelLabels;
pub use rle::Rle;
