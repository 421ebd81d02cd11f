//! Response of a known machine, linear or not, to a measured force.

use std::fmt;

use mechid_estimate::EstimateError;
use mechid_model::{InitialState, NonlinearSystem, Response, ResponseQuantity};
use mechid_nonlinear as nonlinear;
use mechid_nonlinear::ChannelPhase;
use mechid_signal::{Extent, Record, Sampling, measures, message};
use serde::{Deserialize, Serialize, Serializer};

use crate::AnalysisError;
use crate::identify::prediction::{channels, shown, steady_state};
use crate::machine::{Machine, NonlinearPart};
use crate::measurement::channels::ABSENT;
use crate::measurement::{Block, Measurement};
use crate::text::{paragraph, significant, text_table};

/// Settings of a prediction.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Predict {
    /// Number of initial samples of an open record that are used to estimate the initial state and
    /// excluded from the errors; `None`: the machine is at rest before the first sample.
    pub settle: Option<usize>,
}

/// A predicted response, and its difference from the measured response.
#[derive(Debug)]
pub struct Predicted {
    summary: PredictionSummary,
    motion: PredictedMotion,
}

/// Predicted time histories.
#[derive(Debug)]
pub(crate) enum PredictedMotion {
    /// Response of every degree of freedom of a machine.
    Machine(Response),
    /// Responses of a modal test, samples × columns.
    Modes { names: Vec<String>, record: Record },
}

/// Numbers of a prediction.
#[derive(Debug, Serialize)]
pub struct PredictionSummary {
    /// The record.
    pub file: String,
    /// The machine.
    pub machine: String,
    /// First sample predicted, counted from 1.
    pub first_sample: usize,
    /// Last sample predicted, counted from 1.
    pub last_sample: usize,
    /// First sample included in the errors, counted from 1.
    pub first_judged: usize,
    /// True for the steady state of whole periods.
    pub steady: bool,
    /// Errors of the measured channels.
    pub channels: Vec<PredictionError>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: Predict,
}

/// Error of one predicted channel.
#[derive(Debug, Serialize)]
pub struct PredictionError {
    /// Quantity that was measured.
    #[serde(serialize_with = "as_text")]
    pub quantity: ResponseQuantity,
    /// Degree of freedom, counted from 1.
    pub degree_of_freedom: usize,
    /// Name of the channel.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// RMS of the difference between measured and predicted response, in the unit `unit`.
    pub rmse: f64,
    /// RMSE over the RMS of the measured response about its mean (pure number).
    pub nrmse: f64,
    /// RMS of the errors due to the uncertainty of the modes, in `unit`; `None` for a machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
}

/// Predicts the response of a machine to the force of a record.
///
/// With a period, the prediction is the steady state under the mean period; otherwise it is the
/// response over the whole window. Between the samples the force is band-limited. Measured
/// responses, if there are any, are compared with the prediction; for a steady state, their means
/// are subtracted.
///
/// # Errors
/// [`AnalysisError::NoForce`], [`AnalysisError::DegreesOfFreedom`], [`AnalysisError::Setting`] if
/// `settle` cannot be used, and [`AnalysisError::Estimate`] if the response diverges or the record
/// is too coarse for the machine.
pub fn predict(
    measured: &Measurement,
    machine: &Machine,
    how: &Predict,
) -> Result<Predicted, AnalysisError> {
    let (block, steady) = (measured.whole_block()?, measured.window_settings().period.is_some());
    let (got, dofs) = (block.force.channels(), machine.system().dof());
    if measured.channels().force.is_empty() {
        return Err(AnalysisError::NoForce);
    }
    if got != dofs {
        return Err(AnalysisError::DegreesOfFreedom { file: block.file, got, dofs });
    }
    let NonlinearPart { uncertain, channels: phase, .. } = machine.with_terms()?;
    let system = uncertain.system();
    let settle = settle(how, measured, &block, steady)?;
    let response = match steady {
        true if block.responses().is_empty() => steady_from_rest(system, phase, &block)?,
        true => steady_state(system, phase, &block)?,
        false => open(system, phase, &block, settle)?,
    };
    let (mut errors, mut in_motion) = (Vec::new(), Vec::new());
    for (kind, seen) in block.responses() {
        let columns = measured.channels().response(kind);
        for dof in (0..dofs).filter(|dof| columns.get(*dof).is_some_and(|c| c != ABSENT)) {
            let (x, p) = (seen.channel(dof), channels(&response, kind).channel(dof));
            let name = block.names.response_name(kind, dof);
            let (x, p) = (&x[settle..], &p[settle..]);
            if !steady && settle == 0 && is_in_motion(x, p) {
                in_motion.push(name.clone());
            }
            errors.push(PredictionError::new((name, kind, dof), x, p, steady));
        }
    }
    let mut remarks = block.unit_notes();
    if !in_motion.is_empty() {
        remarks.push(format!(
            "the error of {} is largest at the beginning and decays: the machine was not at rest at the \
             first sample; `settle` fits its initial state",
            message::list(in_motion.iter(), ", ", 6)
        ));
    }
    let summary = PredictionSummary {
        file: block.file.clone(),
        machine: machine.name.clone(),
        first_sample: block.first_sample,
        last_sample: block.last_sample(),
        first_judged: block.first_sample + settle,
        steady,
        channels: errors,
        remarks,
        analysis: how.clone(),
    };
    Ok(Predicted::new(summary, PredictedMotion::Machine(response)))
}

