//! The part of a cloud that the image of a camera sees, and what became of the rest.

use super::camera::{Camera, Sight};
use super::cloud::Cloud;
use crate::{Error, Result};
use rayon::prelude::*;

/// Largest magnitude of a coordinate, in metres: beyond it squared distances lose their meaning.
const COORDINATE_LIMIT_M: f64 = 1e7;
/// Points handled by one task of the thread pool.
const BLOCK: usize = 8192;

/// The points that the image sees, in the order of the cloud.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct View {
    /// Rows of the cloud, ascending.
    pub indices: Vec<u32>,
    /// Their coordinates in the lidar frame, in metres.
    pub points: Vec<[f64; 3]>,
    /// Where they fall: u (right), v (down), in pixels.
    pub uv: Vec<[f64; 2]>,
    /// What became of the other points.
    pub counts: ViewCounts,
}

/// Why points are not in view, and how far the usable ones reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewCounts {
    /// Points with a coordinate that is not finite.
    pub nonfinite: usize,
    /// Points at exactly (0, 0, 0), which sensors write where there was no return.
    pub origin: usize,
    /// Points at or behind the smallest depth.
    pub behind: usize,
    /// Points in front of the camera, beside the image.
    pub outside: usize,
    /// Smallest finite x, y, z, in metres; infinite where there is none.
    pub min: [f64; 3],
    /// Largest finite x, y, z, in metres; minus infinite where there is none.
    pub max: [f64; 3],
}

impl Default for ViewCounts {
    fn default() -> Self {
        Self {
            nonfinite: 0,
            origin: 0,
            behind: 0,
            outside: 0,
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
        }
    }
}

impl Camera {
    /// The points of `cloud` whose nearest pixel lies in an image of `height` x `width` pixels.
    ///
    /// A point at exactly (0, 0, 0) counts as no return unless `keep_origin` is set.
    ///
    /// # Errors
    /// [`Error::CoordinateOutOfRange`] and [`Error::TooManyPoints`].
    pub fn view(
        &self,
        cloud: Cloud,
        height: usize,
        width: usize,
        keep_origin: bool,
    ) -> Result<View> {
        let n = cloud.len();
        check_points(n)?;
        let count = n.div_ceil(BLOCK);
        let rows = |block: usize| block * BLOCK..n.min((block + 1) * BLOCK);
        let blocks: Vec<Result<View>> = (0..count)
            .into_par_iter()
            .map(|block| self.view_rows(cloud, rows(block), [height, width], keep_origin))
            .collect();
        // taken in order, so that the first bad row is the one reported
        let blocks = blocks.into_iter().collect::<Result<Vec<View>>>()?;
        Ok(concatenate(&blocks))
    }

    /// The view of some rows.
    fn view_rows(
        &self,
        cloud: Cloud,
        rows: std::ops::Range<usize>,
        [height, width]: [usize; 2],
        keep_origin: bool,
    ) -> Result<View> {
        let mut view = View::default();
        for row in rows {
            let Some(xyz) = view.counts.usable(cloud, row, keep_origin)? else {
                continue;
            };
            match self.sight(&xyz, height, width) {
                Sight::Behind => view.counts.behind += 1,
                Sight::Outside => view.counts.outside += 1,
                Sight::Seen(uv) => {
                    view.indices.push(row as u32);
                    view.points.push(xyz);
                    view.uv.push(uv);
                }
            }
        }
        Ok(view)
    }
}

/// Refuses clouds with more points than labels have rows for.
pub(crate) fn check_points(points: usize) -> Result<()> {
    if i32::try_from(points).is_ok() {
        return Ok(());
    }
    Err(Error::TooManyPoints {
        points,
        neighbors: 0,
        limit: i32::MAX as u64,
        of: "points",
    })
}

impl ViewCounts {
    /// The point of a row, if it has one; counts it otherwise.
    pub(crate) fn usable(
        &mut self,
        cloud: Cloud,
        row: usize,
        keep_origin: bool,
    ) -> Result<Option<[f64; 3]>> {
        let xyz = cloud.xyz(row);
        if !xyz.iter().all(|c| c.is_finite()) {
            self.nonfinite += 1;
            return Ok(None);
        }
        if let Some(&value) = xyz.iter().find(|c| c.abs() > COORDINATE_LIMIT_M) {
            return Err(Error::CoordinateOutOfRange {
                row,
                value,
                limit: COORDINATE_LIMIT_M,
            });
        }
        self.extend(&xyz);
        if xyz == [0.0; 3] && !keep_origin {
            self.origin += 1;
            return Ok(None);
        }
        Ok(Some(xyz))
    }

    fn extend(&mut self, xyz: &[f64; 3]) {
        for (axis, &c) in xyz.iter().enumerate() {
            self.min[axis] = self.min[axis].min(c);
            self.max[axis] = self.max[axis].max(c);
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.nonfinite += other.nonfinite;
        self.origin += other.origin;
        self.behind += other.behind;
        self.outside += other.outside;
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }
}

fn concatenate(blocks: &[View]) -> View {
    let n = blocks.iter().map(|block| block.indices.len()).sum();
    let mut view = View {
        indices: Vec::with_capacity(n),
        points: Vec::with_capacity(n),
        uv: Vec::with_capacity(n),
        counts: ViewCounts::default(),
    };
    for block in blocks {
        view.indices.extend_from_slice(&block.indices);
        view.points.extend_from_slice(&block.points);
        view.uv.extend_from_slice(&block.uv);
        view.counts.merge(&block.counts);
    }
    view
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: [f64; 16] = [
        1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
    ];
    const PROJECTION: [f64; 12] = [100., 0., 50., 0., 0., 100., 40., 0., 0., 0., 1., 0.];

    fn camera() -> Camera {
        Camera::new(&PROJECTION, &IDENTITY, 0.1).unwrap()
    }

    fn view(points: &[f32]) -> View {
        camera()
            .view(
                Cloud::F32 {
                    values: points,
                    columns: 3,
                },
                80,
                100,
                false,
            )
            .unwrap()
    }

    #[test]
    fn a_point_on_the_axis_falls_on_the_principal_point() {
        let view = view(&[0., 0., 10.]);
        assert_eq!(view.uv, [[50., 40.]]);
    }

    #[test]
    fn points_behind_beside_and_missing_are_counted_and_left_out() {
        let nan = f32::NAN;
        let view = view(&[
            0., 0., -10., 0., 0., 1e-30, 100., 0., 1., nan, 0., 1., 0., 0., 0., 0., 0., 2.,
        ]);
        assert_eq!(view.indices, [5]);
        let counts = view.counts;
        assert_eq!(
            (
                counts.behind,
                counts.outside,
                counts.nonfinite,
                counts.origin
            ),
            (2, 1, 1, 1)
        );
    }

    #[test]
    fn a_coordinate_beyond_the_limit_names_its_row() {
        let cloud = Cloud::F64 {
            values: &[0., 0., 1., 0., 1e30, 1.],
            columns: 3,
        };
        let error = camera().view(cloud, 10, 10, false).unwrap_err();
        assert!(
            matches!(error, Error::CoordinateOutOfRange { row: 1, .. }),
            "{error}"
        );
    }
}
