//! Diffusion some products at a time, for `ldls.stages.diffuse`.

use crate::arrays::{CsrArguments, collected, graph, matrix, pixel_labels};
use crate::call::run;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::iter::repeat_n;

/// A diffusion on its way. One thread at a time may use it; others get a `RuntimeError` meanwhile.
#[pyclass(module = "ldls._ldls")]
pub struct Products {
    state: ldls_core::Products,
    n_labels: usize,
}

#[pymethods]
impl Products {
    #[new]
    fn new(
        py: Python<'_>,
        point_graph: CsrArguments<'_>,
        labels: CsrArguments<'_>,
        n_labels: usize,
        iterations: Option<usize>,
    ) -> PyResult<Self> {
        let a = graph(py, &point_graph)?;
        // nobody asks for it, but there is one for each row
        let rows = labels.0.as_array().len().saturating_sub(1);
        let mass = collected(py, repeat_n(0.0, rows))?;
        let b = pixel_labels(py, &labels, mass)?;
        let state = run(py, None, |cancel| {
            ldls_core::Products::new(a, b, n_labels, iterations, cancel)
        })?;
        Ok(Self { state, n_labels })
    }

    /// Runs so many products more, or as many as there are left; the likelihoods after them.
    fn advance(
        &mut self,
        py: Python<'_>,
        products: usize,
        threads: Option<usize>,
    ) -> PyResult<Py<PyArray2<f32>>> {
        let z = run(py, threads, |cancel| {
            self.state.advance(products, cancel)?;
            self.state.likelihoods(cancel)
        })?;
        matrix(py, z, self.n_labels)
    }

    /// True if none is left.
    #[getter]
    fn finished(&self) -> bool {
        self.state.is_finished()
    }
}
