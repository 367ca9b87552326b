//! The report of a run: what a caller should know of the input, and the time of each step.

use crate::diffusion::Convergence;
use crate::neighbors::Adjacency;
use crate::projection::Counts;
use std::time::{Duration, Instant};

/// Findings about the input and the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Points left out, by reason.
    pub counts: Counts,
    /// Points of the graph that share their place with another one of it.
    pub duplicates: usize,
    /// Set if every point has more than K copies, so that the graph falls into islands.
    pub only_islands: bool,
    /// Neighbours that a point really has.
    pub k_effective: usize,
    /// Convergence of the diffusion.
    pub convergence: Convergence,
}

impl Report {
    pub(crate) fn new(counts: Counts, nearest: &Adjacency, convergence: Convergence) -> Self {
        Self {
            counts,
            duplicates: nearest.duplicates(),
            only_islands: nearest.only_islands(),
            k_effective: nearest.degree - 1,
            convergence,
        }
    }
}

/// Time of each step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Timings {
    /// Projection to pixels.
    pub project: Duration,
    /// K nearest neighbours, and the order of their tree: what they take longer than depth, which is seen meanwhile.
    pub neighbors: Duration,
    /// Heights above the ground, and depth groups of the masks.
    pub depth: Duration,
    /// Labels of the pixels around each point.
    pub pixel_labels: Duration,
    /// Point graph and row sums.
    pub graph: Duration,
    /// Diffusion and argmax.
    pub diffusion: Duration,
    /// Outlier removal.
    pub components: Duration,
}

/// Runs `step` and adds its time to `time`.
pub(crate) fn timed<T>(time: &mut Duration, step: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let outcome = step();
    *time += start.elapsed();
    outcome
}
