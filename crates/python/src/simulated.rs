//! Excitation signals, and three simulations: a described experiment, the response to a force by a
//! time-stepping scheme, and the exact response to a force that is constant or linear between its
//! samples.

use std::path::{Path, PathBuf};

use mechid::SimulateError;
use mechid::estimate::EstimateError;
use mechid::excitation::{ExcitationDesign, ExcitationLevel};
use mechid::io::{Experiment, IoError, LineSpec};
use mechid::model::{Discretisation, InitialState, Response, ResponseQuantity};
use mechid::signal::{Extent, Phases, Record, Sampling, SignalError};
use nalgebra::DVector;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::{self, Named};
use crate::machine::Machine;
use crate::{failure, work};

/// Record of a simulated experiment: scheme, sampling rate, machine (`None` for a sparse machine),
/// then force and responses with noise, then force and responses without noise.
type Simulated<'py> = (String, f64, Option<Machine>, Channels<'py>, Channels<'py>);

/// Samples of the force, and for each kind of response its name and samples.
type Channels<'py> = (Bound<'py, PyArray2<f64>>, Vec<Named<'py>>);

/// Reads a described experiment from a JSON text or, without a text, from a JSON file. For a text,
/// `file` is its name in messages. In a JSON file, the names of other files are relative to its
/// folder.
pub fn described(file: &Path, text: Option<&str>) -> Result<Experiment, IoError> {
    match text {
        Some(text) => Experiment::parse(file.display().to_string(), text),
        None => Experiment::read(file),
    }
}

/// Simulates a described experiment: a JSON file, or a name and a JSON text.
#[pyfunction]
#[pyo3(signature = (file, text, memory_gb))]
pub fn simulate<'py>(
    py: Python<'py>,
    file: PathBuf,
    text: Option<&str>,
    memory_gb: Option<f64>,
) -> PyResult<Simulated<'py>> {
    let experiment = work::brief(py, || described(&file, text))?.with_memory_gb(memory_gb);
    let run = work::watched(py, None, || Ok(()), move || mechid::simulate(&experiment))?;
    let fs = run.force.sampling().rate_hz();
    let machine = run.system.dense().map(|s| Machine(mechid::Machine::known(s.clone())));
    let measured = (arrays::record(py, run.measured_force)?, responses(py, run.measured_response)?);
    let truth = (arrays::record(py, run.force)?, responses(py, run.response)?);
    Ok((run.scheme, fs, machine, measured, truth))
}

/// Computes the response of a described machine to a force of samples × degrees of freedom, with
/// the scheme of the description.
#[pyfunction]
pub fn integrate<'py>(
    py: Python<'py>,
    description: &str,
    force: PyReadonlyArray2<'_, f64>,
    fs: f64,
) -> PyResult<Vec<Named<'py>>> {
    let experiment = work::brief(py, || Experiment::parse("the description", description))?;
    let force = arrays::copied(&force);
    let step = move || -> Result<Response, SimulateError> {
        let sampling = Sampling::from_rate_hz(fs, force.nrows())?;
        mechid::respond(&experiment, &Record::new(sampling, force)?)
    };
    responses(py, work::watched(py, None, || Ok(()), step)?)
}

/// Computes the exact response of a machine to a force that is constant or linear between its
/// samples. `between_samples` states which, and `extent` states whether the force is an open record
/// or one whole period; both are JSON.
#[pyfunction]
#[pyo3(signature = (machine, force, fs, between_samples, extent, start))]
pub fn predict<'py>(
    py: Python<'py>,
    machine: PyRef<'_, Machine>,
    force: PyReadonlyArray2<'_, f64>,
    fs: f64,
    between_samples: &str,
    extent: &str,
    start: Option<(PyReadonlyArray1<'_, f64>, PyReadonlyArray1<'_, f64>)>,
) -> PyResult<Vec<Named<'py>>> {
    let between: Discretisation = failure::settings(py, between_samples)?;
    let extent: Extent = failure::settings(py, extent)?;
    let (system, force) = (machine.0.system().clone(), arrays::copied(&force));
    let vector = |given: PyReadonlyArray1<'_, f64>| DVector::from_vec(given.as_array().to_vec());
    let start = start.map(|(x, v)| (vector(x), vector(v)));
    let step = move || -> Result<Response, EstimateError> {
        let sampling = Sampling::from_rate_hz(fs, force.nrows())?;
        let start = match start {
            Some((x, v)) => InitialState::new(x, v)?,
            None => InitialState::rest(system.dof()),
        };
        mechid::estimate::predict(&system, &Record::new(sampling, force)?, between, extent, &start)
    };
    responses(py, work::watched(py, None, || Ok(()), step)?)
}

/// Sampled multisine: the samples of one period; the numbers, amplitudes and phases of its lines;
/// then its RMS value, its peak including the values between samples, and its crest factor.
type Sampled<'py> = (
    Bound<'py, PyArray1<f64>>,
    Vec<usize>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    (f64, f64, f64),
);

/// Creates a multisine whose phases follow a law, or are optimised for a low crest factor. `search`
/// has the number of starting points and the seed; `level` has a quantity (`amplitude`, `rms` or
/// `peak`) and its value.
#[pyfunction]
pub fn multisine<'py>(
    py: Python<'py>,
    samples: usize,
    fs: f64,
    lines: &str,
    phases: &str,
    search: (usize, u64),
    level: (&str, f64),
) -> PyResult<Sampled<'py>> {
    let ((starts, seed), (quantity, level)) = (search, level);
    let lines: LineSpec = work::brief(py, || lines.parse())?;
    let law = match phases {
        "schroeder" => Phases::Schroeder,
        "schroeder-binary" => Phases::SchroederBinary,
        "random" => Phases::Random { seed },
        _ => Phases::Zero,
    };
    let sampling = work::brief(py, || Sampling::from_rate_hz(fs, samples))?;
    let chosen = work::brief(py, || lines.lines(sampling))?;
    let (amplitude, level) = match quantity {
        "rms" => (1.0, Some(ExcitationLevel::Rms(level))),
        "peak" => (1.0, Some(ExcitationLevel::Peak(level))),
        _ => (level, None),
    };
    let flat = ExcitationDesign::flat(chosen, law);
    let design = ExcitationDesign { amplitude, level, starts, seed, ..flat };
    let make = move || -> Result<_, SignalError> {
        let made = design.inputs(sampling)?.swap_remove(0);
        let measures =
            (made.multisine.rms(), made.multisine.peak(), made.multisine.crest_factor()?);
        Ok((made.multisine, made.period.channel(0).to_vec(), measures))
    };
    let (made, period, measures) = work::watched(py, None, || Ok(()), make)?;
    let vector = |values: &[f64]| arrays::vector(py, values.to_vec());
    let (amplitudes, phases) = (vector(made.amplitudes()), vector(made.phases()));
    Ok((vector(&period), made.lines().to_vec(), amplitudes, phases, measures))
}

fn responses(py: Python<'_>, response: Response) -> PyResult<Vec<Named<'_>>> {
    let kinds = ResponseQuantity::ALL.into_iter();
    arrays::responses(py, kinds.zip(response.into_records()).collect())
}