/// Number of parts of a record; the first and the last are compared.
const PARTS: usize = 8;
/// Minimum ratio of the error in the first part to the error in the last part that indicates a
/// wrong initial state.
const MIN_DECAY_RATIO: f64 = 3.0;
/// Minimum number of samples in one of the [`PARTS`] parts of a record. It is also the number of
/// samples, from the first, whose largest error is the initial error.
const SHORTEST: usize = 16;
/// Minimum ratio of the largest initial error to the largest error of the record that indicates a
/// wrong initial state. The ratio is smaller for an inaccurate machine, because its error grows
/// with the response.
const MIN_INITIAL_SHARE: f64 = 0.5;

/// Returns whether the error of a channel decays from the beginning of a record, as a free response
/// does.
fn is_in_motion(measured: &[f64], predicted: &[f64]) -> bool {
    let error: Vec<f64> = measured.iter().zip(predicted).map(|(x, p)| x - p).collect();
    let part = error.len() / PARTS;
    if part < SHORTEST {
        return false;
    }
    let [first, last] = [&error[..part], &error[error.len() - part..]].map(measures::rms);
    let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, e| most.max(e.abs()));
    first > MIN_DECAY_RATIO * last
        && largest(&error[..SHORTEST]) > MIN_INITIAL_SHARE * largest(&error)
}

/// Returns the number of samples used to estimate the initial state; 0 for a start at rest.
fn settle(
    how: &Predict,
    measured: &Measurement,
    block: &Block,
    steady: bool,
) -> Result<usize, AnalysisError> {
    let wrong = |why: String| Err(AnalysisError::Setting { setting: "settle", why });
    let samples = settled_samples(how, block, steady)?;
    if samples == 0 {
        return Ok(0);
    }
    let measured_at_all = |kind: &ResponseQuantity| !measured.channels().response(*kind).is_empty();
    let kinds: Vec<_> = ResponseQuantity::ALL.into_iter().filter(measured_at_all).collect();
    let missing = |kind: &ResponseQuantity| {
        let columns = measured.channels().response(*kind);
        columns.iter().any(|column| column == ABSENT)
    };
    if kinds.is_empty() || kinds.iter().any(missing) {
        return wrong(
            "the fit of the initial state needs a measured response of every degree of freedom"
                .into(),
        );
    }
    Ok(samples)
}

/// Returns the number of samples at the beginning of a record to which the initial motion is
/// fitted; 0 for a start at rest.
pub(crate) fn settled_samples(
    how: &Predict,
    block: &Block,
    steady: bool,
) -> Result<usize, AnalysisError> {
    let wrong = |why: String| Err(AnalysisError::Setting { setting: "settle", why });
    let (Some(samples), len) = (how.settle, block.force.len()) else { return Ok(0) };
    if steady {
        return wrong(
            "whole periods are predicted as a steady state, which needs no initial state".into(),
        );
    }
    if (2..len).contains(&samples) {
        Ok(samples)
    } else {
        wrong(format!(
            "the fit of the initial state needs 2 to {} of the {len} samples of this record",
            len - 1
        ))
    }
}

/// Returns the response of an open record from rest, or from the initial state that fits its first
/// samples best.
fn open(
    system: &NonlinearSystem,
    phase: ChannelPhase,
    block: &Block,
    settle: usize,
) -> Result<Response, EstimateError> {
    let (force, _) = phase.correct(&block.force, &block.force)?;
    let start = match settle {
        0 => InitialState::rest(system.dof()),
        samples => {
            let mut first = Vec::new();
            for (kind, seen) in block.responses() {
                first.push((kind, phase.correct(seen, seen)?.1.window(0, samples)?));
            }
            let first: Vec<_> = first.iter().map(|(kind, record)| (*kind, record)).collect();
            nonlinear::fitted_start(system, &force.window(0, samples)?, &first)?
        }
    };
    shown(&nonlinear::predict(system, &force, Extent::Open, &start)?, phase, 1)
}

/// Returns the steady state for periods without measured responses, by a search that starts from
/// rest.
fn steady_from_rest(
    system: &NonlinearSystem,
    phase: ChannelPhase,
    block: &Block,
) -> Result<Response, EstimateError> {
    let force = block.force.period_mean(block.period)?;
    let (force, _) = phase.correct(&force, &force)?;
    let at_rest = InitialState::rest(system.dof());
    let steady = nonlinear::predict(system, &force, Extent::WholePeriod, &at_rest)?;
    shown(&steady, phase, block.periods)
}

