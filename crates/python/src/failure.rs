//! Failures as the exception `MechidError` of the Python package.

use std::error::Error;

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use serde::de::DeserializeOwned;

static EXCEPTION: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// Returns the exception for a failure: its message, and its variant with all numbers, from which the
/// Python class takes `code` and `fields`.
pub fn exception(py: Python<'_>, failure: &dyn Error) -> PyErr {
    raised(py, failure.to_string(), format!("{failure:?}"))
}

/// Returns the exception for a panic, which only a defect of the program causes.
pub fn panicked(py: Python<'_>, message: &str) -> PyErr {
    raised(py, format!("internal error, please report it: {message}"), "Internal".into())
}

/// Reads settings from JSON.
///
/// # Errors
/// `MechidError` that names the wrong field.
pub fn settings<T: DeserializeOwned>(py: Python<'_>, json: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|wrong| {
        let message = wrong.to_string();
        // The place in a text that the caller has not written helps nobody.
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        raised(py, message, "Settings".into())
    })
}

/// Returns the JSON of a result, as the program prints it.
///
/// # Errors
/// `MechidError` if it has no JSON form.
pub fn json(py: Python<'_>, result: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string_pretty(result).map_err(|wrong| exception(py, &wrong))
}

fn raised(py: Python<'_>, message: String, variant: String) -> PyErr {
    match EXCEPTION.import(py, "mechid._errors", "MechidError") {
        Ok(class) => PyErr::from_type(class.clone(), (message, variant)),
        Err(missing) => missing,
    }
}
