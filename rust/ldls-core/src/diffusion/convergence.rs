//! How far a diffusion came, and when it has come far enough.

/// Where one more product changes no likelihood by more, nor by more than a share of the largest seed, the solution counts
/// as converged: where seeds are small, products change little from the beginning on.
const CONVERGED: f64 = 1e-5;
const CONVERGED_OF_SEED: f64 = 1e-2;
/// Sweeps after which a run without a bound gives up.
pub(super) const MOST_SWEEPS: usize = 20_000;

/// How far a diffusion came.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Sweeps over the graph that were computed for a label.
    pub sweeps: usize,
    /// Largest change of any likelihood that one more product would make, where that bounded the run.
    pub residual: Option<f64>,
    /// Largest such change of a solution that counts as converged, where that bounded the run.
    pub enough: Option<f64>,
    /// Estimate of the largest error of a likelihood from the terms that the series leaves out, and from rounding where that may grow.
    pub error: f64,
    /// Points at which labels were too near to one another for single precision.
    pub refined: usize,
}

/// Largest change of a solution that counts as converged, with seeds of which this is the largest.
pub(super) fn enough(largest_seed: f64) -> f64 {
    CONVERGED.min(CONVERGED_OF_SEED * largest_seed)
}

impl Convergence {
    /// True if the run went on until one more product would change next to nothing.
    pub fn converged(&self) -> bool {
        let residual = self.residual.zip(self.enough);
        residual.is_some_and(|(residual, enough)| residual <= enough)
    }

    pub(super) fn merge(&mut self, other: Self) {
        let residuals = self.residual.into_iter().chain(other.residual);
        let enough = self.enough.into_iter().chain(other.enough);
        self.sweeps = self.sweeps.max(other.sweeps);
        self.residual = residuals.reduce(f64::max);
        self.enough = enough.reduce(f64::min);
        self.error = self.error.max(other.error);
    }
}
