//! The whole method for Python.

use crate::arrays::{Points, matrix};
use crate::call::{checked_threads, run, run_at_once};
use crate::camera::Camera;
use crate::masks::Masks;
use ldls_core::{Params, RingView, Timings};
use numpy::{IntoPyArray, PyArray1, PyArray2};
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
#[pyo3(signature = (points, masks, camera, params, keep_origin, threads))]
pub fn segment(
    py: Python<'_>,
    points: Points<'_>,
    masks: &Masks,
    camera: &Camera,
    params: ParamsTuple,
    keep_origin: bool,
    threads: Option<usize>,
) -> PyResult<SegmentationArrays> {
    let cloud = points.cloud(py)?;
    let params = params.params();
    let mut found = run(py, threads, || {
        ldls_core::segment(cloud, &masks.0, &camera.0, &params, keep_origin)
    })?;
    let pixels = matrix(py, std::mem::take(&mut found.view.uv).into_flattened(), 2)?;
    arrays(py, found, pixels)
}

/// What each camera of a ring sees: positions among the points in view, and pixels.
type SightingArrays = Vec<(Py<PyArray1<i64>>, Py<PyArray2<f64>>)>;
/// Camera and instance of each part of each object.
type ObjectParts = Vec<Vec<(usize, u32)>>;

/// Segments points by the masks of the images that several cameras took.
#[pyfunction]
#[pyo3(signature = (points, masks, categories, cameras, same_object, params, keep_origin, threads))]
#[expect(
    clippy::too_many_arguments,
    reason = "the face in Python has few; here each is one extraction"
)]
pub fn segment_ring(
    py: Python<'_>,
    points: Points<'_>,
    masks: Vec<PyRef<'_, Masks>>,
    categories: Vec<Vec<i32>>,
    cameras: Vec<PyRef<'_, Camera>>,
    same_object: f64,
    params: ParamsTuple,
    keep_origin: bool,
    threads: Option<usize>,
) -> PyResult<(SegmentationArrays, SightingArrays, ObjectParts)> {
    let cloud = points.cloud(py)?;
    let params = params.params();
    let views: Vec<RingView> = masks
        .iter()
        .zip(&categories)
        .zip(&cameras)
        .map(|((masks, categories), camera)| RingView {
            masks: &masks.0,
            categories,
            camera: &camera.0,
        })
        .collect();
    let found = run(py, threads, || {
        ldls_core::segment_ring(cloud, &views, same_object, &params, keep_origin)
    })?;
    let sightings = found
        .sightings
        .into_iter()
        .map(|sighting| {
            let seen: Vec<i64> = sighting.seen.iter().map(|&at| i64::from(at)).collect();
            let pixels = matrix(py, sighting.uv.into_flattened(), 2)?;
            Ok((seen.into_pyarray(py).unbind(), pixels))
        })
        .collect::<PyResult<SightingArrays>>()?;
    let pixels = PyArray2::zeros(py, [0, 2], false).unbind();
    Ok((
        arrays(py, found.segmentation, pixels)?,
        sightings,
        found.objects,
    ))
}

fn arrays(
    py: Python<'_>,
    found: ldls_core::Segmentation,
    pixels: Py<PyArray2<f64>>,
) -> PyResult<SegmentationArrays> {
    let in_view: Vec<i64> = found
        .view
        .indices
        .iter()
        .map(|&index| i64::from(index))
        .collect();
    Ok(SegmentationArrays {
        report: report(py, &found.report)?,
        timings: timings(py, &found.timings)?,
        labels: found.labels.into_pyarray(py).unbind(),
        diffused_labels: found.diffused_labels.into_pyarray(py).unbind(),
        confidence: found.confidence.into_pyarray(py).unbind(),
        in_view: in_view.into_pyarray(py).unbind(),
        pixels,
    })
}

/// Refuses parameters outside their range.
#[pyfunction]
pub fn check_params(py: Python<'_>, params: ParamsTuple, threads: Option<usize>) -> PyResult<()> {
    checked_threads(py, threads)?;
    run_at_once(py, || params.params().check())
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
