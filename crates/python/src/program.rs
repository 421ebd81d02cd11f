//! The program `mechid`.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use pyo3::prelude::*;

/// Runs the program with these arguments, beginning with its name, and returns its exit code;
/// `python` is the interpreter that runs the program again for the records of a fleet.
#[pyfunction]
#[pyo3(signature = (arguments, python))]
pub fn program(py: Python<'_>, arguments: Vec<OsString>, python: Option<PathBuf>) -> u8 {
    if let Some(python) = python {
        mechid_cli::set_worker_program(python, &["-m", "mechid"]);
    }
    let code = py.detach(|| mechid_cli::run(arguments));
    (0..=u8::MAX).find(|number| ExitCode::from(*number) == code).unwrap_or(u8::MAX)
}
