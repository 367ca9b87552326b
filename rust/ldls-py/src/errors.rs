//! Core errors as the exception classes of `ldls.errors`.

use ldls_core::Error;
use pyo3::prelude::*;

/// The exception of `ldls.errors` that stands for `error`.
pub fn to_python(py: Python<'_>, error: &Error) -> PyErr {
    raise(py, class_name(error), &error.to_string())
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

fn class_name(error: &Error) -> &'static str {
    match error {
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
    }
}
