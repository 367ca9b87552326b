//! Points of LAZ files, for `ldls.io.points.las`.

use crate::arrays::matrix;
use crate::call::run;
use crate::errors::raise;
use ldls_core::{Cancel, Error};
use ldls_laz::Points;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

/// Steps along x y z, row by row, and intensities.
type Columns = (Vec<i32>, Vec<u16>);
/// The same for Python.
type Arrays = (Py<PyArray2<i32>>, Py<PyArray1<u16>>);

/// Steps along x y z, (`n_points`, 3) int32, and intensities, (`n_points`,) uint16, of the points that are packed in
/// `file` from byte `offset` on, as the record `laszip` says.
#[pyfunction]
pub fn unpack_laz(
    py: Python<'_>,
    file: &[u8],
    offset: u64,
    laszip: &[u8],
    n_points: usize,
) -> PyResult<Arrays> {
    let found = run(py, Some(1), |cancel| {
        match Points::new(file, offset, laszip) {
            Ok(points) => unpacked(points, n_points, cancel),
            Err(error) => Ok(Err(error)),
        }
    })?;
    let (steps, intensities) =
        found.map_err(|error| raise(py, "CorruptFileError", &error.to_string()))?;
    Ok((matrix(py, steps, 3)?, intensities.into_pyarray(py).unbind()))
}

/// The next `n_points`. No memory is taken for points that are not there.
fn unpacked(
    mut points: Points<'_>,
    n_points: usize,
    cancel: &Cancel,
) -> ldls_core::Result<Result<Columns, ldls_laz::Error>> {
    let (mut steps, mut intensities) = (Vec::new(), Vec::new());
    while intensities.len() < n_points {
        cancel.check()?;
        let count = Cancel::ITEMS_A_LOOK.min(n_points - intensities.len());
        let bytes = (steps.len() + 3 * count) * size_of::<i32>();
        let room = steps.try_reserve(3 * count);
        room.and_then(|()| intensities.try_reserve(count))
            .map_err(|_| Error::OutOfMemory { bytes })?;
        let read = points.read(count, |position, intensity| {
            steps.extend(position);
            intensities.push(intensity);
        });
        if let Err(error) = read {
            return Ok(Err(error));
        }
    }
    Ok(Ok((steps, intensities)))
}
