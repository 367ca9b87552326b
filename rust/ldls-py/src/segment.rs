//! The whole method for Python.

use crate::arrays::{Points, collected, matrix};
use crate::call::{checked_threads, run, run_at_once};
use crate::camera::Camera;
use crate::masks::Masks;
use ldls_core::{Params, Timings, View};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The parameters of the method: the attributes of `ldls.Params`.
#[derive(FromPyObject)]
pub struct ParamsAttributes {
    neighbors: usize,
    sigma: f64,
    pixel_weight: f64,
    window: usize,
    iterations: Option<usize>,
    remove_outliers: bool,
    ground_edges: f64,
    ground_clearance: f64,
    local_ground: bool,
    depth_gap: f64,
    bridged_gap: f64,
    edge_margin: f64,
    part_gap: f64,
    calibrated: bool,
    abstain: f64,
    pub(crate) threads: Option<usize>,
}

impl ParamsAttributes {
    pub(crate) fn params(&self) -> Params {
        Params {
            neighbors: self.neighbors,
            sigma: self.sigma,
            pixel_weight: self.pixel_weight,
            window: self.window,
            iterations: self.iterations,
            remove_outliers: self.remove_outliers,
            ground_edges: self.ground_edges,
            ground_clearance: self.ground_clearance,
            local_ground: self.local_ground,
            depth_gap: self.depth_gap,
            bridged_gap: self.bridged_gap,
            edge_margin: self.edge_margin,
            part_gap: self.part_gap,
            calibrated: self.calibrated,
            abstain: self.abstain,
        }
    }
}

/// The points that one image sees: rows of the cloud, and pixels.
type SightingArrays = (Py<PyArray1<i64>>, Py<PyArray2<f64>>);

/// The result of the core.
#[pyclass(frozen, get_all, module = "ldls._ldls")]
pub struct SegmentationArrays {
    labels: Py<PyArray1<i32>>,
    diffused_labels: Py<PyArray1<i32>>,
    confidence: Py<PyArray1<f32>>,
    in_view: Py<PyArray1<i64>>,
    sightings: Vec<SightingArrays>,
    /// Image and instance, the latter from 1, of each part of each object.
    objects: ldls_core::Objects,
    report: Py<PyDict>,
    timings: Py<PyDict>,
}

/// Segments points by the masks of the images that one camera or several took.
#[pyfunction]
#[pyo3(signature = (points, masks, categories, scores, cameras, rows, same_object, params, keep_origin))]
#[expect(
    clippy::too_many_arguments,
    reason = "the face in Python has few; here each is one extraction"
)]
pub fn segment(
    py: Python<'_>,
    points: Points<'_>,
    masks: Vec<PyRef<'_, Masks>>,
    categories: Vec<Vec<i32>>,
    scores: Vec<Vec<f32>>,
    cameras: Vec<PyRef<'_, Camera>>,
    rows: Option<Vec<[usize; 2]>>,
    same_object: f64,
    params: ParamsAttributes,
    keep_origin: bool,
) -> PyResult<SegmentationArrays> {
    let cloud = points.cloud(py)?;
    let (threads, params) = (params.threads, params.params());
    let rows = rows.unwrap_or_else(|| vec![View::ALL_ROWS; masks.len()]);
    let views = masks.iter().zip(&categories).zip(&scores).zip(&cameras);
    let views: Vec<View> = views
        .zip(rows)
        .map(|((((masks, categories), scores), camera), rows)| View {
            masks: &masks.0,
            categories,
            scores,
            camera: &camera.0,
            rows,
        })
        .collect();
    let segmentation = run(py, threads, |cancel| {
        ldls_core::segment(cloud, &views, same_object, &params, keep_origin, cancel)
    })?;
    let rows = segmentation.in_view.iter().map(|&row| i64::from(row));
    let in_view = collected(py, rows)?;
    let sightings = segmentation.sightings.into_iter().map(|sighting| {
        let rows = sighting.seen.iter().map(|&at| in_view[at as usize]);
        let rows = collected(py, rows)?.into_pyarray(py).unbind();
        Ok((rows, matrix(py, sighting.uv.into_flattened(), 2)?))
    });
    Ok(SegmentationArrays {
        labels: segmentation.labels.into_pyarray(py).unbind(),
        diffused_labels: segmentation.diffused_labels.into_pyarray(py).unbind(),
        confidence: segmentation.confidence.into_pyarray(py).unbind(),
        sightings: sightings.collect::<PyResult<_>>()?,
        in_view: in_view.into_pyarray(py).unbind(),
        objects: segmentation.objects,
        report: report(py, &segmentation.report)?,
        timings: timings(py, &segmentation.timings)?,
    })
}

/// Refuses parameters outside their range.
#[pyfunction]
pub fn check_params(py: Python<'_>, params: ParamsAttributes) -> PyResult<()> {
    checked_threads(py, params.threads)?;
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
    dict.set_item("depth", timings.depth.as_secs_f64())?;
    dict.set_item("pixel_labels", timings.pixel_labels.as_secs_f64())?;
    dict.set_item("graph", timings.graph.as_secs_f64())?;
    dict.set_item("diffusion", timings.diffusion.as_secs_f64())?;
    dict.set_item("components", timings.components.as_secs_f64())?;
    Ok(dict.unbind())
}