impl PredictionError {
    pub(crate) fn new(
        (name, quantity, dof): (String, ResponseQuantity, usize),
        measured: &[f64],
        predicted: &[f64],
        without_mean: bool,
    ) -> Self {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let about = mean(measured);
        let apart = if without_mean { about - mean(predicted) } else { 0.0 };
        let error: Vec<f64> = measured.iter().zip(predicted).map(|(x, p)| x - p - apart).collect();
        let size: Vec<f64> = measured.iter().map(|x| x - about).collect();
        let (rmse, size) = (measures::rms(&error), measures::rms(&size));
        let (degree_of_freedom, unit) = (dof + 1, quantity.unit());
        let nrmse = rmse / size;
        Self { quantity, degree_of_freedom, name, unit, rmse, nrmse, standard_error: None }
    }

    /// Returns this prediction error with the field `standard_error` set: the RMS of the errors due
    /// to the uncertainty of the modes.
    pub(crate) fn with_standard_error(self, standard_error: f64) -> Self {
        Self { standard_error: Some(standard_error), ..self }
    }
}

impl Predicted {
    /// Returns the errors and the settings of the prediction.
    pub fn summary(&self) -> &PredictionSummary {
        &self.summary
    }

    pub(crate) fn new(summary: PredictionSummary, motion: PredictedMotion) -> Self {
        Self { summary, motion }
    }

    /// Returns displacement, velocity and acceleration of a machine (samples × degrees of freedom,
    /// in m, m/s and m/s²); `None` for modes.
    pub fn response(&self) -> Option<&Response> {
        match &self.motion {
            PredictedMotion::Machine(response) => Some(response),
            PredictedMotion::Modes { .. } => None,
        }
    }

    /// Returns the time axis.
    pub fn sampling(&self) -> Sampling {
        match &self.motion {
            PredictedMotion::Machine(response) => response.sampling(),
            PredictedMotion::Modes { record, .. } => record.sampling(),
        }
    }

    /// Returns the columns of a record of the prediction, with their names. For a machine these are
    /// all measured kinds of response (displacements if none was measured), in m, m/s or m/s². For
    /// modes they are the measured responses (all responses if none was measured).
    pub fn columns(&self) -> Vec<(String, &[f64])> {
        match &self.motion {
            PredictedMotion::Machine(response) => self.machine_columns(response),
            PredictedMotion::Modes { names, record } => {
                (0..).zip(names).map(|(at, name)| (name.clone(), record.channel(at))).collect()
            }
        }
    }

    fn machine_columns<'a>(&self, response: &'a Response) -> Vec<(String, &'a [f64])> {
        let measured = |kind: &ResponseQuantity| {
            self.summary.channels.iter().any(|channel| channel.quantity == *kind)
        };
        let mut kinds: Vec<_> = ResponseQuantity::ALL.into_iter().filter(measured).collect();
        if kinds.is_empty() {
            kinds.push(ResponseQuantity::Displacement);
        }
        let dofs = response.dof();
        let name = |kind: ResponseQuantity, dof: usize| match dofs {
            1 => kind.to_string(),
            _ => format!("{kind} {}", dof + 1),
        };
        let of = |kind: ResponseQuantity| {
            let record = channels(response, kind);
            (0..dofs).map(move |dof| (name(kind, dof), record.channel(dof)))
        };
        kinds.into_iter().flat_map(of).collect()
    }
}

impl fmt::Display for Predicted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PredictionSummary { file, machine, first_sample, last_sample, .. } = &self.summary;
        let kind = if self.summary.steady { "steady state" } else { "response" };
        writeln!(
            f,
            "{kind} of {machine} under the force of {file}, samples {first_sample} to {last_sample}"
        )?;
        let remarks = self.summary.remarks.iter().map(|remark| format!("note: {remark}"));
        if self.summary.channels.is_empty() {
            return f.write_str(&paragraph(remarks));
        }
        let from = self.summary.first_judged;
        let header = [&format!("error from sample {from} on"), "RMSE", "unit", "NRMSE"];
        let mut rows = vec![header.map(String::from).to_vec()];
        if self.summary.channels.iter().any(|channel| channel.standard_error.is_some()) {
            rows[0].push("± of the modes".into());
        }
        for channel in &self.summary.channels {
            rows.push(vec![
                channel.name.clone(),
                significant(channel.rmse, 4),
                channel.unit.into(),
                format!("{} %", significant(100.0 * channel.nrmse, 3)),
            ]);
            let error = channel.standard_error.map(|error| significant(error, 2));
            rows.last_mut().into_iter().for_each(|row| row.extend(error.clone()));
        }
        write!(f, "\n{}", text_table(&rows))?;
        f.write_str(&paragraph(remarks))
    }
}

impl Serialize for Predicted {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

fn as_text<S: Serializer>(value: &ResponseQuantity, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}
