//! The whole method for Python.

use crate::arrays::{Points, matrix, slice};
use crate::call::run;
use crate::masks::Masks;
use crate::memory::StreamMemory;
use ldls_core::{Memory, Params, Timings};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The parameters of the method as Python gives them, in the order of `ldls.Params`.
#[derive(FromPyObject)]
pub struct ParamsTuple(usize, f64, f64, usize, Option<usize>, bool);

impl ParamsTuple {
    fn params(&self) -> Params {
        Params {
            neighbors: self.0,
            sigma: self.1,
            pixel_weight: self.2,
            window: self.3,
            iterations: self.4,
            remove_outliers: self.5,
        }
    }
}

/// Everything that the core says of a cloud.
#[pyclass(frozen, get_all, module = "ldls._ldls")]
pub struct SegmentationArrays {
    labels: Py<PyArray1<i32>>,
    diffused_labels: Py<PyArray1<i32>>,
    confidence: Py<PyArray1<f32>>,
    in_view: Py<PyArray1<i64>>,
    pixels: Py<PyArray2<f64>>,
    report: Py<PyDict>,
    timings: Py<PyDict>,
}

/// Segments points by the masks of the image that the camera took.
#[pyfunction]
#[pyo3(signature = (points, masks, projection, t_camera_lidar, min_depth_m, params, keep_origin, threads, memory))]
#[expect(
    clippy::too_many_arguments,
    reason = "the face in Python has few; here each is one extraction"
)]
pub fn segment(
    py: Python<'_>,
    points: Points<'_>,
    masks: &Masks,
    projection: PyReadonlyArray2<'_, f64>,
    t_camera_lidar: PyReadonlyArray2<'_, f64>,
    min_depth_m: f64,
    params: ParamsTuple,
    keep_origin: bool,
    threads: Option<usize>,
    memory: Option<&StreamMemory>,
) -> PyResult<SegmentationArrays> {
    let camera = camera(py, &projection, &t_camera_lidar, min_depth_m)?;
    let cloud = points.cloud(py)?;
    let params = params.params();
    let found = run(py, threads, || {
        let segment = |memory: &mut Memory| {
            ldls_core::segment(cloud, &masks.0, &camera, &params, keep_origin, memory)
        };
        match memory {
            Some(stream) => stream.lend(segment),
            None => segment(&mut Memory::of_one_frame()),
        }
    })?;
    let report = report(py, &found.report)?;
    let in_view: Vec<i64> = found
        .view
        .indices
        .iter()
        .map(|&index| i64::from(index))
        .collect();
    Ok(SegmentationArrays {
        labels: found.labels.into_pyarray(py).unbind(),
        diffused_labels: found.diffused_labels.into_pyarray(py).unbind(),
        confidence: found.confidence.into_pyarray(py).unbind(),
        in_view: in_view.into_pyarray(py).unbind(),
        pixels: matrix(py, found.view.uv.into_flattened(), 2)?,
        report,
        timings: timings(py, &found.timings)?,
    })
}

/// Refuses parameters outside their range.
#[pyfunction]
pub fn check_params(py: Python<'_>, params: ParamsTuple, threads: Option<usize>) -> PyResult<()> {
    run(py, threads, || params.params().check())
}

/// Refuses matrices that cannot be a camera's.
#[pyfunction]
pub fn check_camera(
    py: Python<'_>,
    projection: PyReadonlyArray2<'_, f64>,
    t_camera_lidar: PyReadonlyArray2<'_, f64>,
    min_depth_m: f64,
) -> PyResult<()> {
    camera(py, &projection, &t_camera_lidar, min_depth_m).map(drop)
}

/// The camera of two matrices from Python.
pub fn camera(
    py: Python<'_>,
    projection: &PyReadonlyArray2<'_, f64>,
    t_camera_lidar: &PyReadonlyArray2<'_, f64>,
    min_depth_m: f64,
) -> PyResult<ldls_core::Camera> {
    let projection = fixed(py, "projection", projection)?;
    let t_camera_lidar = fixed(py, "T_camera_lidar", t_camera_lidar)?;
    ldls_core::Camera::new(&projection, &t_camera_lidar, min_depth_m)
        .map_err(|error| crate::errors::to_python(py, &error))
}

fn fixed<const N: usize>(
    py: Python<'_>,
    name: &str,
    array: &PyReadonlyArray2<'_, f64>,
) -> PyResult<[f64; N]> {
    let values = slice(py, name, array)?;
    let message = || format!("{name}: expected {N} numbers, got {}", values.len());
    values
        .try_into()
        .map_err(|_| crate::errors::raise(py, "CalibrationError", &message()))
}

fn report(py: Python<'_>, report: &ldls_core::Report) -> PyResult<Py<PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("n_nonfinite", report.counts.nonfinite)?;
    dict.set_item("n_origin", report.counts.origin)?;
    dict.set_item("n_behind", report.counts.behind)?;
    dict.set_item("n_outside", report.counts.outside)?;
    dict.set_item("n_duplicates", report.duplicates)?;
    dict.set_item("only_islands", report.only_islands)?;
    dict.set_item("k_effective", report.k_effective)?;
    dict.set_item("n_refined", report.convergence.refined)?;
    dict.set_item("sweeps", report.convergence.sweeps)?;
    dict.set_item("residual", report.convergence.residual)?;
    dict.set_item("converged", report.convergence.converged())?;
    dict.set_item("bounds", (report.counts.min, report.counts.max))?;
    Ok(dict.unbind())
}

fn timings(py: Python<'_>, timings: &Timings) -> PyResult<Py<PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("project", timings.project.as_secs_f64())?;
    dict.set_item("neighbors", timings.neighbors.as_secs_f64())?;
    dict.set_item("pixel_labels", timings.pixel_labels.as_secs_f64())?;
    dict.set_item("graph", timings.graph.as_secs_f64())?;
    dict.set_item("diffusion", timings.diffusion.as_secs_f64())?;
    dict.set_item("components", timings.components.as_secs_f64())?;
    Ok(dict.unbind())
}
