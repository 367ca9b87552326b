//! Label diffusion lidar segmentation (LDLS): instance masks of a camera image become labels of lidar points.
//!
//! The method is that of Wang et al., "LDLS: 3-D Object Segmentation Through Label Diffusion From 2-D Images",
//! RA-L 2019. [`segment()`] runs all of it; every step is also a function of its own. Nothing here knows of Python,
//! of files or of the 2D segmenter that made the masks.
//!
//! Results do not depend on the number of threads, bit for bit: threads share out rows, and every sum within a row is
//! taken by one thread in one order.

mod bits;
mod cancel;
mod confidence;
mod depth;
mod diffusion;
mod error;
mod graph;
mod ground;
mod masks;
pub mod memory;
mod neighbors;
mod params;
mod projection;
mod real;
mod report;
mod ring;
mod segment;
#[cfg(test)]
mod test_support;
mod upright_box;

pub use cancel::Cancel;
pub use confidence::calibrated_confidence;
pub use depth::DepthGroups;
pub use diffusion::{Convergence, Diffused, Products, diffuse, likelihoods};
pub use error::Error;
pub use graph::{PointGraph, remove_outliers};
pub use ground::{GROUND_M, ground_heights, is_cleared, is_ground};
pub use masks::{InstanceMasks, LabelImage, PixelLabels, Rle};
pub use neighbors::Neighbors;
pub use params::Params;
pub use projection::{
    Camera, Cloud, Counts, Distortion, InView, Sighting, brought_together, project,
};
pub use real::Real;
pub use report::{Report, Timings};
pub use ring::{Objects, View};
pub use segment::{Segmentation, segment};
pub use upright_box::UprightBox;

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
