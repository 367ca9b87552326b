//! Clouds brought together in one frame of reference, and the box around one.

use crate::arrays::{Points, matrix, rows};
use crate::call::{run, run_here};
use crate::errors::raise;
use ldls_core::UprightBox;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

/// Points of all clouds, one after the other, each after its transform.
#[pyfunction]
pub fn brought_together(
    py: Python<'_>,
    clouds: Vec<Points<'_>>,
    matrices: Vec<[[f64; 4]; 4]>,
    keep_origin: bool,
) -> PyResult<Py<PyArray2<f64>>> {
    let clouds = clouds.iter().zip(&matrices);
    let clouds = clouds.map(|(cloud, &[x, y, z, _])| Ok((cloud.cloud(py)?, [x, y, z])));
    let clouds: Vec<_> = clouds.collect::<PyResult<_>>()?;
    let points = run(py, None, |cancel| {
        ldls_core::brought_together(&clouds, keep_origin, cancel)
    })?;
    matrix(py, points.into_flattened(), 3)
}

/// Center, size and yaw of the upright box around points.
#[pyfunction]
pub fn upright_box(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
) -> PyResult<([f64; 3], [f64; 3], f64)> {
    let points = rows::<3>(py, "points", &points)?;
    let found = run_here(py, || Ok(UprightBox::around(&points)))?;
    let found =
        found.ok_or_else(|| raise(py, "ShapeError", "points: expected at least one, got none"))?;
    Ok((found.center, found.size, found.yaw))
}
