//! Points to pixels: a general pinhole camera.

use super::distortion::{Distortion, Lens};
use super::lanes::{LANES, Lanes};
use crate::bits::ones;
use crate::{Error, Result};
use nalgebra::{Matrix3, Matrix3x4, Matrix4};

/// Largest deviation of a rotation from orthonormal; calibration files round to 7 digits.
const ROTATION_LIMIT: f64 = 1e-3;

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
    /// Place of the camera in the lidar frame, in metres.
    center: [f64; 3],
    /// Set if the camera looks along z of the lidar frame, so that this is no lidar's but like the camera's own.
    looks_along_z: bool,
}

/// What an image sees of sixteen points, a bit for each.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sights {
    /// Those beyond the smallest depth.
    pub(super) in_front: u32,
    /// Those of which the nearest pixel lies in the image.
    pub(super) seen: u32,
    /// The pixels of these, u and v.
    pub(super) uv: [[f64; LANES]; 2],
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
            center: center(&transform),
            looks_along_z: transform[(2, 2)] > std::f64::consts::FRAC_1_SQRT_2,
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
            ..pinhole
        })
    }

    /// What an image of `height` x `width` pixels sees of points of the lidar frame, by their x, y and z in metres.
    #[inline(always)]
    pub(super) fn sights(&self, xyz: &[Lanes; 3], [height, width]: [usize; 2]) -> Sights {
        let row = |row: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|column| Lanes::all(self.matrix[(row, column)]));
            a * xyz[0] + b * xyz[1] + c * xyz[2] + d
        };
        let depth = row(2);
        let in_front = depth.above(self.min_depth_m).bits();
        let uv = match in_front {
            0 => [Lanes::all(f64::NAN); 2],
            _ => self.bent([row(0) / depth, row(1) / depth], in_front),
        };
        // the nearest pixel lies in the image, as in `nearest_pixel`
        let inside = |along: Lanes, size: usize| {
            let nearest = along + Lanes::all(0.5);
            nearest.within(0.0, size as f64)
        };
        Sights {
            in_front,
            seen: in_front & (inside(uv[0], width) & inside(uv[1], height)).bits(),
            uv: uv.map(Lanes::to_array),
        }
    }

    /// Pixels of points at x and y of the plane z = 1 before the lens; without one these are the pixels.
    #[inline(always)]
    fn bent(&self, plane: [Lanes; 2], wanted: u32) -> [Lanes; 2] {
        if self.lens.is_none() {
            return plane;
        }
        let ([x, y], mut uv) = (plane.map(Lanes::to_array), [[f64::NAN; LANES]; 2]);
        for lane in ones(wanted) {
            let [u, v] = self.bend([x[lane], y[lane]]);
            (uv[0][lane], uv[1][lane]) = (u, v);
        }
        uv.map(|along| Lanes::from_array(&along))
    }

    /// A point of the lidar frame relative to the camera, in metres, with z upwards: that of the lidar frame, and -y where
    /// the camera looks along its z, as in clouds that are in the camera's own frame.
    pub(crate) fn upright(&self, xyz: &[f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.relative(xyz);
        if self.looks_along_z {
            [z, -x, -y]
        } else {
            [x, y, z]
        }
    }

    fn relative(&self, xyz: &[f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|axis| xyz[axis] - self.center[axis])
    }

    /// Distance of a point in the lidar frame to the camera, in metres.
    #[inline]
    pub fn distance(&self, xyz: &[f64; 3]) -> f64 {
        let [x, y, z] = self.relative(xyz);
        (x * x + y * y + z * z).sqrt()
    }

    /// u and v in pixels, and the depth in metres, of a point in the lidar frame. Points beyond the reach of the lens
    /// have no pixel: u and v are NaN.
    #[inline]
    pub fn project(&self, xyz: &[f64; 3]) -> [f64; 3] {
        let depth = self.row(2, xyz);
        let [u, v] = self.pixel(xyz, depth);
        [u, v, depth]
    }

    /// u and v of a point at `depth`.
    #[inline]
    fn pixel(&self, xyz: &[f64; 3], depth: f64) -> [f64; 2] {
        let plane = [self.row(0, xyz) / depth, self.row(1, xyz) / depth];
        if self.lens.is_none() {
            return plane;
        }
        self.bend(plane)
    }

    /// u and v of a point of the plane z = 1 before the lens.
    fn bend(&self, plane: [f64; 2]) -> [f64; 2] {
        let k = &self.intrinsic;
        self.lens.bend(plane).map_or([f64::NAN; 2], |[x, y]| {
            [0, 1].map(|row| k[(row, 0)] * x + k[(row, 1)] * y + k[(row, 2)])
        })
    }

    /// A row of the matrix times a point.
    #[inline]
    fn row(&self, row: usize, [x, y, z]: &[f64; 3]) -> f64 {
        let m = &self.matrix;
        m[(row, 0)] * x + m[(row, 1)] * y + m[(row, 2)] * z + m[(row, 3)]
    }
}

/// The origin of the camera frame in the lidar frame.
fn center(t_camera_lidar: &Matrix4<f64>) -> [f64; 3] {
    let rotation = t_camera_lidar.fixed_view::<3, 3>(0, 0);
    let translation = t_camera_lidar.fixed_view::<3, 1>(0, 3);
    (-rotation.transpose() * translation).into()
}

/// The pixel nearest to `uv`, as column and row, if it lies in an image of `height` x `width` pixels.
#[inline]
pub(crate) fn nearest_pixel([u, v]: [f64; 2], height: usize, width: usize) -> Option<[usize; 2]> {
    let [column, row] = [u + 0.5, v + 0.5];
    // written so that NaN fails; from 0 on, a cast rounds down
    let inside = column >= 0.0 && column < width as f64 && row >= 0.0 && row < height as f64;
    inside.then_some([column as usize, row as usize])
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
        hint: if deviation <= ROTATION_LIMIT {
            "is an axis flipped, which makes a mirror?"
        } else {
            "is the matrix transposed, scaled or row-major?"
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{IDENTITY, PROJECTION};

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
}
