//! How far off the values of a series may be at a point.
//!
//! What a series leaves out is about as large as the mean of its last two terms, which the probe has gone through as: little, too,
//! where terms grow and alternate in sign. That differs by orders of magnitude from one part of a cloud to another, and where it
//! passes zero at a point it does not around it. So does what rounding leaves of a sum of all labels.

use crate::Real;
use crate::graph::PointGraph;

/// Edges of which estimates are asked for around a point.
pub(super) const AROUND: usize = 2;
/// By how many times what is left out may be more than the most that is estimated around a point. Of a million points of three lidars
/// there is none at which it counts beside rounding and that of the two best labels differs by more than 1.9 times as much.
const SAFETY: f64 = 2.5;

/// By how much the values at each point may be off, going by the probe and the sum of all labels there.
#[derive(Debug)]
pub(super) struct Errors<'a, T = f32> {
    pub(super) a: &'a PointGraph<T>,
    /// Nothing where no series was used.
    pub(super) estimates: Vec<f32>,
}

impl<T: Real> Errors<'_, T> {
    /// By how much values at a point may be off, going by the estimates at all points within [`AROUND`] edges.
    pub(super) fn at(&self, point: usize) -> f64 {
        if self.estimates.is_empty() {
            return 0.0;
        }
        let next = |from| self.a.row(from).map(|(to, _)| to);
        let around = next(point).flat_map(next).chain([point]);
        SAFETY * f64::from(around.map(|at| self.estimates[at]).fold(0.0, f32::max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_within_two_edges() {
        let rows = [vec![0, 1], vec![1, 2], vec![2, 3], vec![3]];
        let offsets = vec![0, 2, 4, 6, 7];
        let a = PointGraph::from_csr(offsets, rows.concat(), vec![0.25; 7]).unwrap();
        let errors = |estimates| Errors { a: &a, estimates };
        let estimated = errors(vec![0.25, 0.0, 0.5, 1.0]);
        assert_eq!([0, 1, 3].map(|point| estimated.at(point)), [1.25, 2.5, 2.5]);
        assert_eq!(errors(Vec::new()).at(0), 0.0);
    }
}
