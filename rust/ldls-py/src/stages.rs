//! The steps of the method one by one, for `ldls.stages`.

use crate::arrays::{
    CsrArguments, CsrArrays, Points, collected, copied, csr_arrays, graph, matrix,
    pixel_labels as labels_of, rows, slice,
};
use crate::call::run;
use crate::camera::Camera;
use crate::masks::Masks;
use crate::segment::ParamsAttributes;
use ldls_core::{DepthGroups, LabelImage, PointGraph, memory};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// Indices and pixels of the points in view.
type ViewArrays = (Py<PyArray1<i64>>, Py<PyArray2<f64>>);
/// Indices and squared distances.
type NeighborArrays = (Py<PyArray2<u32>>, Py<PyArray2<f64>>);
/// Near and far distance of each mask's object, distance of each point, and whether masks are not sure of it.
type DepthArrays = (Py<PyArray2<f64>>, Py<PyArray1<f64>>, Py<PyArray1<bool>>);
type DepthArguments<'py> = (
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, bool>,
);
/// Weights by label and weights of all pixel edges.
type PixelLabelArrays = (CsrArrays, Py<PyArray1<f32>>);

/// Rows in view and their pixels.
#[pyfunction]
pub fn project(
    py: Python<'_>,
    points: Points<'_>,
    camera: &Camera,
    height: usize,
    width: usize,
    keep_origin: bool,
    threads: Option<usize>,
) -> PyResult<ViewArrays> {
    let cloud = points.cloud(py)?;
    let mut in_view = run(py, threads, |cancel| {
        ldls_core::project(cloud, &[(&camera.0, [height, width])], keep_origin, cancel)
    })?;
    let indices = in_view.indices.iter().map(|&row| i64::from(row));
    let indices = collected(py, indices)?;
    let uv = in_view.sightings.swap_remove(0).uv;
    Ok((
        indices.into_pyarray(py).unbind(),
        matrix(py, uv.into_flattened(), 2)?,
    ))
}

/// Heights above the ground.
#[pyfunction]
pub fn ground(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    camera: &Camera,
    local: bool,
    threads: Option<usize>,
) -> PyResult<Py<PyArray1<f64>>> {
    let points = rows::<3>(py, "points", &points)?;
    let heights = run(py, threads, |cancel| {
        ldls_core::ground_heights(&points, &camera.0, local, cancel)
    })?;
    Ok(heights.into_pyarray(py).unbind())
}

/// Rows of the points that the graph has, by their heights.
#[pyfunction]
pub fn in_graph(
    py: Python<'_>,
    heights: PyReadonlyArray1<'_, f64>,
    clearance: f64,
) -> PyResult<Py<PyArray1<i64>>> {
    let heights = slice(py, "heights", &heights)?;
    let rows = (0..)
        .zip(heights)
        .filter(|(_, height)| !ldls_core::is_cleared(**height, clearance));
    Ok(rows
        .map(|(row, _)| row)
        .collect::<Vec<i64>>()
        .into_pyarray(py)
        .unbind())
}

/// Distances of the objects of the masks, those of the points, and which points the masks are not sure of.
#[pyfunction]
pub fn depth_groups(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    pixels: PyReadonlyArray2<'_, f64>,
    masks: &Masks,
    camera: &Camera,
    heights: PyReadonlyArray1<'_, f64>,
    params: ParamsAttributes,
) -> PyResult<DepthArrays> {
    let points = rows::<3>(py, "points", &points)?;
    let pixels = rows::<2>(py, "pixels", &pixels)?;
    let heights = slice(py, "heights", &heights)?;
    let groups = run(py, params.threads, |cancel| {
        let distances =
            memory::collect(points.iter().map(|point| camera.0.distance(point)), cancel)?;
        let standing = memory::collect(heights.iter().map(|&h| !ldls_core::is_ground(h)), cancel)?;
        let params = params.params();
        masks
            .0
            .depth_groups(&pixels, distances, &standing, &params, cancel)
    })?;
    let intervals = groups
        .intervals
        .iter()
        .map(|interval| interval.unwrap_or([f64::NAN; 2]));
    Ok((
        matrix(py, intervals.flatten().collect(), 2)?,
        groups.distances.into_pyarray(py).unbind(),
        groups.unsure.into_pyarray(py).unbind(),
    ))
}

