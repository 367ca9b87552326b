//! The point graph, and the connected components of its labels (method, steps 3, 4 and 7).

mod box_tree;
mod components;
mod disjoint_sets;
mod point_graph;

pub use components::remove_outliers;
pub(crate) use components::remove_outliers_by_index;
pub use point_graph::PointGraph;
