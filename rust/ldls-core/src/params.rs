//! The parameters of the method, checked once.

use crate::{Error, Result};

/// Parameters of [`segment`](crate::segment()): the best known by [`Params::default`], the paper's by [`Params::paper`].
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
    /// Set if only the largest connected component of an instance keeps its label, and the parts near it.
    pub remove_outliers: bool,
    /// Factor on the weight of an edge between a point of the ground and one that is not; 1 for the paper's graph.
    pub ground_edges: f64,
    /// Points nearer to the ground than this, in metres, are background and have no part in the graph; 0 for none.
    pub ground_clearance: f64,
    /// Set if the ground follows kerbs and lawns, and not a smooth surface only.
    pub local_ground: bool,
    /// Gap in distance, in metres, between the object of a mask and what is before and behind it; 0 for no depth groups.
    pub depth_gap: f64,
    /// Gap, in metres, within an object whose parts do not go on beside its mask; 0 for none.
    pub bridged_gap: f64,
    /// Share of the shorter side of a mask by which its edge may be off; 0 to trust it.
    pub edge_margin: f64,
    /// Gap, in metres, between the largest component of an object and others of it that stay too; 0 for that one alone.
    pub part_gap: f64,
    /// Set if confidence is the probability that a label is right, not the winner's share of the likelihoods.
    pub calibrated: bool,
    /// Labels of less confidence become background; 0 for none.
    pub abstain: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            sigma: 0.1,
            iterations: Some(10),
            ground_edges: 0.02,
            ground_clearance: 0.02,
            local_ground: true,
            depth_gap: 0.6,
            bridged_gap: 1.5,
            edge_margin: 0.15,
            part_gap: 1.5,
            calibrated: true,
            ..Self::paper()
        }
    }
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
            ground_edges: 1.0,
            ground_clearance: 0.0,
            local_ground: false,
            depth_gap: 0.0,
            bridged_gap: 0.0,
            edge_margin: 0.0,
            part_gap: 0.0,
            calibrated: false,
            abstain: 0.0,
        }
    }

    /// True if any step needs to know where the ground is.
    pub(crate) fn need_ground(&self) -> bool {
        self.ground_edges < 1.0 || self.ground_clearance > 0.0 || self.need_depth()
    }

    /// True if depth decides which points a mask labels.
    pub(crate) fn need_depth(&self) -> bool {
        self.depth_gap > 0.0
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
            // of less, single precision loses what is left some edges away
            (1e-20..=1e6).contains(&self.pixel_weight),
            format!("{:e}", self.pixel_weight),
            "a number from 1e-20 to 1e6",
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
        )?;
        for (name, value) in [
            ("ground_edges", self.ground_edges),
            ("edge_margin", self.edge_margin),
            ("abstain", self.abstain),
        ] {
            let share = (0.0..=1.0).contains(&value);
            check(name, share, value.to_string(), "a share from 0 to 1")?;
        }
        for (name, value, most, expected) in [
            ("ground_clearance", self.ground_clearance, 1.0, "0 to 1 m"),
            ("depth_gap", self.depth_gap, 1e3, "0 to 1000 m"),
            ("bridged_gap", self.bridged_gap, 1e3, "0 to 1000 m"),
            ("part_gap", self.part_gap, 1e3, "0 to 1000 m"),
        ] {
            check(
                name,
                (0.0..=most).contains(&value),
                value.to_string(),
                expected,
            )?;
        }
        Ok(())
    }
}