/// Indices and squared distances of the k nearest neighbours.
#[pyfunction]
pub fn neighbors(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    k: usize,
    threads: Option<usize>,
) -> PyResult<NeighborArrays> {
    let points = rows::<3>(py, "points", &points)?;
    let (found, squared_distances) = run(py, threads, |cancel| {
        let found = ldls_core::Neighbors::search(&points, k, cancel)?;
        let squared_distances = found.squared_distances(&points, cancel)?;
        Ok((found, squared_distances))
    })?;
    if found.k == 0 {
        let shape = [points.len(), 0];
        return Ok((
            PyArray2::zeros(py, shape, false).unbind(),
            PyArray2::zeros(py, shape, false).unbind(),
        ));
    }
    Ok((
        matrix(py, found.indices, found.k)?,
        matrix(py, squared_distances, found.k)?,
    ))
}

/// The point graph, not normalised.
#[pyfunction]
pub fn point_graph(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    indices: PyReadonlyArray2<'_, u32>,
    sigma: f64,
    ground: Option<PyReadonlyArray1<'_, bool>>,
    ground_edges: f64,
    threads: Option<usize>,
) -> PyResult<CsrArrays> {
    let points = rows::<3>(py, "points", &points)?;
    let k = indices.shape()[1];
    let neighbors = ldls_core::Neighbors {
        k,
        indices: copied(py, slice(py, "indices", &indices)?)?,
    };
    let ground = ground
        .as_ref()
        .map(|ground| slice(py, "ground", ground))
        .transpose()?;
    let (offsets, columns, weights) = run(py, threads, |cancel| {
        let mut graph = PointGraph::<f32>::from_neighbors(&points, &neighbors, sigma, cancel)?;
        if let Some(ground) = ground {
            graph.weaken_ground_edges(ground, ground_edges, cancel)?;
        }
        graph.into_csr(cancel)
    })?;
    csr_arrays(py, &offsets, &columns, weights)
}

/// Weights of the pixel edges by label, and of all of them, not normalised.
#[pyfunction]
pub fn pixel_labels(
    py: Python<'_>,
    pixels: PyReadonlyArray2<'_, f64>,
    masks: &Masks,
    window: usize,
    pixel_weight: f64,
    depths: Option<DepthArguments<'_>>,
    threads: Option<usize>,
) -> PyResult<PixelLabelArrays> {
    let pixels = rows::<2>(py, "pixels", &pixels)?;
    let depths = depths
        .map(|depths| depth_groups_of(py, &depths))
        .transpose()?;
    let admitted = |at: usize, label| {
        depths
            .as_ref()
            .is_none_or(|depths| depths.admits(at, label))
    };
    let labels = run(py, threads, |cancel| {
        let image = LabelImage::paint(&masks.0, cancel)?;
        image.pixel_labels(&pixels, window, pixel_weight, admitted, cancel)
    })?;
    label_arrays(py, labels)
}

/// Labels of the nearest pixels.
#[pyfunction]
pub fn direct_labels(
    py: Python<'_>,
    pixels: PyReadonlyArray2<'_, f64>,
    masks: &Masks,
) -> PyResult<Py<PyArray1<i32>>> {
    let pixels = rows::<2>(py, "pixels", &pixels)?;
    let labels = run(py, None, |cancel| {
        LabelImage::paint(&masks.0, cancel)?.direct_labels(&pixels, cancel)
    })?;
    signed(py, &labels)
}

/// Both matrices with rows that sum to 1 together.
#[pyfunction]
pub fn normalize_rows(
    py: Python<'_>,
    point_graph: CsrArguments<'_>,
    labels: CsrArguments<'_>,
    mass: PyReadonlyArray1<'_, f32>,
) -> PyResult<(CsrArrays, PixelLabelArrays)> {
    let mut graph = graph(py, &point_graph)?;
    let mut labels = labels_of(py, &labels, copied(py, slice(py, "mass", &mass)?)?)?;
    let (offsets, columns, weights) = run(py, None, |cancel| {
        graph.normalize_rows(&mut labels, cancel)?;
        graph.into_csr(cancel)
    })?;
    Ok((
        csr_arrays(py, &offsets, &columns, weights)?,
        label_arrays(py, labels)?,
    ))
}

