//! The response of the identified system to a measured force.

use mechid_estimate::{EstimateError, fitted_start, predict, predict_periodic};
use mechid_model::Discretisation;
use mechid_model::ResponseQuantity;
use mechid_model::{InitialState, Response, SecondOrderSystem};
use mechid_signal::Extent;
use mechid_signal::Record;

use crate::AnalysisError;
use crate::measurement::Block;

/// Kind of prediction of a record, in keeping with how the machine was identified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prediction {
    /// Steady state under whole periods of a band-limited force, means subtracted.
    Steady,
    /// Step from sample to sample.
    Sampled {
        /// Assumption on the force between samples.
        discretisation: Discretisation,
        /// Extent of the window.
        extent: Extent,
    },
}

/// One kind of response, measured and predicted.
#[derive(Debug)]
pub struct Compared {
    /// Kind of response.
    pub kind: ResponseQuantity,
    /// Measured response, samples × degrees of freedom.
    pub measured: Record,
    /// Predicted response, samples × degrees of freedom.
    pub predicted: Record,
}

impl Prediction {
    /// Returns every response measured, as far as it is held, beside the one predicted. An open record
    /// starts from the state that fits it best.
    pub(crate) fn predict(
        self,
        system: &SecondOrderSystem,
        measured: &Block,
    ) -> Result<Vec<Compared>, AnalysisError> {
        let motions = measured.responses();
        let response =
            self.response(system, measured).map_err(|reason| failed(reason, system, measured))?;
        let compared = |(kind, record): (ResponseQuantity, &Record)| {
            let (measured, predicted) = (record.clone(), channels(&response, kind).clone());
            match self {
                // Transducers have offsets, and a spectrum's mean was not fitted.
                Prediction::Steady => Compared {
                    kind,
                    measured: measured.without_mean(),
                    predicted: predicted.without_mean(),
                },
                Prediction::Sampled { .. } => Compared { kind, measured, predicted },
            }
        };
        Ok(motions.into_iter().map(compared).collect())
    }

    fn response(
        self,
        system: &SecondOrderSystem,
        measured: &Block,
    ) -> Result<Response, EstimateError> {
        let (force, rest) = (&measured.force, InitialState::rest(system.dof()));
        match self {
            Prediction::Steady => predict_periodic(system, force),
            // Nor does the beginning of a long period return to itself.
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

/// Returns the reason why there is no prediction.
pub fn failed(
    reason: EstimateError,
    system: &SecondOrderSystem,
    measured: &Block,
) -> AnalysisError {
    match growth(system) {
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
pub fn channels(response: &Response, kind: ResponseQuantity) -> &Record {
    match kind {
        ResponseQuantity::Displacement => response.displacement(),
        ResponseQuantity::Velocity => response.velocity(),
        ResponseQuantity::Acceleration => response.acceleration(),
    }
}
