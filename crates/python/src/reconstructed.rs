//! Reconstruction of an unknown force.

use std::sync::Arc;

use mechid::Reconstruct;
use mechid::analysis::time_limit::within;
use mechid::signal::Record;
use nalgebra::{Complex, DMatrix};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::answer::{self, ResultOutput as _};
use crate::machine::ForcedSystem;
use crate::measurement::Measurement;
use crate::page::PageTexts;
use crate::{arrays, failure, work};

/// Reconstructed force, with the method and its settings.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Reconstructed(Arc<mechid::Reconstructed>);

/// Reconstructs the force that acted on a machine or on modes; settings are JSON.
#[pyfunction]
#[pyo3(signature = (record, system, settings, time_limit, threads))]
pub fn reconstruct(
    py: Python<'_>,
    record: PyRef<'_, Measurement>,
    system: ForcedSystem<'_>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Reconstructed> {
    let how: Reconstruct = failure::settings(py, settings)?;
    let record = record.0.clone();
    let force = match system {
        ForcedSystem::Machine(machine) => {
            let machine = machine.0.clone();
            let find = move || within(time_limit, || mechid::reconstruct(&record, &machine, &how));
            work::watched(py, threads, || Ok(()), find)
        }
        ForcedSystem::Modes(modes) => {
            let modes = modes.0.clone();
            let find =
                move || mechid::reconstruct_with_modes(&record, &modes, &how, &mut |_| Ok(()));
            let find = move || within(time_limit, find);
            work::watched(py, threads, || Ok(()), find)
        }
    };
    force.map(|force| Reconstructed(Arc::new(force)))
}

/// Frequencies, and complex amplitudes (frequencies × degrees of freedom).
type Lines<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<Complex<f64>>>);

#[pymethods]
impl Reconstructed {
    /// Returns the JSON that the program prints with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.0.json(py)
    }

    /// Returns the text that the program prints.
    fn text(&self) -> String {
        self.0.text()
    }

    /// Returns the figure that the program draws, as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        answer::svg(py, Arc::clone(&self.0))
    }

    /// Returns the figure as an interactive HTML page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        answer::html(py, Arc::clone(&self.0))
    }

    /// Returns the figure as a page with these texts.
    fn page(&self, py: Python<'_>, texts: PageTexts) -> PyResult<String> {
        answer::page(py, Arc::clone(&self.0), texts)
    }

    #[getter]
    fn force<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::record(py, self.0.force().record().clone())
    }

    #[getter]
    fn std_error<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let error: Option<&Record> = self.0.force().standard_error();
        error.map(|error| arrays::record(py, error.clone())).transpose()
    }

    /// Returns the frequencies in Hz, and the complex amplitudes of the force.
    fn spectrum<'py>(&self, py: Python<'py>) -> PyResult<Lines<'py>> {
        let spectrum = self.0.force().spectrum();
        let lines: Vec<usize> = match self.0.lines() {
            Some(lines) => lines.to_vec(),
            None => (0..spectrum.len()).collect(),
        };
        let frequencies = lines.iter().map(|n| spectrum.frequency_hz(*n)).collect();
        let amplitudes = DMatrix::from_fn(lines.len(), spectrum.channels(), |row, dof| {
            spectrum.line(lines[row], dof)
        });
        Ok((arrays::vector(py, frequencies), arrays::matrix(py, amplitudes)?))
    }
}
