//! Response of a machine to the force of a record.

use mechid::Predict;
use mechid::model::{Response, ResponseQuantity};
use pyo3::prelude::*;

use crate::arrays::{self, Named};
use crate::machine::Machine;
use crate::measurement::Measurement;
use crate::{failure, work};

/// Predicted response, and its error relative to the measured one.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Predicted(mechid::Predicted);

/// Predicts the response of a machine to the force of a record; settings are JSON.
#[pyfunction]
pub fn predict_record(
    py: Python<'_>,
    record: PyRef<'_, Measurement>,
    machine: PyRef<'_, Machine>,
    settings: &str,
) -> PyResult<Predicted> {
    let how: Predict = failure::settings(py, settings)?;
    let (record, machine) = (record.0.clone(), machine.0.clone());
    let find = move || mechid::predict(&record, &machine, &how);
    work::watched(py, None, || Ok(()), find).map(Predicted)
}

#[pymethods]
impl Predicted {
    /// Returns the JSON that the program prints with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        failure::json(py, &self.0)
    }

    /// Returns the text that the program prints.
    fn text(&self) -> String {
        self.0.to_string()
    }

    /// Returns every kind of response.
    fn responses<'py>(&self, py: Python<'py>) -> PyResult<Vec<Named<'py>>> {
        let of = |response: &Response| {
            ResponseQuantity::ALL.map(|kind| (kind, response.quantity(kind).clone())).into()
        };
        arrays::responses(py, self.0.response().map(of).unwrap_or_default())
    }
}
