//! The steps of the method one by one, for `ldls.stages`.

use crate::arrays::{
    CsrArguments, CsrArrays, Points, csr_arrays, graph, matrix, pixel_labels as labels_of, rows,
    slice,
};
use crate::call::run;
use crate::camera::Camera;
use crate::masks::Masks;
use ldls_core::PointGraph;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// Indices and pixels of the points in view.
type ViewArrays = (Py<PyArray1<i64>>, Py<PyArray2<f64>>);
/// Indices and squared distances.
type NeighborArrays = (Py<PyArray2<u32>>, Py<PyArray2<f64>>);
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
    let mut in_view = run(py, threads, || {
        ldls_core::project(cloud, &[(&camera.0, [height, width])], keep_origin)
    })?;
    let indices: Vec<i64> = in_view.indices.iter().map(|&i| i.into()).collect();
    let uv = in_view.sightings.swap_remove(0).uv;
    Ok((
        indices.into_pyarray(py).unbind(),
        matrix(py, uv.into_flattened(), 2)?,
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
    let found = run(py, threads, || Ok(ldls_core::Neighbors::search(&points, k)))?;
    let squared_distances = found.squared_distances(&points);
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
    threads: Option<usize>,
) -> PyResult<CsrArrays> {
    let points = rows::<3>(py, "points", &points)?;
    let k = indices.shape()[1];
    let neighbors = ldls_core::Neighbors {
        k,
        indices: slice(py, "indices", &indices)?.to_vec(),
    };
    let graph = run(py, threads, || {
        PointGraph::<f32>::from_neighbors(&points, &neighbors, sigma)
    })?;
    let (offsets, columns, weights) = graph.into_csr();
    Ok(csr_arrays(py, &offsets, &columns, weights))
}

/// Weights of the pixel edges by label, and of all of them, not normalised.
#[pyfunction]
pub fn pixel_labels(
    py: Python<'_>,
    pixels: PyReadonlyArray2<'_, f64>,
    masks: &Masks,
    window: usize,
    pixel_weight: f64,
    threads: Option<usize>,
) -> PyResult<PixelLabelArrays> {
    let pixels = rows::<2>(py, "pixels", &pixels)?;
    let labels = run(py, threads, || {
        masks.0.pixel_labels(&pixels, window, pixel_weight)
    })?;
    Ok(label_arrays(py, labels))
}

/// Labels of the nearest pixels.
#[pyfunction]
pub fn direct_labels(
    py: Python<'_>,
    pixels: PyReadonlyArray2<'_, f64>,
    masks: &Masks,
) -> PyResult<Py<PyArray1<i32>>> {
    let pixels = rows::<2>(py, "pixels", &pixels)?;
    let labels = run(py, None, || masks.0.direct_labels(&pixels))?;
    Ok(signed(&labels).into_pyarray(py).unbind())
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
    let mut labels = labels_of(py, &labels, slice(py, "mass", &mass)?.to_vec())?;
    run(py, None, || graph.normalize_rows(&mut labels))?;
    let (offsets, columns, weights) = graph.into_csr();
    Ok((
        csr_arrays(py, &offsets, &columns, weights),
        label_arrays(py, labels),
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
    let b = labels_of(py, &labels, slice(py, "mass", &mass)?.to_vec())?;
    let (z, convergence) = run(py, threads, || {
        ldls_core::likelihoods(&a, &b, n_labels, iterations)
    })?;
    Ok((
        matrix(py, z, n_labels)?,
        convergence.sweeps,
        convergence.residual,
    ))
}

/// Labels without what is not in the largest component of each.
#[pyfunction]
pub fn largest_components(
    py: Python<'_>,
    point_graph: CsrArguments<'_>,
    labels: PyReadonlyArray1<'_, u32>,
) -> PyResult<Py<PyArray1<i32>>> {
    let graph = graph(py, &point_graph)?;
    let labels = slice(py, "labels", &labels)?;
    let kept = run(py, None, || {
        ldls_core::keep_largest_components(&graph, labels)
    })?;
    Ok(signed(&kept).into_pyarray(py).unbind())
}

fn label_arrays(py: Python<'_>, labels: ldls_core::PixelLabels) -> PixelLabelArrays {
    let mass = labels.mass.into_pyarray(py).unbind();
    (
        csr_arrays(py, &labels.offsets, &labels.labels, labels.weights),
        mass,
    )
}

fn signed(labels: &[u32]) -> Vec<i32> {
    labels.iter().map(|&label| label as i32).collect()
}
