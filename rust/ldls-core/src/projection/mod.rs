//! From points to pixels (method, step 1).

mod camera;
mod cloud;
mod distortion;
mod in_view;

pub use camera::Camera;
pub(crate) use camera::{Sight, nearest_pixel};
pub use cloud::Cloud;
pub use distortion::Distortion;
pub(crate) use in_view::check_points;
pub use in_view::{View, ViewCounts};
