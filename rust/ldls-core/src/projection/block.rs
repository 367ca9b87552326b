//! Sixteen points of a cloud at a time.

use super::cloud::Cloud;
use super::lanes::{LANES, Lanes, Mask};
use std::ops::Range;

/// Some rows of a cloud, sixteen at most.
pub(super) struct Block {
    pub(super) rows: Range<usize>,
    /// x, y and z, in metres; where there are fewer rows, those of the last one again.
    axes: [[f64; LANES]; 3],
    /// The same, as instructions take them.
    pub(super) xyz: [Lanes; 3],
}

impl Block {
    #[inline(always)]
    pub(super) fn new(cloud: Cloud, rows: Range<usize>) -> Self {
        let axes = cloud.axes(rows.clone());
        Self {
            rows,
            axes,
            xyz: [0, 1, 2].map(|axis| Lanes::from_array(&axes[axis])),
        }
    }

    /// x, y and z of one of the points, in metres.
    #[inline(always)]
    pub(super) fn point(&self, lane: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.axes[axis][lane])
    }

    /// Bits of the points of which each coordinate has a property.
    #[inline(always)]
    pub(super) fn bits(&self, of_axis: impl Fn(Lanes) -> Mask) -> u32 {
        let [x, y, z] = self.xyz.map(of_axis);
        (x & y & z).bits() & ((1 << self.rows.len()) - 1)
    }
}
