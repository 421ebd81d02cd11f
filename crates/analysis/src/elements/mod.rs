//! Identification of a machine of named elements, with sensors anywhere.
//!
//! | File | What it does |
//! |---|---|
//! | `settings` | settings, as values |
//! | `data` | the data of a fit: spectral lines, their noise, and descriptions of both |
//! | `records` | lines of records: whole periods with their noise, or open records |
//! | `responses` | tables of frequency responses, of the machine and of its measured parts |
//! | `speeds` | tables of synchronous responses over the speed of the rotor |
//! | `notes` | notes on the numbers, as values |
//! | `summary`, `text` | the result: numbers, checks, notes; the same as text |
//! | `machine` | the identified machine with its covariance, for forces, predictions and modes |

mod data;
mod machine;
mod notes;
mod records;
mod responses;
mod settings;
mod speeds;
mod summary;
mod text;

use std::fmt;

use mechid_checks::Verdict;
use mechid_checks::limits::SIGNIFICANCE;
use mechid_estimate::likelihood::machine::{
    FreedCoefficient, MachineEstimate, identify_joined, identify_machine,
};
use serde::{Serialize, Serializer};

pub use self::data::{ElementData, TestKind, TestRow};
pub use self::notes::ElementNote;
pub use self::settings::IdentifyElements;
pub use self::summary::{CandidateRow, CombinationRow, ElementRow, ElementSummary, SensorRow};
use crate::identify::checks::{CheckRow, When};
use crate::machine::Machine;
use crate::{AnalysisError, time_limit};

/// Identifies the unknown coefficients of a machine of named elements by maximum likelihood.
///
/// # Errors
/// [`AnalysisError::Likelihood`] if the description does not make sense or no search ends at a
/// minimum, [`AnalysisError::Undetermined`] if the data determine none of the unknowns.
///
/// # Source
/// That of [`identify_machine`].
pub fn identify_elements(
    data: &ElementData,
    how: &IdentifyElements,
) -> Result<IdentifiedElements, AnalysisError> {
    time_limit::bounded(data.memory(), || fitted(data, how))
}

fn fitted(data: &ElementData, how: &IdentifyElements) -> Result<IdentifiedElements, AnalysisError> {
    let (machine, settings) = (&how.machine, how.likelihood(data));
    let (drawn, instruments) = (&machine.machine, &machine.instruments);
    let estimate = match &data.part {
        Some(part) => identify_joined(&data.lines, drawn, instruments, part, &settings)?,
        None => identify_machine(&data.lines, drawn, instruments, &settings)?,
    };
    let likelihood = &estimate.likelihood;
    let is_known = |p: &mechid_estimate::likelihood::ParameterEstimate| {
        p.at_bound || p.standard_error.is_some()
    };
    let determines_none = likelihood.combinations.iter().all(|c| c.determined.is_empty());
    if determines_none && !likelihood.parameters.iter().any(is_known) {
        let sentences: Vec<String> =
            likelihood.combinations.iter().map(ToString::to_string).collect();
        return Err(AnalysisError::Undetermined { combinations: sentences.join("; ") });
    }
    let checks = summary::checks(data, &estimate);
    let estimate = summary::allowing_for_parts(estimate, &checks, how.confidence);
    let (estimate, is_late) = summary::allowing_for_delay(estimate, &checks);
    let doubtful = if is_late { None } else { doubtful_known(data, how, &estimate, &checks) };
    let note = doubtful.as_ref().map(|known| ElementNote::doubtful_known(known, &estimate));
    let estimate = match doubtful {
        Some(known) => estimate.with_parameter_errors(&known.changes),
        None => estimate,
    };
    let mut summary = ElementSummary::new(data, &estimate, how, checks)?;
    summary.checks.extend(time_limit::check());
    summary.notes.extend(is_late.then_some(ElementNote::Delayed).into_iter().chain(note));
    Ok(IdentifiedElements { estimate, summary, spectrum: ElementSpectrum::new(data) })
}

