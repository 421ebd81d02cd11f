//! Machines of named elements.

use std::path::Path;
use std::sync::Arc;

use mechid::analysis::AnalysisError;
use mechid::analysis::time_limit::within;
use mechid::io::parse_machine;
use mechid::{ElementData, IdentifyElements};
use pyo3::prelude::*;

use crate::machine::Machine;
use crate::measurement::Measurement;
use crate::page::PageTexts;
use crate::responses::ResponseTable;
use crate::{answer, arrays, failure, work};

/// Identified coefficients of a machine of named elements.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct IdentifiedElements(Arc<mechid::IdentifiedElements>);

/// Reads the description of a machine (its name in messages, its JSON, the folder of its matrices);
/// returns the settings of its identification, and the columns of its records, as JSON.
#[pyfunction]
pub fn described_machine(
    py: Python<'_>,
    name: &str,
    description: &str,
    folder: &str,
) -> PyResult<(String, String)> {
    let read = || -> Result<_, AnalysisError> {
        let how = IdentifyElements::new(parse_machine(name, description, Path::new(folder))?);
        let channels = match how.machine.instruments.speed {
            // Tables of results against the speed of rotation have no columns of samples.
            mechid::model::elements::Speed::Synchronous => mechid::Channels::default(),
            _ => how.channels()?,
        };
        Ok((how, channels))
    };
    let (how, channels) = work::brief(py, read)?;
    Ok((failure::json(py, &how)?, failure::json(py, &channels)?))
}

/// Identifies a machine from records, tables of frequency responses or tables over the speed (their
/// names and columns), and from the measured receptances of its parts; settings are JSON.
#[pyfunction]
#[pyo3(signature = (records, tables, speeds, parts, settings, time_limit, threads))]
#[allow(clippy::too_many_arguments, reason = "one argument for each kind of data and each limit")]
pub fn identify_elements(
    py: Python<'_>,
    records: Vec<PyRef<'_, Measurement>>,
    tables: Vec<PyRef<'_, ResponseTable>>,
    speeds: Vec<std::path::PathBuf>,
    parts: Vec<PyRef<'_, ResponseTable>>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<IdentifiedElements> {
    let how: IdentifyElements = failure::settings(py, settings)?;
    let records: Vec<mechid::Measurement> = records.iter().map(|record| record.0.clone()).collect();
    let owned = |tables: &[PyRef<'_, ResponseTable>]| -> Vec<mechid::io::FrequencyResponses> {
        tables.iter().map(|table| table.0.clone()).collect()
    };
    let (tables, parts) = (owned(&tables), owned(&parts));
    let find = move || -> Result<_, AnalysisError> {
        let data = if !tables.is_empty() {
            ElementData::from_responses(&tables, &how)?
        } else if !speeds.is_empty() {
            let read = speeds.iter().map(mechid::io::Table::read);
            ElementData::from_speeds(&read.collect::<Result<Vec<_>, _>>()?, &how)?
        } else {
            ElementData::from_records(&records, &how)?
        };
        let data = if parts.is_empty() { data } else { data.with_parts(&parts, &how)? };
        mechid::identify_elements(&data, &how)
    };
    let find = move || within(time_limit, find);
    let identified = work::watched(py, threads, || Ok(()), find)?;
    Ok(IdentifiedElements(Arc::new(identified)))
}

#[pymethods]
impl IdentifiedElements {
    /// Returns the JSON that the program prints with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        failure::json(py, &*self.0)
    }

    /// Returns the text that the program prints.
    fn text(&self) -> String {
        self.0.to_string()
    }

    /// Returns the figure that the program draws, as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        answer::svg(py, Arc::clone(&self.0))
    }

    /// Returns the figure as an interactive HTML page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        answer::html(py, Arc::clone(&self.0))
    }

    /// Returns the report that the program writes, as an HTML page.
    fn page(&self, py: Python<'_>, texts: PageTexts) -> PyResult<String> {
        answer::page(py, Arc::clone(&self.0), texts)
    }

    /// Returns the names of the unknowns, and their covariance.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<arrays::Covariance<'py>> {
        arrays::covariance(py, &self.0.summary().parameter_covariance)
    }

    /// Returns M, C and K with the covariance of their entries.
    fn machine(&self, py: Python<'_>) -> PyResult<Machine> {
        work::brief(py, || self.0.machine()).map(Machine)
    }
}
