//! NumPy arrays in and out. Input arrays are C-contiguous: the Python side sees to that.

use crate::errors::{or_raise, raise};
use ldls_core::{Cancel, Cloud, PixelLabels, PointGraph, memory};
use numpy::ndarray::{ArrayView, Dimension};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray1,
    PyReadonlyArray2,
};
use pyo3::prelude::*;

/// Rows of x y z and more, single or double precision.
#[derive(FromPyObject)]
pub enum Points<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

impl Points<'_> {
    /// The rows as the core reads them.
    pub fn cloud(&self, py: Python<'_>) -> PyResult<Cloud<'_>> {
        let columns = match self {
            Self::F32(array) => array.as_array().ncols(),
            Self::F64(array) => array.as_array().ncols(),
        };
        if columns < 3 {
            return Err(raise(
                py,
                "ShapeError",
                &format!("points: expected (N, 3) or wider, got {columns} columns"),
            ));
        }
        Ok(match self {
            Self::F32(array) => Cloud::F32 {
                values: slice(py, "points", array)?,
                columns,
            },
            Self::F64(array) => Cloud::F64 {
                values: slice(py, "points", array)?,
                columns,
            },
        })
    }
}

/// The values of a C-contiguous array. Unlike `as_slice`, refuses Fortran order, which would come out transposed.
pub fn slice<'a, T: Element, D: Dimension>(
    py: Python<'_>,
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    let view: ArrayView<'a, T, D> = array.as_array();
    view.to_slice().ok_or_else(|| {
        raise(
            py,
            "InputError",
            &format!("{name}: expected a C-contiguous array"),
        )
    })
}

/// Rows of `COLUMNS` values.
pub fn rows<const COLUMNS: usize>(
    py: Python<'_>,
    name: &str,
    array: &PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<[f64; COLUMNS]>> {
    let found = array.as_array().ncols();
    if found != COLUMNS {
        return Err(raise(
            py,
            "ShapeError",
            &format!("{name}: expected (n, {COLUMNS}), got {found} columns"),
        ));
    }
    let rows = slice(py, name, array)?.as_chunks().0;
    copied(py, rows)
}

/// A copy of `values`.
pub fn copied<T: Copy>(py: Python<'_>, values: &[T]) -> PyResult<Vec<T>> {
    collected(py, values.iter().copied())
}

/// `values` in memory, if there is enough.
pub fn collected<T>(py: Python<'_>, values: impl ExactSizeIterator<Item = T>) -> PyResult<Vec<T>> {
    or_raise(py, memory::collect(values, Cancel::never()))
}

/// A matrix of `columns` columns from its values row by row.
pub fn matrix<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    columns: usize,
) -> PyResult<Py<PyArray2<T>>> {
    let rows = values.len().checked_div(columns).unwrap_or(0);
    Ok(values.into_pyarray(py).reshape([rows, columns])?.unbind())
}

/// Row starts, column indices and values of a sparse matrix, as `scipy.sparse` has them.
pub type CsrArrays = (Py<PyArray1<i64>>, Py<PyArray1<i32>>, Py<PyArray1<f32>>);
/// The same as arguments.
pub type CsrArguments<'py> = (
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, i32>,
    PyReadonlyArray1<'py, f32>,
);

/// Sparse arrays for Python.
pub fn csr_arrays(
    py: Python<'_>,
    offsets: &[usize],
    columns: &[u32],
    weights: Vec<f32>,
) -> PyResult<CsrArrays> {
    let offsets = collected(py, offsets.iter().map(|&offset| offset as i64))?;
    let columns = collected(py, columns.iter().map(|&column| column as i32))?;
    Ok((
        offsets.into_pyarray(py).unbind(),
        columns.into_pyarray(py).unbind(),
        weights.into_pyarray(py).unbind(),
    ))
}

/// The point graph in sparse arrays from Python.
pub fn graph(py: Python<'_>, arrays: &CsrArguments<'_>) -> PyResult<PointGraph> {
    let (offsets, columns, weights) = csr_vectors(py, arrays)?;
    or_raise(py, PointGraph::from_csr(offsets, columns, weights))
}

/// The pixel labels in sparse arrays from Python, with the weight of all pixel edges of each point.
pub fn pixel_labels(
    py: Python<'_>,
    arrays: &CsrArguments<'_>,
    mass: Vec<f32>,
) -> PyResult<PixelLabels> {
    let (offsets, labels, weights) = csr_vectors(py, arrays)?;
    or_raise(py, PixelLabels::from_csr(offsets, labels, weights, mass))
}

fn csr_vectors(
    py: Python<'_>,
    arrays: &CsrArguments<'_>,
) -> PyResult<(Vec<usize>, Vec<u32>, Vec<f32>)> {
    // negative indices turn into huge ones, which the core refuses
    let offsets = slice(py, "indptr", &arrays.0)?.iter();
    let offsets = collected(py, offsets.map(|&offset| offset as usize))?;
    let columns = slice(py, "indices", &arrays.1)?.iter();
    let columns = collected(py, columns.map(|&column| column as u32))?;
    let weights = copied(py, slice(py, "values", &arrays.2)?)?;
    Ok((offsets, columns, weights))
}
