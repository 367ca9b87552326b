//! Clouds brought together in one frame of reference.

use crate::arrays::{Points, matrix};
use crate::call::run;
use numpy::PyArray2;
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
