//! Response of modes to the forces of a record.

use std::f64::consts::TAU;

use mechid_force::within_band;
use mechid_signal::{Extent, Record, Sampling, Spectrum};
use nalgebra::{Complex, DMatrix};

use super::initial_motion::FreeMotion;
use super::system::{MeasuredChannel, ModalSystem};
use crate::AnalysisError;
use crate::limits::{REST_DECAY, REST_RECORDS};
use crate::measurement::{Block, Measurement};
use crate::predict::{
    Predict, Predicted, PredictedMotion, PredictionError, PredictionSummary, settled_samples,
};
use crate::text::significant;

/// Predicts the response of the modes of a test to the forces of a record, in the band of the
/// test.
///
/// With a period, the prediction is the steady state under the mean period. Otherwise it is the
/// response over the whole window, from rest or with the free motion that fits the first samples
/// (`settle`) best. There is no prediction outside the band, and measured responses are compared
/// within it. The standard error of a channel is the RMS of the errors due to the uncertainty of
/// the modes and of this free motion; the residual terms are assumed exact.
///
/// # Errors
/// [`AnalysisError::NoForce`], [`AnalysisError::Setting`] if the columns differ from those of the
/// modes, if no line of the record is in the band, or if `settle` cannot be used, and an error if
/// the record cannot be read.
///
/// # Source
/// Ewins, *Modal Testing*, 2nd ed. (2000), sections 5.2 and 6.2 (response of the modal sum).
pub fn predict_with_modes(
    measured: &Measurement,
    system: &ModalSystem,
    how: &Predict,
) -> Result<Predicted, AnalysisError> {
    let channels = &measured.source().names;
    if channels.force.is_empty() {
        return Err(AnalysisError::NoForce);
    }
    let inputs = system.inputs_of(&channels.force)?;
    let columns = system.outputs_of(channels)?;
    let (block, steady) = (measured.whole_block()?, measured.window_settings().period.is_some());
    let settle = settled_samples(how, &block, steady)?;
    let mut response = Response::new(system, &block, &inputs, steady)?;
    if settle > 0 {
        response.begin_in_motion(system, &block, &columns, settle)?;
    }
    let errors = response.errors(system, &block, &columns, steady, settle)?;
    let [low, high] = system.band_hz.map(|hz| significant(hz, 4));
    let mut remarks = block.unit_notes();
    remarks.push(format!(
        "the modes predict the response only from {low} to {high} Hz; the errors are computed in this band"
    ));
    if !steady && settle == 0 {
        remarks.push(
            "the prediction begins at rest: the prediction and the standard errors do not include initial \
             motion of the record; `settle` fits this motion to the first samples"
                .into(),
        );
    }
    let predicted: Vec<usize> = match columns.as_slice() {
        [] => (0..system.outputs.len()).collect(),
        some => some.iter().map(|(_, _, output)| *output).collect(),
    };
    let names = predicted.iter().map(|output| system.outputs[*output].0.clone()).collect();
    let data: Vec<&[f64]> = predicted.iter().map(|at| response.record.channel(*at)).collect();
    let motion = PredictedMotion::Modes {
        names,
        record: Record::from_channels(response.record.sampling(), &data)?,
    };
    let summary = PredictionSummary {
        file: block.file.clone(),
        machine: system.name.clone(),
        first_sample: block.first_sample,
        last_sample: block.last_sample(),
        first_judged: block.first_sample + settle,
        steady,
        channels: errors,
        remarks,
        analysis: how.clone(),
    };
    Ok(Predicted::new(summary, motion))
}

/// Response of all outputs.
struct Response {
    /// Samples × outputs.
    record: Record,
    /// RMS over the samples of the error that the uncertainty of the modes causes, one for each
    /// output.
    standard_error: Vec<f64>,
}

