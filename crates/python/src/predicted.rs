//! Response of a machine, or of modes, to the force of a record.

use mechid::Predict;
use mechid::model::{Response, ResponseQuantity};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::arrays::{self, Named};
use crate::machine::ForcedSystem;
use crate::measurement::Measurement;
use crate::{failure, work};

/// Predicted response, and its error relative to the measured response.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Predicted(mechid::Predicted);

/// Predicts the response of a machine or of modes to the force of a record; settings are JSON.
#[pyfunction]
pub fn predict_record(
    py: Python<'_>,
    record: PyRef<'_, Measurement>,
    system: ForcedSystem<'_>,
    settings: &str,
) -> PyResult<Predicted> {
    let how: Predict = failure::settings(py, settings)?;
    let record = record.0.clone();
    let predicted = match system {
        ForcedSystem::Machine(machine) => {
            let machine = machine.0.clone();
            let find = move || mechid::predict(&record, &machine, &how);
            work::watched(py, None, || Ok(()), find)
        }
        ForcedSystem::Modes(modes) => {
            let modes = modes.0.clone();
            let find = move || mechid::predict_with_modes(&record, &modes, &how);
            work::watched(py, None, || Ok(()), find)
        }
    };
    predicted.map(Predicted)
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

    /// Returns the predicted responses as columns of a record, with their names.
    fn columns<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyArray1<f64>>)> {
        let columns = self.0.columns().into_iter();
        columns.map(|(name, values)| (name, arrays::vector(py, values.to_vec()))).collect()
    }

    /// Returns the displacement, velocity and acceleration of a machine; an empty list for modes.
    fn responses<'py>(&self, py: Python<'py>) -> PyResult<Vec<Named<'py>>> {
        let of = |response: &Response| {
            ResponseQuantity::ALL.map(|kind| (kind, response.quantity(kind).clone())).into()
        };
        arrays::responses(py, self.0.response().map(of).unwrap_or_default())
    }
}
