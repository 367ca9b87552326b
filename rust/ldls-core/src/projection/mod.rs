//! From points to pixels (method, step 1).

mod block;
mod camera;
mod cloud;
mod distortion;
mod in_view;
mod lanes;

pub use camera::Camera;
pub(crate) use camera::nearest_pixel;
pub use cloud::{Cloud, brought_together};
pub use distortion::Distortion;
pub use in_view::{Counts, InView, Sighting, project};
