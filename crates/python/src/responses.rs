//! Identification from frequency responses that were measured elsewhere.

use std::path::PathBuf;
use std::sync::Arc;

use mechid::analysis::Reading;
use mechid::analysis::time_limit::within;
use mechid::estimate::EstimateError;
use mechid::io::{AveragedSegments, CoherenceFunction, FrequencyResponses, ResponseFunction};
use mechid::{IdentifyResponses, ResponseQuantity};
use nalgebra::Complex;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::machine::Machine;
use crate::page::PageTexts;
use crate::{answer, arrays, failure, work};

/// Table of frequency responses.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct ResponseTable(pub FrequencyResponses);

/// Name of a table, measured quantity, and names of points and forces.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    name: String,
    quantity: Option<ResponseQuantity>,
    points: Vec<String>,
    forces: Vec<String>,
    segments: Option<[f64; 5]>,
}

#[pymethods]
impl ResponseTable {
    /// Reads a file of frequency responses. `memory_gb` is the maximum memory of their analysis, in
    /// GB.
    #[staticmethod]
    #[pyo3(signature = (path, memory_gb))]
    fn read(py: Python<'_>, path: PathBuf, memory_gb: Option<f64>) -> PyResult<Self> {
        let limits = Reading { memory_gb, ..Reading::default() }.limits();
        let read = move || FrequencyResponses::read_with(path, &limits);
        work::watched(py, None, || Ok(()), read).map(Self)
    }

    /// Copies responses (frequencies × points × forces), their standard errors, and coherences
    /// (frequencies × points); the layout is JSON.
    #[staticmethod]
    #[pyo3(signature = (layout, frequency_hz, response, std_error, coherence))]
    fn from_arrays(
        py: Python<'_>,
        layout: &str,
        frequency_hz: PyReadonlyArray1<'_, f64>,
        response: PyReadonlyArray3<'_, Complex<f64>>,
        std_error: Option<PyReadonlyArray3<'_, f64>>,
        coherence: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let Layout { name, quantity, points, forces, segments } = failure::settings(py, layout)?;
        let (response, errors) = (response.as_array(), std_error.as_ref().map(|e| e.as_array()));
        let lines = frequency_hz.as_array().len();
        let mut functions = Vec::new();
        for (i, point) in points.iter().enumerate() {
            for (j, force) in forces.iter().enumerate() {
                functions.push(ResponseFunction {
                    response: point.clone(),
                    reference: force.clone(),
                    quantity,
                    values: (0..lines).map(|line| response[(line, i, j)]).collect(),
                    standard_error: errors
                        .map(|errors| (0..lines).map(|line| errors[(line, i, j)]).collect()),
                });
            }
        }
        let of_point = |(i, point): (usize, &String)| {
            let coherence = coherence.as_ref()?.as_array();
            let values = (0..lines).map(|line| coherence[(line, i)]).collect();
            Some(CoherenceFunction { response: point.clone(), reference: None, values })
        };
        Ok(Self(FrequencyResponses {
            file: name,
            frequency_hz: frequency_hz.as_array().to_vec(),
            coherence: points.iter().enumerate().filter_map(of_point).collect(),
            functions,
            added_decay: None,
            segments: segments.and_then(AveragedSegments::from_numbers),
            remarks: Vec::new(),
            doubts: Vec::new(),
            memory: None,
        }))
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.file
    }

    /// Returns the quantity of all responses; `None` if the responses do not state their quantity.
    #[getter]
    fn quantity(&self) -> Option<String> {
        let mut stated = self.0.functions.iter().map(|function| function.quantity);
        let first = stated.next()??;
        stated.all(|other| other == Some(first)).then(|| first.to_string())
    }

    #[getter]
    fn frequencies(&self) -> usize {
        self.0.frequency_hz.len()
    }
}

/// Machine identified from tables of frequency responses.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct IdentifiedResponses(Arc<mechid::IdentifiedResponses>);

/// Identifies the machine from tables of frequency responses; settings are JSON.
#[pyfunction]
#[pyo3(signature = (tables, settings, time_limit, threads))]
pub fn identify_responses(
    py: Python<'_>,
    tables: Vec<PyRef<'_, ResponseTable>>,
    settings: &str,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<IdentifiedResponses> {
    let how: IdentifyResponses = failure::settings(py, settings)?;
    let tables: Vec<FrequencyResponses> = tables.iter().map(|table| table.0.clone()).collect();
    let find = move || within(time_limit, || mechid::identify_responses(&tables, &how));
    work::watched(py, threads, || Ok(()), find).map(|found| IdentifiedResponses(Arc::new(found)))
}

#[pymethods]
impl IdentifiedResponses {
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

    /// Returns the figure as a page with these texts.
    fn page(&self, py: Python<'_>, texts: PageTexts) -> PyResult<String> {
        answer::page(py, Arc::clone(&self.0), texts)
    }

    /// Returns the confidence interval of a parameter.
    fn interval(&self, py: Python<'_>, name: &str, level: f64) -> PyResult<[f64; 2]> {
        work::brief(py, || {
            Ok::<_, EstimateError>(self.0.estimate().parameter(name)?.interval(level)?)
        })
    }

    /// Returns the names of the estimated parameters, and their covariance.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<arrays::Covariance<'py>> {
        arrays::covariance(py, &self.0.covariance())
    }

    /// Returns the identified system with the covariance of its parameters.
    fn machine(&self, py: Python<'_>) -> PyResult<Machine> {
        work::brief(py, || self.0.machine()).map(Machine)
    }
}
