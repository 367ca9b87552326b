//! Points to pixels: a general pinhole camera and what it sees.

use crate::distortion::{Distortion, Lens};
use crate::{Cloud, Error, Memory, Result};
use nalgebra::{Matrix3, Matrix3x4, Matrix4};
use rayon::prelude::*;

/// Largest magnitude of a coordinate, in metres: beyond it squared distances lose their meaning.
const COORDINATE_LIMIT_M: f64 = 1e7;
/// How far a rotation may be from orthonormal; calibration files round to 7 digits.
const ROTATION_LIMIT: f64 = 1e-3;
/// Points handled by one task of the thread pool.
const BLOCK: usize = 8192;

/// A camera: a rigid transform to the camera frame (x right, y down, z forward), then a 3 x 4 projection to pixels, with
/// the distortion of the lens between them. Pixel centres lie at integer coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// projection * T_camera_lidar; of a distorted camera, of the plane z = 1 before the lens.
    matrix: Matrix3x4<f64>,
    lens: Lens,
    /// From the plane z = 1 behind the lens to pixels; unused without distortion.
    intrinsic: Matrix3<f64>,
    /// Points at this depth or nearer are not seen, in metres.
    min_depth_m: f64,
}

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

/// What a camera has of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Sight {
    /// At or behind the smallest depth.
    Behind,
    /// In front of the camera, beside the image.
    Outside,
    /// At these pixels, u and v.
    Seen([f64; 2]),
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
    /// A camera from its 3 x 4 projection (camera frame to homogeneous pixels) and the 4 x 4 rigid transform
    /// `T_camera_lidar` from the lidar to the camera frame, both given row by row.
    ///
    /// # Errors
    /// [`Error::CameraNotFinite`], [`Error::CameraSingular`], [`Error::CameraNotRigid`], [`Error::CameraLastRow`], or
    /// [`Error::Parameter`] for the depth.
    pub fn new(
        projection: &[f64; 12],
        t_camera_lidar: &[f64; 16],
        min_depth_m: f64,
    ) -> Result<Self> {
        let projection = Matrix3x4::from_row_slice(projection);
        let transform = Matrix4::from_row_slice(t_camera_lidar);
        check_finite("projection", projection.as_slice(), 3)?;
        check_finite("T_camera_lidar", transform.as_slice(), 4)?;
        check_projection(&projection)?;
        check_rigid(&transform)?;
        if !(min_depth_m >= 0.0 && min_depth_m.is_finite()) {
            return Err(Error::Parameter {
                name: "min_depth_m",
                found: min_depth_m.to_string(),
                expected: "0 or a positive number of metres",
            });
        }
        // the third row then yields metres, whatever the scale of a homogeneous projection
        let projection = projection / projection.fixed_view::<1, 3>(2, 0).norm();
        Ok(Self {
            matrix: projection * transform,
            lens: Lens::new(Distortion::None)?,
            intrinsic: Matrix3::identity(),
            min_depth_m,
        })
    }

    /// A camera whose lens departs from a pinhole, from its 3 x 3 intrinsic matrix K, given row by row; else as
    /// [`Camera::new`].
    ///
    /// # Errors
    /// As [`Camera::new`]; [`Error::CameraIntrinsic`] where the last row of K is not 0 0 1, and [`Error::Distortion`].
    pub fn with_distortion(
        intrinsic: &[f64; 9],
        distortion: Distortion,
        t_camera_lidar: &[f64; 16],
        min_depth_m: f64,
    ) -> Result<Self> {
        let k = Matrix3::from_row_slice(intrinsic);
        let last = [k[(2, 0)], k[(2, 1)], k[(2, 2)]];
        if last != [0.0, 0.0, 1.0] {
            return Err(Error::CameraIntrinsic { found: last });
        }
        let mut projection = [0.0; 12];
        for row in 0..3 {
            projection[4 * row..4 * row + 3].copy_from_slice(&intrinsic[3 * row..3 * row + 3]);
        }
        let pinhole = Self::new(&projection, t_camera_lidar, min_depth_m)?;
        let lens = Lens::new(distortion)?;
        if lens.is_none() {
            return Ok(pinhole);
        }
        let transform = Matrix4::from_row_slice(t_camera_lidar);
        Ok(Self {
            matrix: transform.fixed_rows::<3>(0).into(),
            lens,
            intrinsic: k,
            min_depth_m,
        })
    }

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
        memory: &mut Memory,
    ) -> Result<View> {
        let n = cloud.len();
        check_points(n)?;
        let count = n.div_ceil(BLOCK);
        let mut blocks: Vec<View> = memory.as_left(count);
        let rows = |block: usize| block * BLOCK..n.min((block + 1) * BLOCK);
        let outcomes: Vec<Result<()>> = blocks[..count]
            .par_iter_mut()
            .enumerate()
            .map(|(block, view)| {
                self.view_rows(cloud, rows(block), [height, width], keep_origin, view)
            })
            .collect();
        // taken in order, so that the first bad row is the one reported
        outcomes.into_iter().collect::<Result<()>>()?;
        let view = concatenate(&blocks[..count], memory);
        memory.keep_as_is(blocks);
        Ok(view)
    }

    /// Makes `view` that of some rows.
    fn view_rows(
        &self,
        cloud: Cloud,
        rows: std::ops::Range<usize>,
        [height, width]: [usize; 2],
        keep_origin: bool,
        view: &mut View,
    ) -> Result<()> {
        view.clear();
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
        Ok(())
    }

    /// Where a point of the lidar frame falls on an image of `height` x `width` pixels.
    #[inline]
    pub(crate) fn sight(&self, xyz: &[f64; 3], height: usize, width: usize) -> Sight {
        let [u, v, depth] = self.project(xyz);
        if !(depth > self.min_depth_m) {
            Sight::Behind
        } else if nearest_pixel([u, v], height, width).is_some() {
            Sight::Seen([u, v])
        } else {
            Sight::Outside
        }
    }

    /// u and v in pixels, and the depth in metres, of a point in the lidar frame. Points beyond the reach of the lens
    /// have no pixel: u and v are NaN.
    #[inline]
    pub fn project(&self, [x, y, z]: &[f64; 3]) -> [f64; 3] {
        let m = &self.matrix;
        let row = |i: usize| m[(i, 0)] * x + m[(i, 1)] * y + m[(i, 2)] * z + m[(i, 3)];
        let w = row(2);
        let [x, y] = [row(0) / w, row(1) / w];
        if self.lens.is_none() {
            return [x, y, w];
        }
        let k = &self.intrinsic;
        match self.lens.bend([x, y]) {
            Some([x, y]) => [
                k[(0, 0)] * x + k[(0, 1)] * y + k[(0, 2)],
                k[(1, 0)] * x + k[(1, 1)] * y + k[(1, 2)],
                w,
            ],
            None => [f64::NAN, f64::NAN, w],
        }
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

/// The pixel nearest to `uv`, as column and row, if it lies in an image of `height` x `width` pixels.
#[inline]
pub(crate) fn nearest_pixel([u, v]: [f64; 2], height: usize, width: usize) -> Option<[usize; 2]> {
    let [column, row] = [u, v].map(|c| (c + 0.5).floor());
    // written so that NaN fails
    let inside = column >= 0.0 && column < width as f64 && row >= 0.0 && row < height as f64;
    inside.then_some([column as usize, row as usize])
}

impl View {
    fn clear(&mut self) {
        self.indices.clear();
        self.points.clear();
        self.uv.clear();
        self.counts = ViewCounts::default();
    }
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

fn concatenate(blocks: &[View], memory: &mut Memory) -> View {
    let n = blocks.iter().map(|block| block.indices.len()).sum();
    let mut view = View {
        indices: Vec::with_capacity(n),
        points: memory.empty(n),
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

fn check_finite(matrix: &'static str, column_major: &[f64], rows: usize) -> Result<()> {
    match column_major.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::CameraNotFinite {
            matrix,
            row: at % rows,
            column: at / rows,
            value: column_major[at],
        }),
    }
}

fn check_projection(projection: &Matrix3x4<f64>) -> Result<()> {
    let left: Matrix3<f64> = projection.fixed_columns::<3>(0).into();
    // relative to its size, so that a camera of long focal length is not taken for a flat one
    let size = left.norm();
    if size > 0.0 && (left / size).determinant().abs() > 1e-12 {
        return Ok(());
    }
    Err(Error::CameraSingular {
        fx: left[(0, 0)],
        fy: left[(1, 1)],
        w: left[(2, 2)],
    })
}

fn check_rigid(transform: &Matrix4<f64>) -> Result<()> {
    let last = [
        transform[(3, 0)],
        transform[(3, 1)],
        transform[(3, 2)],
        transform[(3, 3)],
    ];
    if last != [0.0, 0.0, 0.0, 1.0] {
        return Err(Error::CameraLastRow { found: last });
    }
    let rotation: Matrix3<f64> = transform.fixed_view::<3, 3>(0, 0).into();
    let deviation = (rotation.transpose() * rotation - Matrix3::identity())
        .abs()
        .max();
    let determinant = rotation.determinant();
    if deviation <= ROTATION_LIMIT && determinant > 0.0 {
        return Ok(());
    }
    Err(Error::CameraNotRigid {
        deviation,
        determinant,
        limit: ROTATION_LIMIT,
    })
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
                &mut Memory::of_one_frame(),
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
    fn the_image_reaches_half_a_pixel_beyond_its_outer_centres() {
        let pixel = |u| nearest_pixel([u, 3.2], 5, 10);
        assert_eq!((pixel(-0.5), pixel(9.49)), (Some([0, 3]), Some([9, 3])));
        assert_eq!([pixel(-0.51), pixel(9.5), pixel(f64::NAN)], [None; 3]);
    }

    #[test]
    fn matrices_that_cannot_be_cameras_are_refused() {
        let flat = [0.0; 12];
        assert!(matches!(
            Camera::new(&flat, &IDENTITY, 0.1),
            Err(Error::CameraSingular { .. })
        ));
        let mut mirrored = IDENTITY;
        mirrored[0] = -1.0;
        assert!(matches!(
            Camera::new(&PROJECTION, &mirrored, 0.1),
            Err(Error::CameraNotRigid { .. })
        ));
        let mut moved = IDENTITY;
        moved[12] = 3.0;
        assert!(matches!(
            Camera::new(&PROJECTION, &moved, 0.1),
            Err(Error::CameraLastRow { .. })
        ));
        let mut nan = PROJECTION;
        nan[6] = f64::NAN;
        let error = Camera::new(&nan, &IDENTITY, 0.1).unwrap_err();
        assert!(
            error.to_string().contains("projection[1, 2] is NaN"),
            "{error}"
        );
    }

    #[test]
    fn a_coordinate_beyond_the_limit_names_its_row() {
        let cloud = Cloud::F64 {
            values: &[0., 0., 1., 0., 1e30, 1.],
            columns: 3,
        };
        let error = camera()
            .view(cloud, 10, 10, false, &mut Memory::of_one_frame())
            .unwrap_err();
        assert!(
            matches!(error, Error::CoordinateOutOfRange { row: 1, .. }),
            "{error}"
        );
    }
}
