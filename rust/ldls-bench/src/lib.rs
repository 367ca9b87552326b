//! A made-up street, and the stages of the method on it: what `cargo bench` times and `make instructions` counts.

mod stages;
mod street;

pub use stages::{Prepared, STAGES, Stage};
pub use street::Street;
