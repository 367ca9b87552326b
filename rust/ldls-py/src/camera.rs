//! Cameras as Python objects.

use crate::arrays::slice;
use crate::errors::{raise, to_python};
use ldls_core::Distortion;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// A camera that was checked.
#[pyclass(frozen, module = "ldls._ldls")]
pub struct Camera(pub ldls_core::Camera);

#[pymethods]
impl Camera {
    /// A pinhole where `model` is "none"; else the left 3 x 3 of `projection` is taken for the intrinsic matrix.
    #[new]
    fn new(
        py: Python<'_>,
        projection: PyReadonlyArray2<'_, f64>,
        t_camera_lidar: PyReadonlyArray2<'_, f64>,
        min_depth_m: f64,
        model: &str,
        coefficients: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let projection: [f64; 12] = fixed(py, "projection", slice(py, "projection", &projection)?)?;
        let transform = slice(py, "T_camera_lidar", &t_camera_lidar)?;
        let transform = fixed(py, "T_camera_lidar", transform)?;
        let coefficients = slice(py, "coefficients", &coefficients)?;
        let distortion = match model {
            "none" => Distortion::None,
            "rational" => {
                let c: [f64; 14] = fixed(py, "coefficients", coefficients)?;
                Distortion::Rational {
                    k: [c[0], c[1], c[4], c[5], c[6], c[7]],
                    p: [c[2], c[3]],
                    s: [c[8], c[9], c[10], c[11]],
                    tau: [c[12], c[13]],
                }
            }
            "equidistant" => Distortion::Equidistant {
                k: fixed(py, "coefficients", coefficients)?,
            },
            _ => {
                let message = format!("distortion model: got {model:?}");
                return Err(raise(py, "CalibrationError", &message));
            }
        };
        let camera = if distortion == Distortion::None {
            ldls_core::Camera::new(&projection, &transform, min_depth_m)
        } else {
            let [a, b, c, _, d, e, f, _, g, h, i, _] = projection;
            let intrinsic = [a, b, c, d, e, f, g, h, i];
            ldls_core::Camera::with_distortion(&intrinsic, distortion, &transform, min_depth_m)
        };
        camera.map(Self).map_err(|error| to_python(py, &error))
    }

    /// u and v in pixels and the depth in metres of a point in the lidar frame, in view or not.
    fn project(&self, x: f64, y: f64, z: f64) -> (f64, f64, f64) {
        self.0.project(&[x, y, z]).into()
    }
}

fn fixed<const N: usize>(py: Python<'_>, name: &str, values: &[f64]) -> PyResult<[f64; N]> {
    let message = || format!("{name}: expected {N} numbers, got {}", values.len());
    values
        .try_into()
        .map_err(|_| raise(py, "CalibrationError", &message()))
}
