//! Core errors as the exception classes of `ldls.errors`.

use ldls_core::Error;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

/// The exception of `ldls.errors` that stands for `error`, or `MemoryError`.
pub fn to_python(py: Python<'_>, error: &Error) -> PyErr {
    let message = error.to_string();
    match class_name(error) {
        Some(name) => raise(py, name, &message),
        None => out_of_memory(&message),
    }
}

/// What the core found, or its error as an exception.
pub fn or_raise<T>(py: Python<'_>, found: ldls_core::Result<T>) -> PyResult<T> {
    found.map_err(|error| to_python(py, &error))
}

/// A `MemoryError`.
pub fn out_of_memory(message: &str) -> PyErr {
    PyMemoryError::new_err(message.to_owned())
}

/// An instance of the class `name` of `ldls.errors`.
pub fn raise(py: Python<'_>, name: &str, message: &str) -> PyErr {
    let exception = py
        .import("ldls.errors")
        .and_then(|module| module.getattr(name))
        .and_then(|class| class.call1((message,)));
    match exception {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// None for a lack of memory.
fn class_name(error: &Error) -> Option<&'static str> {
    Some(match error {
        Error::CoordinateOutOfRange { .. } => "InputError",
        Error::CameraNotFinite { .. }
        | Error::CameraSingular { .. }
        | Error::CameraNotRigid { .. }
        | Error::CameraLastRow { .. }
        | Error::CameraIntrinsic { .. }
        | Error::Distortion { .. } => "CalibrationError",
        Error::MaskSize { .. }
        | Error::RunSum { .. }
        | Error::RleString { .. }
        | Error::Polygon { .. } => "MaskError",
        Error::TooManyPoints { .. } | Error::TooManyInstances { .. } | Error::ImageSize { .. } => {
            "LimitError"
        }
        Error::Parameter { .. } => "ParameterError",
        Error::Mismatch { .. } => "ShapeError",
        // nobody is there to see it: the caller raises what made it cancel
        Error::Cancelled => "InternalError",
        Error::OutOfMemory { .. } => return None,
    })
}
