//! Label diffusion lidar segmentation (LDLS): instance masks of a camera image become labels of lidar points.
//!
//! The method is that of Wang et al., "LDLS: 3-D Object Segmentation Through Label Diffusion From 2-D Images",
//! RA-L 2019. [`segment()`] runs all of it; every step is also a function of its own. Nothing here knows of Python,
//! of files or of the 2D segmenter that made the masks.
//!
//! Results do not depend on the number of threads, bit for bit: threads share out rows, and every sum within a row is
//! taken by one thread in one order.

mod activity;
mod adjacency;
mod blocks;
mod camera;
mod candidates;
mod chebyshev;
mod cloud;
mod components;
mod diffusion;
mod distortion;
mod error;
mod graph;
mod images;
mod kdtree;
mod keys;
mod label_image;
mod lanes;
mod leaf_search;
mod lone_search;
mod masks;
mod memory;
mod morphology;
mod neighbors;
mod params;
mod pass;
mod pixel_labels;
mod polygon;
mod products;
mod real;
mod ring;
mod rle;
mod same_objects;
mod segment;
mod sightings;
mod state;
mod sweeps;
#[cfg(test)]
mod test_wall;
mod tiles;
mod values;
mod view;
mod winners;

pub use camera::Camera;
pub use cloud::Cloud;
pub use components::keep_largest_components;
pub use diffusion::{Convergence, Diffused, diffuse, likelihoods};
pub use distortion::Distortion;
pub use error::Error;
pub use graph::PointGraph;
pub use masks::InstanceMasks;
pub use memory::Memory;
pub use neighbors::Neighbors;
pub use params::Params;
pub use pixel_labels::PixelLabels;
pub use products::Products;
pub use real::Real;
pub use ring::{RingSegmentation, RingView, segment_ring};
pub use rle::Rle;
pub use segment::{Report, Segmentation, Timings, segment};
pub use sightings::Sighting;
pub use view::{View, ViewCounts};

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;
