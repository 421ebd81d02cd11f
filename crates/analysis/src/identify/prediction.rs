//! The response of the identified system to a measured force.

use mechid_estimate::{EstimateError, fitted_start, predict, predict_periodic};
use mechid_model::Discretisation;
use mechid_model::ResponseQuantity;
use mechid_model::{InitialState, NonlinearSystem, Response, SecondOrderSystem};
use mechid_nonlinear as nonlinear;
use mechid_nonlinear::ChannelPhase;
use mechid_signal::{Extent, Record, Spectrum};
use nalgebra::{Complex, DVector};

use crate::AnalysisError;
use crate::measurement::Block;

/// Kind of prediction of a record, consistent with the fit that identified the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prediction {
    /// Steady state under whole periods of a band-limited force, means subtracted.
    Steady,
    /// Simulation that computes each sample from the previous sample.
    Sampled {
        /// Assumption on the force between samples.
        discretisation: Discretisation,
        /// Extent of the window.
        extent: Extent,
    },
}

/// System that predicts a response.
#[derive(Debug, Clone, PartialEq)]
pub enum Model {
    /// M, C and K alone.
    Linear(SecondOrderSystem),
    /// M, C and K with nonlinear terms.
    Nonlinear {
        /// The system.
        system: NonlinearSystem,
        /// Delay and phase of the channels.
        channels: ChannelPhase,
    },
}

impl Model {
    /// Returns M, C and K.
    pub fn linear(&self) -> &SecondOrderSystem {
        match self {
            Self::Linear(system) => system,
            Self::Nonlinear { system, .. } => system.linear(),
        }
    }
}

/// One kind of response, measured and predicted.
#[derive(Debug)]
pub struct Compared {
    /// Kind of response.
    pub kind: ResponseQuantity,
    /// Names of the channels, one per degree of freedom.
    pub names: Vec<String>,
    /// Measured response, samples × degrees of freedom.
    pub measured: Record,
    /// Predicted response, samples × degrees of freedom.
    pub predicted: Record,
}

impl Prediction {
    /// Returns the measured and the predicted responses for the buffered part of the record. The
    /// prediction of an open record starts from the state that fits the record best.
    pub(crate) fn predict(
        self,
        model: &Model,
        measured: &Block,
    ) -> Result<Vec<Compared>, AnalysisError> {
        let motions = measured.responses();
        let names =
            |kind, dofs| (0..dofs).map(|dof| measured.names.response_name(kind, dof)).collect();
        let response =
            self.response(model, measured).map_err(|reason| failed(reason, model, measured))?;
        let compared = |(kind, record): (ResponseQuantity, &Record)| {
            let (measured, predicted) = (record.clone(), channels(&response, kind).clone());
            let names = names(kind, measured.channels());
            match self {
                // The means are subtracted, because transducers have offsets, and the fit of a
                // spectrum excludes the mean.
                Prediction::Steady => Compared {
                    kind,
                    names,
                    measured: measured.without_mean(),
                    predicted: predicted.without_mean(),
                },
                Prediction::Sampled { .. } => Compared { kind, names, measured, predicted },
            }
        };
        Ok(motions.into_iter().map(compared).collect())
    }

    fn response(self, model: &Model, measured: &Block) -> Result<Response, EstimateError> {
        let system = match model {
            Model::Linear(system) => system,
            Model::Nonlinear { system, channels } => {
                return match self {
                    Prediction::Steady => steady_state(system, *channels, measured),
                    Prediction::Sampled { .. } => from_fitted_start(system, measured),
                };
            }
        };
        let (force, rest) = (&measured.force, InitialState::rest(system.dof()));
        match self {
            Prediction::Steady => predict_periodic(system, force),
            // Only the first part of a long period is in memory, and this part is not periodic.
            Prediction::Sampled { discretisation, extent }
                if extent == Extent::Open || measured.held_to().is_some() =>
            {
                let start = fitted_start(system, force, discretisation, &measured.responses())?;
                predict(system, force, discretisation, Extent::Open, &start)
            }
            Prediction::Sampled { discretisation, extent } => {
                predict(system, force, discretisation, extent, &rest)
            }
        }
    }
}

