//! Conversion of failures to the exception `MechidError` of the Python package.

use std::error::Error;

use mechid::SimulateError;
use mechid::analysis::AnalysisError;
use mechid::estimate::EstimateError;
use mechid::integrate::IntegrateError;
use mechid::io::IoError;
use mechid::model::ModelError;
use mechid::report::ReportError;
use mechid::signal::SignalError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use rayon::ThreadPoolBuildError;
use serde::de::DeserializeOwned;

static EXCEPTION: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// Error of a library crate.
pub trait Failure: Error {
    /// Name of the crate, which identifies the layers of nested errors.
    const CRATE: &'static str;
}

impl Failure for AnalysisError {
    const CRATE: &'static str = "Analysis";
}

impl Failure for EstimateError {
    const CRATE: &'static str = "Estimate";
}

impl Failure for IntegrateError {
    const CRATE: &'static str = "Integrate";
}

impl Failure for IoError {
    const CRATE: &'static str = "Io";
}

impl Failure for ModelError {
    const CRATE: &'static str = "Model";
}

impl Failure for ReportError {
    const CRATE: &'static str = "Report";
}

impl Failure for SignalError {
    const CRATE: &'static str = "Signal";
}

impl Failure for SimulateError {
    const CRATE: &'static str = "Simulate";
}

/// Returns the exception for an error. The exception has the message, and a text with the crate,
/// the variant and all numbers; the Python class derives `code` and `fields` from this text.
pub fn exception<E: Failure>(py: Python<'_>, failure: &E) -> PyErr {
    raised(py, failure.to_string(), format!("{}({failure:?})", E::CRATE))
}

/// Returns the exception for a thread pool that cannot be created.
pub fn no_threads(py: Python<'_>, failure: &ThreadPoolBuildError) -> PyErr {
    raised(py, failure.to_string(), "Threads".into())
}

/// Returns the exception for a panic, which is always a defect of the library.
pub fn panicked(py: Python<'_>, message: &str) -> PyErr {
    raised(py, format!("internal error, please report it: {message}"), "Internal".into())
}

/// Reads settings from JSON.
///
/// # Errors
/// `MechidError` whose message names the invalid field.
pub fn settings<T: DeserializeOwned>(py: Python<'_>, json: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|wrong| {
        let message = wrong.to_string();
        // The caller did not write this JSON, so the position in it is removed from the message.
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        raised(py, message, "Settings".into())
    })
}

/// Returns the JSON of a result, as the program prints it.
///
/// # Errors
/// `MechidError` if the result has no JSON form.
pub fn json(py: Python<'_>, result: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string_pretty(result).map_err(|wrong| panicked(py, &wrong.to_string()))
}

fn raised(py: Python<'_>, message: String, variant: String) -> PyErr {
    match EXCEPTION.import(py, "mechid._errors", "MechidError") {
        Ok(class) => PyErr::from_type(class.clone(), (message, variant)),
        Err(missing) => missing,
    }
}