/// Returns the known coefficient of the machine that the data contradict, if a check of the fit has
/// failed.
fn doubtful_known(
    data: &ElementData,
    how: &IdentifyElements,
    estimate: &MachineEstimate,
    checks: &[CheckRow],
) -> Option<FreedCoefficient> {
    let has_failed =
        |row: &CheckRow| row.when == When::After && row.finding.verdict() != Verdict::Good;
    checks.iter().any(has_failed).then_some(())?;
    let drawn = (&how.machine.machine, &how.machine.instruments);
    let settings = how.likelihood(data);
    let freed = estimate.freed_coefficient(&data.lines, drawn, data.part.as_ref(), &settings)?;
    (freed.p_value < SIGNIFICANCE).then_some(freed)
}

/// Identified coefficients of a machine, with the data of the fit.
///
/// [`Display`](fmt::Display) writes the result for people, `serde` for programs.
#[derive(Debug)]
pub struct IdentifiedElements {
    estimate: MachineEstimate,
    summary: ElementSummary,
    spectrum: ElementSpectrum,
}

/// Spectral lines of the data, for a plot of data and model.
#[derive(Debug, Clone)]
struct ElementSpectrum {
    frequency_hz: Vec<f64>,
    outputs: nalgebra::DMatrix<nalgebra::Complex<f64>>,
    rows: std::ops::Range<usize>,
}

impl ElementSpectrum {
    fn new(data: &ElementData) -> Self {
        let hz = |omega: &f64| omega / std::f64::consts::TAU;
        Self {
            frequency_hz: data.lines.omega().iter().map(hz).collect(),
            outputs: data.lines.outputs().clone(),
            rows: data.lines.records().first().map_or(0..0, |(rows, _)| rows.clone()),
        }
    }
}

/// Amplitudes of one sensor as functions of frequency, in the unit of the sensor: of the
/// measurement, of the model, and of the difference between both.
#[derive(Debug, Clone)]
pub struct SensorSpectrum {
    /// Name of the sensor.
    pub name: String,
    /// Unit of the amplitudes.
    pub unit: &'static str,
    /// Rising frequencies, in Hz, one for each amplitude.
    pub frequency_hz: Vec<f64>,
    /// Measured amplitudes, one per frequency, in the unit of the sensor.
    pub measured: Vec<f64>,
    /// Amplitudes of the model, one per frequency, in the unit of the sensor.
    pub modelled: Vec<f64>,
    /// Amplitudes of the difference between measurement and model, one per frequency, in the unit
    /// of the sensor.
    pub residual: Vec<f64>,
}

impl IdentifiedElements {
    /// Returns the numbers, checks and notes.
    pub fn summary(&self) -> &ElementSummary {
        &self.summary
    }

    /// Returns the estimate with its likelihood and covariance.
    pub fn estimate(&self) -> &MachineEstimate {
        &self.estimate
    }

    /// Returns M, C (with the gyroscopic matrix Ω G) and K with their covariance, for `force`,
    /// `predict` and `modes`.
    ///
    /// # Errors
    /// [`AnalysisError::Likelihood`] if a degree of freedom has no mass,
    /// [`AnalysisError::Undetermined`] if an entry is not determined, [`AnalysisError::Setting`] if
    /// too many entries are uncertain.
    pub fn machine(&self) -> Result<Machine, AnalysisError> {
        machine::machine(&self.estimate, self.summary.equations)
    }

    /// Returns measured and modelled amplitudes of every sensor on the lines of the first record.
    pub fn spectra(&self) -> Vec<SensorSpectrum> {
        let ElementSpectrum { frequency_hz, outputs, rows } = &self.spectrum;
        let mut order: Vec<usize> = rows.clone().collect();
        order.sort_by(|a, b| frequency_hz[*a].total_cmp(&frequency_hz[*b]));
        let errors = &self.estimate.errors;
        let of_sensor = |(at, sensor): (usize, &SensorRow)| SensorSpectrum {
            name: sensor.name.clone(),
            unit: sensor.unit,
            frequency_hz: order.iter().map(|row| frequency_hz[*row]).collect(),
            measured: order.iter().map(|row| outputs[(*row, at)].norm()).collect(),
            modelled: order
                .iter()
                .map(|row| (outputs[(*row, at)] - errors[(*row, at)]).norm())
                .collect(),
            residual: order.iter().map(|row| errors[(*row, at)].norm()).collect(),
        };
        self.summary.sensors.iter().enumerate().map(of_sensor).collect()
    }
}

impl fmt::Display for IdentifiedElements {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl Serialize for IdentifiedElements {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}