/// Returns the steady state of a nonlinear system under the mean period of the measured force. The
/// response is given as the channels record it, repeated for every buffered period. Of several
/// steady states, it returns the state nearest to the measured response.
pub(crate) fn steady_state(
    system: &NonlinearSystem,
    channels: ChannelPhase,
    measured: &Block,
) -> Result<Response, EstimateError> {
    let (motion, kind) = measured.response();
    let period = measured.period;
    let (force, motion) = (measured.force.period_mean(period)?, motion.period_mean(period)?);
    let (force, motion) = channels.correct(&force, &motion)?;
    let start = periodic_start(&motion, kind)?;
    let steady = nonlinear::predict(system, &force, Extent::WholePeriod, &start)?;
    shown(&steady, channels, measured.force.len() / period)
}

/// Returns the response of a nonlinear system to the measured force of an open record, from the
/// best-fitting initial state.
fn from_fitted_start(
    system: &NonlinearSystem,
    measured: &Block,
) -> Result<Response, EstimateError> {
    let (force, motions) = (&measured.force, measured.responses());
    let start = nonlinear::fitted_start(system, force, &motions)?;
    nonlinear::predict(system, force, Extent::Open, &start)
}

/// Returns a response as the channels record it, over a number of periods.
pub(crate) fn shown(
    response: &Response,
    phase: ChannelPhase,
    periods: usize,
) -> Result<Response, EstimateError> {
    let one = |record: &Record| -> Result<Record, EstimateError> {
        Ok(phase.as_measured(record)?.repeated(periods)?)
    };
    let [x, v, a] =
        [response.displacement(), response.velocity(), response.acceleration()].map(one);
    Ok(Response::new(x?, v?, a?)?)
}

/// Returns displacement and velocity at the first sample of a period of a response.
fn periodic_start(motion: &Record, kind: ResponseQuantity) -> Result<InitialState, EstimateError> {
    let spectrum = Spectrum::from_record(motion);
    // The highest line (half the sampling rate) of an even number of samples is excluded, because
    // it has no derivative.
    let lines = motion.len().div_ceil(2);
    let first = usize::from(kind != ResponseQuantity::Displacement);
    let at_zero = |order: i32| {
        let one = |channel: usize| -> f64 {
            let line = |n: usize| {
                let factor = Complex::new(0.0, spectrum.omega(n)).powi(order);
                let scale = if first == 0 {
                    Complex::from(1.0)
                } else {
                    kind.per_displacement(spectrum.omega(n)).inv()
                };
                (spectrum.lines()[(n, channel)] * scale * factor).re
            };
            (first..lines).map(line).sum()
        };
        DVector::from_iterator(motion.channels(), (0..motion.channels()).map(one))
    };
    Ok(InitialState::new(at_zero(0), at_zero(1))?)
}

/// Returns the reason why there is no prediction.
pub(crate) fn failed(reason: EstimateError, model: &Model, measured: &Block) -> AnalysisError {
    match growth(model.linear()) {
        Some(rate) => AnalysisError::Diverges { file: measured.file.clone(), rate },
        None => reason.into(),
    }
}

/// Returns the rate, in 1/s, at which the free response grows; `None` if it does not.
fn growth(system: &SecondOrderSystem) -> Option<f64> {
    let eigenvalues = system.eigenvalues().ok()?;
    eigenvalues.iter().map(|l| l.re).filter(|rate| *rate > 0.0).max_by(f64::total_cmp)
}

/// Returns one quantity of a response.
pub(crate) fn channels(response: &Response, kind: ResponseQuantity) -> &Record {
    match kind {
        ResponseQuantity::Displacement => response.displacement(),
        ResponseQuantity::Velocity => response.velocity(),
        ResponseQuantity::Acceleration => response.acceleration(),
    }
}
