//! The point graph, and the connected components of its labels (method, steps 3, 4 and 7).

mod components;
mod point_graph;

pub(crate) use components::keep_largest_by_index;
pub use components::keep_largest_components;
pub use point_graph::PointGraph;
