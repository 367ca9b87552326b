//! The parameters of the method, checked once.

use crate::{Error, Result};

/// Parameters of [`segment`](crate::segment()); [`Params::paper`] has the values of the paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// K: neighbours that every point is joined to.
    pub neighbors: usize,
    /// sigma of the point edge weight exp(-d^2 / sigma), in square metres.
    pub sigma: f64,
    /// lambda: weight of an edge from a pixel to a point.
    pub pixel_weight: f64,
    /// Side of the square window of pixels that a point is joined to; odd.
    pub window: usize,
    /// Number of products z <- A z + b; `None` runs them until nothing changes.
    pub iterations: Option<usize>,
    /// Set if only the largest connected component of an instance keeps its label.
    pub remove_outliers: bool,
}

impl Params {
    /// The values of the paper: K = 10, sigma = 1 m^2, lambda = 0.001, 5 x 5 pixels, 200 iterations.
    pub const fn paper() -> Self {
        Self {
            neighbors: 10,
            sigma: 1.0,
            pixel_weight: 0.001,
            window: 5,
            iterations: Some(200),
            remove_outliers: true,
        }
    }

    /// Refuses values outside their range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the first parameter that is out of range.
    pub fn check(&self) -> Result<()> {
        let check = |name, ok: bool, found: String, expected| {
            if ok {
                Ok(())
            } else {
                Err(Error::Parameter {
                    name,
                    found,
                    expected,
                })
            }
        };
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let iterations = self.iterations.unwrap_or(1);
        check(
            "neighbors",
            (1..=255).contains(&self.neighbors),
            self.neighbors.to_string(),
            "1 to 255",
        )?;
        check(
            "sigma",
            positive(self.sigma),
            self.sigma.to_string(),
            "a positive number of square metres",
        )?;
        check(
            "pixel_weight",
            positive(self.pixel_weight) && self.pixel_weight <= 1e6,
            self.pixel_weight.to_string(),
            "a positive number up to 1e6",
        )?;
        check(
            "window",
            self.window % 2 == 1 && self.window <= 101,
            self.window.to_string(),
            "an odd number of pixels from 1 to 101",
        )?;
        check(
            "iterations",
            (1..=100_000).contains(&iterations),
            iterations.to_string(),
            "1 to 100000, or None for the converged solution",
        )
    }
}