impl Response {
    fn new(
        system: &ModalSystem,
        block: &Block,
        inputs: &[usize],
        steady: bool,
    ) -> Result<Self, AnalysisError> {
        let len = block.force.len();
        let force = if steady {
            block.force.period_mean(block.period)?
        } else {
            followed_by_rest(system, &block.force)?
        };
        let spectrum = Spectrum::from_record(&force);
        let sampling = force.sampling();
        let outputs = system.outputs.len();
        let mut lines = DMatrix::zeros(spectrum.len(), outputs);
        let mut power = vec![0.0; outputs];
        let mut any = false;
        // The line at the Nyquist frequency, which exists if the number of samples is even, has no
        // phase and is skipped.
        for n in 0..sampling.len().div_ceil(2) {
            let (omega, [low, high]) = (spectrum.omega(n), system.band_hz);
            if !(low * TAU..=high * TAU).contains(&omega) {
                continue;
            }
            any = true;
            let mut forces = vec![Complex::default(); system.inputs.len()];
            for (column, input) in inputs.iter().enumerate() {
                forces[*input] = spectrum.line(n, column);
            }
            let vector = nalgebra::DVector::from_column_slice(&forces);
            lines.set_row(n, &(system.model.response(omega) * vector).transpose());
            for (sum, variance) in
                power.iter_mut().zip(system.model.response_variance(omega, &forces))
            {
                *sum += 0.5 * variance;
            }
        }
        if !any {
            let [low, high] = system.band_hz.map(|hz| significant(hz, 4));
            let why =
                format!("no line of the record is in the band of the modes, {low} to {high} Hz");
            return Err(AnalysisError::Setting { setting: "samples", why });
        }
        let motion = Spectrum::from_lines(sampling, lines)?.to_record()?;
        let record = if steady { repeated(&motion, block)? } else { motion.window(0, len)? };
        // `power` is the mean squared error over the record and the zeros that follow the record.
        // The factor `share` converts it to the mean over the record only.
        let share = if steady { 1.0 } else { sampling.len() as f64 / len as f64 };
        let standard_error = power.into_iter().map(|power| (power * share).sqrt()).collect();
        Ok(Self { record, standard_error })
    }

    /// Adds the free motion that explains the first samples of the measured channels best.
    fn begin_in_motion(
        &mut self,
        system: &ModalSystem,
        block: &Block,
        columns: &[MeasuredChannel],
        settle: usize,
    ) -> Result<(), AnalysisError> {
        if columns.is_empty() {
            let why =
                "the initial state is fitted to measured responses, but there are none".into();
            return Err(AnalysisError::Setting { setting: "settle", why });
        }
        let free = FreeMotion::fit(system, block, columns, &self.record, settle)?;
        self.record = Record::new(self.record.sampling(), self.record.data() + free.motion)?;
        for (error, more) in self.standard_error.iter_mut().zip(free.standard_error) {
            *error = error.hypot(more);
        }
        Ok(())
    }

    /// Returns the errors of the measured channels after the first `settle` samples, in the band of
    /// the modes.
    fn errors(
        &self,
        system: &ModalSystem,
        block: &Block,
        columns: &[MeasuredChannel],
        steady: bool,
        settle: usize,
    ) -> Result<Vec<PredictionError>, AnalysisError> {
        let extent = if steady { Extent::WholePeriod } else { Extent::Open };
        let in_band = |record: &Record, column: usize| {
            let values = record.channel(column).to_vec();
            let one = Record::from_channel(record.sampling(), values)?;
            Ok::<_, AnalysisError>(within_band(&one, system.band_hz, extent)?)
        };
        let mut errors = Vec::new();
        for (quantity, column, output) in columns {
            let kinds = block.responses();
            let Some((_, record)) = kinds.iter().find(|(kind, _)| kind == quantity) else {
                continue;
            };
            let measured = in_band(record, *column)?;
            let predicted = in_band(&self.record, *output)?;
            let name = (system.outputs[*output].0.clone(), *quantity, *output);
            let (measured, predicted) = (measured.channel(0), predicted.channel(0));
            let error =
                PredictionError::new(name, &measured[settle..], &predicted[settle..], steady);
            errors.push(error.with_standard_error(self.standard_error[*output]));
        }
        Ok(errors)
    }
}

/// Returns the forces followed by zeros, until the slowest mode has decayed, so that the end of the
/// response does not wrap around to its beginning.
fn followed_by_rest(system: &ModalSystem, force: &Record) -> Result<Record, AnalysisError> {
    let slowest = system.model.terms.iter().map(|term| -term.pole[0]).fold(f64::INFINITY, f64::min);
    let (len, rate_hz) = (force.len(), force.sampling().rate_hz());
    let decay = (REST_DECAY / slowest * rate_hz).ceil() as usize;
    let zeros = decay.clamp(len, REST_RECORDS * len);
    let sampling = Sampling::from_rate_hz(rate_hz, len + zeros)?;
    let mut data = DMatrix::zeros(len + zeros, force.channels());
    data.rows_mut(0, len).copy_from(force.data());
    Ok(Record::new(sampling, data)?)
}

/// Returns a period repeated as often as the window contains it.
fn repeated(period: &Record, block: &Block) -> Result<Record, AnalysisError> {
    let data = DMatrix::from_fn(block.force.len(), period.channels(), |k, column| {
        period.data()[(k % period.len(), column)]
    });
    Ok(Record::new(block.force.sampling(), data)?)
}
