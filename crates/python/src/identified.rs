//! Identification of a machine.

use std::sync::Arc;

use mechid::Identify;
use mechid::analysis::AnalysisError;
use mechid::analysis::identify::ValidationWindow;
use mechid::analysis::review::Review;
use mechid::analysis::review::receptance::ActingAlone;
use mechid::analysis::time_limit::within;
use mechid::estimate::EstimateError;
use mechid::report::page;
use nalgebra::{Complex, DMatrix};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::machine::Machine;
use crate::measurement::Measurement;
use crate::page::PageTexts;
use crate::{answer, arrays, failure, work};

/// Identified machine with the records of its identification.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Identified(pub Arc<mechid::Identified>);

/// Identifies the machine from the records; settings and the window for validation are JSON.
#[pyfunction]
#[pyo3(signature = (records, settings, validate, time_limit, threads))]
pub fn identify(
    py: Python<'_>,
    records: Vec<PyRef<'_, Measurement>>,
    settings: &str,
    validate: Option<(PyRef<'_, Measurement>, &str)>,
    time_limit: Option<f64>,
    threads: Option<usize>,
) -> PyResult<Identified> {
    let how: Identify = failure::settings(py, settings)?;
    let records: Vec<mechid::Measurement> = records.iter().map(|record| record.0.clone()).collect();
    let validate = match validate {
        Some((other, samples)) => {
            let samples: Samples = failure::settings(py, samples)?;
            Some((other.0.clone(), samples.into()))
        }
        None => None,
    };
    let find = move || -> Result<mechid::Identified, AnalysisError> {
        let mut identified = mechid::identify(&records, &how)?;
        if let Some((other, samples)) = validate {
            let validation = identified.validation_window(other, &samples)?;
            identified.add_validation(&validation)?;
        }
        Ok(identified)
    };
    let find = move || within(time_limit, find);
    work::watched(py, threads, || Ok(()), find).map(|identified| Identified(Arc::new(identified)))
}

/// Kind of a response, measured values and predicted values.
type Compared<'py> = (String, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Frequencies, force and displacement.
type Spectra<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<Complex<f64>>>,
    Bound<'py, PyArray2<Complex<f64>>>,
);

/// Samples of the record for validation.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Samples {
    start: Option<usize>,
    samples: Option<usize>,
}

impl From<Samples> for ValidationWindow {
    fn from(Samples { start, samples }: Samples) -> Self {
        Self { start, samples }
    }
}

#[pymethods]
impl Identified {
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
        let settings = texts.settings(py)?;
        let identified = Arc::clone(&self.0);
        work::watched(py, None, || Ok(()), move || page(&identified, &settings))
    }

    /// Returns the measured and predicted responses of the first record.
    fn compared<'py>(&self, py: Python<'py>) -> PyResult<Vec<Compared<'py>>> {
        let identified = Arc::clone(&self.0);
        let compared = work::watched(py, None, || Ok(()), move || identified.compared())?;
        let compared = compared.into_iter().map(|one| {
            let [measured, predicted] = [one.measured, one.predicted];
            Ok((
                one.kind.to_string(),
                arrays::record(py, measured)?,
                arrays::record(py, predicted)?,
            ))
        });
        compared.collect()
    }

    /// Returns the frequencies in rad/s, and the amplitudes of force and displacement on the fitted
    /// lines, in N and m.
    fn spectra<'py>(&self, py: Python<'py>) -> PyResult<Option<Spectra<'py>>> {
        let Some(data) = self.0.spectra() else { return Ok(None) };
        Ok(Some((
            arrays::vector(py, data.omega().to_vec()),
            arrays::matrix(py, data.force().clone())?,
            arrays::matrix(py, data.displacement().clone())?,
        )))
    }

    /// Returns the frequencies in rad/s, and the receptances (frequencies × motions · forces) in
    /// m/N: those measured (NaN on lines where the force does not act alone), and those of the
    /// identified system.
    fn receptances<'py>(&self, py: Python<'py>) -> PyResult<Spectra<'py>> {
        let identified = Arc::clone(&self.0);
        let compare = move || -> Result<_, AnalysisError> {
            let data = match identified.drawn_spectra() {
                Some(data) => data.clone(),
                None => match Review::new(&identified, false)?.receptance {
                    Ok(shown) => shown.data,
                    Err(_) => return Err(AnalysisError::NoReceptance),
                },
            };
            let (n, model) = (data.dof(), identified.estimate().system()?);
            let models = model.receptances(data.omega())?;
            // The receptances for a force on a degree of freedom are unknown if its equation has no
            // known scale.
            let unknown: &[usize] = match &identified.summary().unscaled {
                Some(unscaled) => &unscaled.degrees_of_freedom,
                None => &[],
            };
            let none = Complex::new(f64::NAN, f64::NAN);
            let acting = ActingAlone::new(&data);
            let measured = DMatrix::from_fn(data.len(), n * n, |row, at| match at % n {
                force if acting.on(row, force) => {
                    data.displacement()[(row, at / n)] / data.force()[(row, force)]
                }
                _ => none,
            });
            let model = DMatrix::from_fn(data.len(), n * n, |row, at| {
                if unknown.contains(&(at % n + 1)) { none } else { models[row][(at / n, at % n)] }
            });
            Ok((data.omega().to_vec(), measured, model))
        };
        let (omega, measured, model) = work::watched(py, None, || Ok(()), compare)?;
        Ok((arrays::vector(py, omega), arrays::matrix(py, measured)?, arrays::matrix(py, model)?))
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

    /// Predicts a record that was not fitted, and returns the comparison as JSON.
    fn validate(
        &self,
        py: Python<'_>,
        other: PyRef<'_, Measurement>,
        samples: &str,
    ) -> PyResult<String> {
        let samples: Samples = failure::settings(py, samples)?;
        let (identified, other) = (Arc::clone(&self.0), other.0.clone());
        let predict = move || {
            let window = identified.validation_window(other, &samples.into())?;
            identified.validate(&window)
        };
        failure::json(py, &work::watched(py, None, || Ok(()), predict)?)
    }
}
