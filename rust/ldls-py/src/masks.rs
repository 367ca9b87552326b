//! Masks as Python objects.

use crate::arrays::{matrix, slice};
use crate::call::{run, run_at_once, run_here};
use crate::errors::raise;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray3,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};

/// Height, width and runs.
type RunLengths = (usize, usize, Py<PyArray1<u32>>);

/// One mask as column-major run lengths.
#[pyclass(frozen, eq, hash, module = "ldls._ldls", skip_from_py_object)]
#[derive(Clone, PartialEq, Hash)]
pub struct Rle(pub ldls_core::Rle);

#[pymethods]
impl Rle {
    #[staticmethod]
    fn from_runs(
        py: Python<'_>,
        height: usize,
        width: usize,
        runs: PyReadonlyArray1<'_, u32>,
    ) -> PyResult<Self> {
        let runs = slice(py, "counts", &runs)?.to_vec();
        run_at_once(py, || ldls_core::Rle::from_runs(height, width, runs)).map(Self)
    }

    #[staticmethod]
    fn from_compressed(
        py: Python<'_>,
        height: usize,
        width: usize,
        counts: &[u8],
    ) -> PyResult<Self> {
        run_at_once(py, || {
            ldls_core::Rle::from_compressed(height, width, counts)
        })
        .map(Self)
    }

    #[staticmethod]
    fn from_polygons(
        py: Python<'_>,
        height: usize,
        width: usize,
        polygons: Vec<Vec<f64>>,
    ) -> PyResult<Self> {
        run_here(py, || {
            ldls_core::Rle::from_polygons(height, width, &polygons)
        })
        .map(Self)
    }

    #[staticmethod]
    fn from_pixels(py: Python<'_>, pixels: PyReadonlyArray2<'_, bool>) -> PyResult<Self> {
        let [height, width] = [pixels.shape()[0], pixels.shape()[1]];
        let pixels = slice(py, "mask", &pixels)?;
        run_here(py, || ldls_core::Rle::from_pixels(height, width, pixels)).map(Self)
    }

    /// For pickling and copying.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, RunLengths)> {
        let make = slf.get_type().getattr("from_runs")?;
        let rle = slf.get();
        Ok((make, (rle.height(), rle.width(), rle.runs(slf.py()))))
    }

    #[getter]
    fn height(&self) -> usize {
        self.0.height()
    }

    #[getter]
    fn width(&self) -> usize {
        self.0.width()
    }

    #[getter]
    fn area(&self) -> usize {
        self.0.area()
    }

    #[getter]
    fn bounding_box(&self) -> (usize, usize, usize, usize) {
        self.0.bounding_box().into()
    }

    fn to_compressed<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.to_compressed())
    }

    fn grow(&self, py: Python<'_>, radius: usize) -> PyResult<Self> {
        run_here(py, || Ok(self.0.grow(radius))).map(Self)
    }

    fn shrink(&self, py: Python<'_>, radius: usize) -> PyResult<Self> {
        run_here(py, || Ok(self.0.shrink(radius))).map(Self)
    }

    fn union(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        run_here(py, || Ok(self.0.union(&other.0))).map(Self)
    }

    fn difference(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        run_here(py, || Ok(self.0.difference(&other.0))).map(Self)
    }

    fn runs(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.0.runs().to_vec().into_pyarray(py).unbind()
    }

    fn crop(
        &self,
        py: Python<'_>,
        top: usize,
        left: usize,
        height: usize,
        width: usize,
    ) -> PyResult<Py<PyArray2<bool>>> {
        let pixels = run_here(py, || self.0.crop([top, left, height, width]))?;
        if width == 0 {
            return Ok(PyArray2::zeros(py, [height, width], false).unbind());
        }
        matrix(py, pixels, width)
    }
}

/// The masks of one image.
#[pyclass(frozen, eq, module = "ldls._ldls")]
#[derive(PartialEq)]
pub struct Masks(pub ldls_core::InstanceMasks);

#[pymethods]
impl Masks {
    #[new]
    fn new(
        py: Python<'_>,
        height: usize,
        width: usize,
        masks: Vec<PyRef<'_, Rle>>,
    ) -> PyResult<Self> {
        let masks = masks.iter().map(|mask| mask.0.clone()).collect();
        run_here(py, || ldls_core::InstanceMasks::new(height, width, masks)).map(Self)
    }

    /// For pickling and copying.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (usize, usize, Vec<Rle>)) {
        let masks = &slf.get().0;
        let rles = masks.masks().iter().cloned().map(Rle).collect();
        (slf.get_type(), (masks.height(), masks.width(), rles))
    }

    #[getter]
    fn height(&self) -> usize {
        self.0.height()
    }

    #[getter]
    fn width(&self) -> usize {
        self.0.width()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn areas(&self) -> Vec<usize> {
        self.0.masks().iter().map(ldls_core::Rle::area).collect()
    }

    fn paint(
        &self,
        py: Python<'_>,
        mut pixels: PyReadwriteArray3<'_, bool>,
        threads: Option<usize>,
    ) -> PyResult<()> {
        let pixels = pixels
            .as_slice_mut()
            .map_err(|error| raise(py, "InputError", &format!("pixels: {error}")))?;
        run(py, threads, |_| self.0.paint(pixels))
    }

    fn rle(&self, index: usize) -> PyResult<Rle> {
        let mask = self
            .0
            .masks()
            .get(index)
            .ok_or_else(|| PyIndexError::new_err("no such mask"))?;
        Ok(Rle(mask.clone()))
    }
}
