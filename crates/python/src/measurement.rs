//! Measured forces and responses.

use mechid::analysis::{RecordPlan, Window};
use mechid::io::{IoError, Table, TimeAxis};
use mechid::signal::Sampling;
use mechid::{Channels, analysis::AnalysisError};
use numpy::{PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::arrays::{self, Named};
use crate::{failure, work};

/// Returns the index, counted from 0, of the column with this name, with or without its unit;
/// `None` if there is none.
#[pyfunction]
pub fn find_column(py: Python<'_>, names: Vec<String>, wanted: &str) -> PyResult<Option<usize>> {
    let columns = names.into_iter().map(|name| (name, vec![0.0]));
    let table = Table::from_columns("the table", columns);
    work::brief(py, || match table.find(wanted) {
        Ok(at) => Ok(Some(at)),
        Err(IoError::MissingColumn { .. }) => Ok(None),
        Err(error) => Err(error),
    })
}

/// Returns the index, counted from 0, of the first column that is called time.
#[pyfunction]
pub fn time_column(names: Vec<String>) -> Option<usize> {
    let columns = names.iter().map(|name| (name.clone(), vec![0.0]));
    let table = Table::from_columns("the table", columns);
    let time = table.time_column()?;
    names.iter().position(|name| name == time)
}

/// Returns the sampling rate, in Hz, from equally spaced instants. `name` is the name of their
/// column; it states their unit.
#[pyfunction]
pub fn rate_of(py: Python<'_>, name: &str, instants: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
    let values = instants.as_array().to_vec();
    let table = Table::from_columns("the table", [(name.to_owned(), values)]);
    work::brief(py, || Ok::<_, IoError>(table.sampling(&TimeAxis::Column("1"), &["1"])?.rate_hz()))
}

/// Forces and responses of a machine, from a file or from arrays, and the window to use.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Measurement(pub mechid::Measurement);

#[pymethods]
impl Measurement {
    /// Opens the file of a saved plan (JSON).
    #[staticmethod]
    fn open(py: Python<'_>, plan: &str) -> PyResult<Self> {
        let plan: RecordPlan = failure::settings(py, plan)?;
        work::watched(py, None, || Ok(()), move || plan.open()).map(Self)
    }

    /// Copies named columns; channels and window are JSON.
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        name: &str,
        rate_hz: f64,
        columns: Vec<(String, PyReadonlyArray1<'_, f64>)>,
        channels: &str,
        window: &str,
    ) -> PyResult<Self> {
        let channels: Channels = failure::settings(py, channels)?;
        let window: Window = failure::settings(py, window)?;
        let copied = columns.into_iter().map(|(name, values)| (name, values.as_array().to_vec()));
        let columns: Vec<(String, Vec<f64>)> = copied.collect();
        work::brief(py, || {
            let len = columns.first().map_or(0, |(_, values)| values.len());
            let sampling = Sampling::from_rate_hz(rate_hz, len)?;
            let named: Vec<(&str, &[f64])> =
                columns.iter().map(|(name, values)| (name.as_str(), values.as_slice())).collect();
            let whole = mechid::Measurement::from_columns(sampling, &named, &channels)?;
            whole.named(name).window(window)
        })
        .map(Self)
    }

    /// Returns the same record with another window (JSON).
    fn window(&self, py: Python<'_>, window: &str) -> PyResult<Self> {
        let window: Window = failure::settings(py, window)?;
        let whole = self.0.clone();
        work::brief(py, || whole.window(window)).map(Self)
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn samples(&self) -> usize {
        self.0.sampling().len()
    }

    #[getter]
    fn fs(&self) -> f64 {
        self.0.sampling().rate_hz()
    }

    /// Returns the window as JSON.
    #[getter]
    fn window_settings(&self, py: Python<'_>) -> PyResult<String> {
        failure::json(py, self.0.window_settings())
    }

    /// Returns the columns as JSON.
    #[getter]
    fn channels(&self, py: Python<'_>) -> PyResult<String> {
        failure::json(py, self.0.channels())
    }

    /// Returns the saved plan as JSON; `None` if the data are arrays.
    #[getter]
    fn plan(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.0.plan().map(|plan| failure::json(py, &plan)).transpose()
    }

    /// Reads the forces of the window.
    fn force<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let record = self.0.clone();
        let force = work::watched(py, None, || Ok(()), move || record.force())?;
        arrays::record(py, force)
    }

    /// Reads every measured kind of response (displacement, velocity, acceleration) of the window.
    fn responses<'py>(&self, py: Python<'py>) -> PyResult<Vec<Named<'py>>> {
        let record = self.0.clone();
        let read = move || -> Result<_, AnalysisError> { record.responses() };
        arrays::responses(py, work::watched(py, None, || Ok(()), read)?)
    }
}
