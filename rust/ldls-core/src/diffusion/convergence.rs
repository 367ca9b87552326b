//! How far a diffusion came, and when it has come far enough.

/// Where one more product changes no likelihood by more, the solution counts as converged.
pub(super) const CONVERGED: f64 = 1e-5;
/// Sweeps after which a run without a bound gives up.
pub(super) const MOST_SWEEPS: usize = 20_000;

/// How far a diffusion came.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Sweeps over the graph that were computed for a label.
    pub sweeps: usize,
    /// Largest change of any likelihood that one more product would make, where that bounded the run.
    pub residual: Option<f64>,
    /// Estimate of the largest error of a likelihood from the terms that the series leaves out, and from rounding where that may grow.
    pub error: f64,
    /// Points at which labels were too near to one another for single precision.
    pub refined: usize,
}

impl Convergence {
    /// True if the run went on until one more product would change next to nothing.
    pub fn converged(&self) -> bool {
        self.residual.is_some_and(|residual| residual <= CONVERGED)
    }

    pub(super) fn merge(&mut self, other: Self) {
        let residuals = self.residual.into_iter().chain(other.residual);
        self.sweeps = self.sweeps.max(other.sweeps);
        self.residual = residuals.reduce(f64::max);
        self.error = self.error.max(other.error);
    }
}
