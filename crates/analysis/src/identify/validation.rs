//! Prediction of a record by the identified system, and its fit to each channel in per cent.

use mechid_estimate::{StartFit, fit_percent, predict};
use mechid_model::Discretisation;
use mechid_model::ResponseQuantity;
use mechid_model::{InitialState, SecondOrderSystem};
use mechid_signal::{Extent, RunningStatistics, SignalError};
use serde::{Deserialize, Serialize};

use super::prediction::{Model, Prediction, channels, failed};
use crate::AnalysisError;
use crate::measurement::{CHUNK_SAMPLES, Hold, Window, Windowed};
use crate::text::{significant, text_table};

/// A predicted record.
#[derive(Debug, Serialize)]
pub struct Validation {
    /// The record.
    pub file: String,
    /// First sample, counted from 1.
    pub first_sample: usize,
    /// Last sample, counted from 1.
    pub last_sample: usize,
    /// Channels, one each.
    pub channels: Vec<Share>,
}

/// Predicted part of one channel.
#[derive(Debug, Serialize)]
pub struct Share {
    /// Quantity that was measured.
    pub quantity: String,
    /// Degree of freedom, counted from 1.
    pub degree_of_freedom: usize,
    /// Name of the channel.
    pub name: String,
    /// 100 (1 − ‖measured − predicted‖ / ‖measured − mean‖), in per cent: 100 is perfect, 0 as good
    /// as the mean, negative worse.
    pub fit_percent: f64,
}

/// Samples of a record to predict.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ValidationWindow {
    /// First sample, counted from 1; `None`: the first of the record.
    pub start: Option<usize>,
    /// Number of samples; `None`: all from `start` to the end.
    pub samples: Option<usize>,
}

impl ValidationWindow {
    /// Returns the window of a record to predict; `period` is the number of samples in a period of
    /// the fitted window.
    ///
    /// # Errors
    /// [`AnalysisError::ValidationPeriod`] if the samples do not cover a period of a steady state.
    pub(super) fn window(
        &self,
        period: Option<usize>,
        prediction: Prediction,
    ) -> Result<Window, AnalysisError> {
        let period = period.filter(|_| prediction == Prediction::Steady);
        let (period, periods) = match (period, self.samples) {
            (Some(period), Some(samples)) if samples < period => {
                return Err(AnalysisError::ValidationPeriod { samples, period });
            }
            (Some(period), samples) => (Some(period), samples.map(|samples| samples / period)),
            (None, samples) => (samples, Some(1)),
        };
        Ok(Window { start: self.start.unwrap_or(1), period, periods })
    }
}

/// Returns the part of a predicted window that must be in memory. An open record is predicted in
/// chunks, so it needs no more memory than a fitted record.
pub(super) fn hold(fitted: Hold, prediction: Prediction) -> Hold {
    match (fitted, prediction) {
        (Hold::Whole, _) => Hold::Whole,
        (_, Prediction::Sampled { extent: Extent::Open, .. }) => Hold::Samples(0),
        _ => Hold::Whole,
    }
}

impl Validation {
    /// Compares the predicted responses with the measured responses of a record.
    pub(crate) fn new(
        recorded: &Windowed,
        model: &Model,
        prediction: Prediction,
    ) -> Result<Self, AnalysisError> {
        let measured = &recorded.held;
        let mut shares = Vec::new();
        let mut add = |kind: ResponseQuantity, fits: Vec<f64>| {
            for (at, fit_percent) in fits.into_iter().enumerate() {
                let (quantity, name) = (kind.to_string(), measured.names.response_name(kind, at));
                shares.push(Share { quantity, degree_of_freedom: at + 1, name, fit_percent });
            }
        };
        match (prediction, model) {
            (
                Prediction::Sampled { discretisation, extent: Extent::Open },
                Model::Linear(system),
            ) => {
                let errors = in_stretches(recorded, system, discretisation)?;
                errors.into_iter().for_each(|(kind, fits)| add(kind, fits));
            }
            _ => {
                for compared in prediction.predict(model, measured)? {
                    add(compared.kind, fit_percent(&compared.measured, &compared.predicted)?);
                }
            }
        }
        Ok(Self {
            file: measured.file.clone(),
            first_sample: measured.first_sample,
            last_sample: measured.last_sample(),
            channels: shares,
        })
    }

    /// Returns the result as text for a reader.
    pub fn text(&self) -> String {
        let (first, last) = (self.first_sample, self.last_sample);
        let mut rows = vec![vec![
            format!("prediction of {}, samples {first} to {last}", self.file),
            "fit".into(),
        ]];
        for share in &self.channels {
            let fit = format!("{} %", significant(share.fit_percent, 4));
            rows.push(vec![share.name.clone(), fit]);
        }
        text_table(&rows)
    }
}

/// Returns the predicted part of each response of an open record, in per cent. The first pass
/// estimates the initial state, the second predicts from it.
fn in_stretches(
    recorded: &Windowed,
    system: &SecondOrderSystem,
    discretisation: Discretisation,
) -> Result<Vec<(ResponseQuantity, Vec<f64>)>, AnalysisError> {
    let buffered = &recorded.held;
    let model = Model::Linear(system.clone());
    let failure = |reason| failed(reason, &model, buffered);
    let mut start = StartFit::new(system, discretisation)?;
    recorded.chunks(CHUNK_SAMPLES + 1, CHUNK_SAMPLES, &mut |chunk| {
        start.push(&chunk.force, &chunk.responses()).map_err(failure)
    })?;
    let mut state = start.start().map_err(failure)?;
    let motions = buffered.responses();
    let mut levels: Vec<_> =
        motions.iter().map(|(kind, _)| (*kind, vec![Level::default(); system.dof()])).collect();
    recorded.chunks(CHUNK_SAMPLES + 1, CHUNK_SAMPLES, &mut |chunk| {
        let response = predict(system, &chunk.force, discretisation, Extent::Open, &state);
        let response = response.map_err(failure)?;
        // The next chunk begins with the last sample of this one.
        let overlap = usize::from(chunk.first_sample > buffered.first_sample);
        for ((kind, levels), (_, measured)) in levels.iter_mut().zip(chunk.responses()) {
            for (c, level) in levels.iter_mut().enumerate() {
                let predicted = channels(&response, *kind).channel(c);
                level.add(&measured.channel(c)[overlap..], &predicted[overlap..])?;
            }
        }
        let row = |kind| channels(&response, kind).data().row(chunk.force.len() - 1).transpose();
        state = InitialState::new(
            row(ResponseQuantity::Displacement),
            row(ResponseQuantity::Velocity),
        )?;
        Ok(())
    })?;
    let fits = |levels: Vec<Level>| levels.iter().map(Level::fit_percent).collect();
    Ok(levels.into_iter().map(|(kind, levels)| (kind, fits(levels))).collect())
}

/// Power of a measured channel, and of the residual of its prediction.
#[derive(Debug, Clone, Default)]
struct Level {
    measured: RunningStatistics,
    /// Sum of the squares of the residual.
    residual_sum_of_squares: f64,
}

impl Level {
    fn add(&mut self, measured: &[f64], predicted: &[f64]) -> Result<(), SignalError> {
        self.residual_sum_of_squares +=
            measured.iter().zip(predicted).map(|(x, p)| (x - p).powi(2)).sum::<f64>();
        self.measured.push(measured)
    }

    fn fit_percent(&self) -> f64 {
        100.0
            * (1.0
                - self.residual_sum_of_squares.sqrt()
                    / self.measured.centred_sum_of_squares().sqrt())
    }
}