/// Values of all labels at all points, the number of sweeps and the residual. `mass` bounds what values may sum to.
#[pyfunction]
pub fn diffuse(
    py: Python<'_>,
    point_graph: CsrArguments<'_>,
    labels: CsrArguments<'_>,
    mass: PyReadonlyArray1<'_, f32>,
    n_labels: usize,
    iterations: Option<usize>,
    threads: Option<usize>,
) -> PyResult<(Py<PyArray2<f32>>, usize, Option<f64>)> {
    let a = graph(py, &point_graph)?;
    let b = labels_of(py, &labels, copied(py, slice(py, "mass", &mass)?)?)?;
    let (z, convergence) = run(py, threads, |cancel| {
        ldls_core::likelihoods(&a, &b, n_labels, iterations, cancel)
    })?;
    Ok((
        matrix(py, z, n_labels)?,
        convergence.sweeps,
        convergence.residual,
    ))
}

/// Labels without what is not in the largest component of each, nor within `part_gap` metres of it.
#[pyfunction]
pub fn remove_outliers(
    py: Python<'_>,
    point_graph: CsrArguments<'_>,
    labels: PyReadonlyArray1<'_, u32>,
    points: PyReadonlyArray2<'_, f64>,
    part_gap: f64,
) -> PyResult<Py<PyArray1<i32>>> {
    let graph = graph(py, &point_graph)?;
    let labels = slice(py, "labels", &labels)?;
    let points = rows::<3>(py, "points", &points)?;
    let kept = run(py, None, |cancel| {
        ldls_core::remove_outliers(&graph, labels, part_gap, |row| points[row], cancel)
    })?;
    signed(py, &kept)
}

/// Confidence of labels from the likelihoods' shares.
#[pyfunction]
pub fn confidence(
    py: Python<'_>,
    shares: PyReadonlyArray1<'_, f32>,
    diffused: PyReadonlyArray1<'_, u32>,
    labels: PyReadonlyArray1<'_, u32>,
    scores: PyReadonlyArray1<'_, f32>,
) -> PyResult<Py<PyArray1<f32>>> {
    let shares = slice(py, "shares", &shares)?;
    let diffused = slice(py, "diffused", &diffused)?;
    let labels = slice(py, "labels", &labels)?;
    let scores = slice(py, "scores", &scores)?;
    let found = run(py, None, |cancel| {
        ldls_core::calibrated_confidence(shares, diffused, labels, scores, cancel)
    })?;
    Ok(found.into_pyarray(py).unbind())
}

fn depth_groups_of(
    py: Python<'_>,
    (intervals, distances, unsure): &DepthArguments,
) -> PyResult<DepthGroups> {
    let interval = |&[near, far]: &[f64; 2]| (!near.is_nan()).then_some([near, far]);
    Ok(DepthGroups {
        intervals: rows::<2>(py, "intervals", intervals)?
            .iter()
            .map(interval)
            .collect(),
        distances: copied(py, slice(py, "distances", distances)?)?,
        unsure: copied(py, slice(py, "unsure", unsure)?)?,
    })
}

fn label_arrays(py: Python<'_>, labels: ldls_core::PixelLabels) -> PyResult<PixelLabelArrays> {
    let mass = labels.mass.into_pyarray(py).unbind();
    let arrays = csr_arrays(py, &labels.offsets, &labels.labels, labels.weights)?;
    Ok((arrays, mass))
}

fn signed(py: Python<'_>, labels: &[u32]) -> PyResult<Py<PyArray1<i32>>> {
    let labels = labels.iter().map(|&label| label as i32);
    let labels = collected(py, labels)?;
    Ok(labels.into_pyarray(py).unbind())
}
